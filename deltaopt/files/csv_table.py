"""Tables of numbers in CSV files, as programs, spreadsheets and people write them.

The separator is a comma, or a tab or semicolon where the first line has one: beside those numbers
may have decimal commas. A byte order mark, lines that begin with # and lines without any entry are
passed over. What could be read in two ways is refused.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from io import StringIO
from itertools import chain
from math import isnan, nan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deltaopt.errors import on_one_line, shown
from deltaopt.files.atomic_write import atomic_write
from deltaopt.files.regular_file import content_of
from deltaopt.files.validated_record import LARGEST

_LARGEST_FILE = 500
"""Size of a file, MB: a million rows of every quantity are less."""


class WrongCsv(ValueError):
    """A file is no table of numbers: the end of a sentence that begins with the file's name."""


@dataclass(frozen=True)
class CsvTable:
    """The entries of a file.

    ``names``: of its columns, in small letters; none where its first line has numbers alone.
    ``rows``: of entries as text, as many in each. ``lines``: of the file, in which they stand.
    """

    names: Sequence[str]
    rows: Sequence[Sequence[str]]
    lines: Sequence[int]

    def columns(self, names: Sequence[str]) -> NDArray[np.float64]:
        """The numbers of columns, (N, len(names)); all there are where the file names none.

        Raises WrongCsv where a column is missing, unnamed or there twice, or an entry is no number
        that can be computed with.
        """
        if not self.names and any(len(row) != len(names) for row in self.rows):
            raise WrongCsv(f"names no columns and has not {len(names)}, {', '.join(names)}")
        for name in names:
            if self.names and self.names.count(name) != 1:
                number = self.names.count(name)
                raise WrongCsv(f"names {number} columns {name} in its first line; one is needed")
        places = [self.names.index(name) if self.names else k for k, name in enumerate(names)]
        values = np.zeros((len(self.rows), len(places)))
        for line, row, found in zip(self.lines, self.rows, values, strict=True):
            for k, place in enumerate(places):
                found[k] = _number(row[place])
                if not abs(found[k]) <= LARGEST:
                    what = f"{names[k]} is {shown(row[place])} in line {line}"
                    raise WrongCsv(f"{what}; a number of at most {LARGEST:g} is needed")
        return values


def write_csv(
    file: Path, names: Sequence[str], rows: Iterable[Sequence[float]], remarks: Sequence[str] = ()
) -> None:
    """Write rows of numbers below a header of names, with so many digits that reading them gives
    the same doubles; remarks stand before the header, after a #. The file is whole or not there."""
    with (
        atomic_write(file) as temporary,
        temporary.open("w", encoding="utf-8", newline="\n") as out,
    ):
        out.writelines(f"# {remark}\n" for remark in remarks)
        csv.writer(out, lineterminator="\n").writerows(chain([names], rows))


def csv_text(names: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """The text of a CSV file: a header, and rows of words and numbers in full precision."""
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows([names, *rows])
    return text.getvalue()


def read_csv(file: Path, megabytes: int = _LARGEST_FILE) -> CsvTable:
    """Read a CSV file of at most so many megabytes. Raises WrongCsv where it is none, or could be
    read in two ways."""
    try:
        content = content_of(file, megabytes).decode("utf-8-sig")
    except OSError as error:
        raise WrongCsv(str(error.strerror)) from None
    except UnicodeError:
        raise WrongCsv("is no text in UTF-8") from None
    try:
        text = list(enumerate(content.splitlines(), 1))
        text = [(k, line) for k, line in text if line.strip(' ",;\t') and line.strip()[0] != "#"]
        separator = next((sign for sign in "\t;" if text and sign in text[0][1]), ",")
        reader = csv.reader((line for _, line in text), delimiter=separator, strict=True)
        rows = [[entry.strip() for entry in row] for row in reader]
    except csv.Error as error:
        raise WrongCsv(f"cannot be read as CSV: {error}") from None
    lines = [k for k, _ in text]
    if len(rows) != len(lines):
        raise WrongCsv("has an entry in quotes that does not end in its line")
    for line, row in zip(lines, rows, strict=True):
        if len(row) != len(rows[0]):
            raise WrongCsv(f"line {line} has {len(row)} columns, the first line {len(rows[0])}")
    if separator != ",":
        rows = _with_decimal_points(rows)
    if not rows or not any(isnan(_number(entry)) for entry in rows[0]):
        return CsvTable((), rows, lines)
    names = [on_one_line(name.lower()) for name in rows[0]]
    return CsvTable(names, rows[1:], lines[1:])


def _with_decimal_points(rows: list[list[str]]) -> list[list[str]]:
    """Rows with points for decimal commas. Raises WrongCsv where numbers have both signs, one of
    which then separates thousands."""
    points = [[entry.replace(",", ".") for entry in row] for row in rows]
    both = zip(chain(*rows), chain(*points), strict=True)
    fractions = {
        entry == point for entry, point in both if "." in point and not isnan(_number(point))
    }
    if len(fractions) > 1:
        raise WrongCsv("has decimal commas in some numbers and decimal points in others")
    return points


def _number(text: str) -> float:
    """Not a number for what is none."""
    try:
        return nan if "_" in text else float(text)
    except ValueError:
        return nan
