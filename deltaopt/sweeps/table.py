"""The table of a sweep: a CSV file to which rows are added as they come."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from deltaopt.errors import Unusable, installed, on_one_line
from deltaopt.files.atomic_write import atomic_write, require_replaceable
from deltaopt.files.csv_table import csv_text
from deltaopt.files.output_folder import locked

PARQUET = ".parquet"


class OtherTable(Unusable):
    """A file is the table of another sweep, or is being written."""


def csv_of(file: Path) -> Path:
    """The CSV file to which rows are added of the table that is to be ``file`` in the end."""
    return file.with_suffix(".csv") if file.suffix == PARQUET else file


def text(value: object) -> str:
    """A value as the entry of a table, on one line."""
    if value is None:
        return ""
    return on_one_line(value) if isinstance(value, str) else json.dumps(value)


ELSEWHERE = "remove it, or write to another file with -o"


class Table:
    """The CSV file of a sweep with these ``columns``, open for more rows.

    Rows are added whole: what a process that was killed left half written is not there any more.
    """

    def __init__(self, file: Path, columns: Sequence[str], out: BinaryIO) -> None:
        self.columns, self._out = columns, out
        self.done = dict[int, str]()
        """The hash of the inputs of each point that has a row, by its number."""
        header = _line(columns)
        content = file.read_bytes()
        if not header.startswith(content[: len(header)]):
            raise OtherTable(f"{file} is not a table with the columns of this sweep; {ELSEWHERE}")
        out.truncate(content.rfind(b"\n") + 1)
        if not content.startswith(header):
            self._write(columns)
        with file.open(encoding="utf-8", newline="") as opened_lines:
            lines = csv.reader(opened_lines)
            next(lines)
            self.done |= {int(line[0]): line[1] for line in lines}

    def add(self, row: Mapping[str, object]) -> None:
        """Add a row of values by the names of their columns."""
        self._write([text(row.get(name)) for name in self.columns])

    def _write(self, entries: Sequence[str]) -> None:
        self._out.write(_line(entries))
        self._out.flush()


@contextmanager
def table(file: Path, columns: Sequence[str]) -> Iterator[Table]:
    """The table of a file, made if need be, for one process at a time.

    Raises OtherTable for that of another sweep, and OSError.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    require_replaceable(file)
    with file.open("ab") as out, ExitStack() as held:
        try:
            held.enter_context(locked(file, wait=False))
        except BlockingIOError:
            raise OtherTable(f"{file}: another sweep is writing it") from None
        yield Table(file, columns, out)


def _line(entries: Sequence[str]) -> bytes:
    return csv_text(entries, ()).encode()


def read(file: Path) -> Any:
    """The rows of a table in the order of its points, as a pandas DataFrame. Raises
    MissingPackage."""
    rows = installed("pandas", "sweep").read_csv(csv_of(file))
    return rows.sort_values("point", ignore_index=True)


def write_parquet(file: Path) -> None:
    """Write a table as Parquet too, from its CSV file. Raises MissingPackage."""
    installed("pyarrow", "parquet")
    with atomic_write(file) as temporary:
        read(file).to_parquet(temporary)
