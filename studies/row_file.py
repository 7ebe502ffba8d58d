"""Rows of a campaign in a CSV file that grows row by row, so that an interrupted one goes on."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

from deltaopt.files.atomic_write import atomic_write

Row = TypeVar("Row")


def read(file: Path, kind: type[Row]) -> list[Row]:
    """Return the rows of a file of dataclasses of a ``kind``, whose fields are numbers, texts and
    truth values; without an incomplete one at its end, none if there is no file."""
    if not file.exists():
        return []
    types = {each.name: each.type for each in fields(kind)}  # type: ignore[arg-type]
    rows = []
    with file.open(newline="", encoding="utf-8") as lines:
        for line in csv.DictReader(lines):
            if None in line.values():
                break
            rows.append(kind(**{name: _parsed(types[name], line[name]) for name in types}))
    return rows


def _parsed(kind: object, text: str) -> Any:
    name = kind if isinstance(kind, str) else getattr(kind, "__name__", "str")
    if name == "bool":
        return text == "True"
    return {"int": int, "float": float}.get(name, str)(text)


def append(file: Path, kind: type[Row], rows: Iterable[Row]) -> None:
    """Add rows to a file, which gets a header if it is empty."""
    with file.open("a", newline="", encoding="utf-8") as lines:
        writer = csv.DictWriter(lines, [each.name for each in fields(kind)])  # type: ignore[arg-type]
        if not lines.tell():
            writer.writeheader()
        writer.writerows(asdict(row) for row in rows)  # type: ignore[call-overload]


def resumed(
    file: Path,
    kind: type[Row],
    numbers: Iterable[int],
    of: Callable[[int], Row],
    number_of: Callable[[Row], int],
    progress: Callable[[int], None],
) -> list[Row]:
    """Return the rows of all ``numbers``, in their order: those in the file as they stand there,
    the others made by ``of`` and appended as they come. ``progress``: told how many are done."""
    known = {number_of(row): row for row in read(file, kind)}
    with atomic_write(file) as temporary:  # without the row at which it was interrupted
        append(temporary, kind, known.values())
    found = []
    for number in numbers:
        if number not in known:
            known[number] = of(number)
            append(file, kind, [known[number]])
        found.append(known[number])
        progress(len(found))
    return found
