"""Results as CSV, a line each, so that drawing them is separate from computing them."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Iterable
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

from deltaopt.files.atomic_write import atomic_write

Record = TypeVar("Record")
_READ: dict[str, Callable[[str], object]] = {
    "str": str,
    "int": int,
    "float": float,
    "bool": lambda text: text == "True",
}
"""How a cell is read, by the annotation of its field."""


def add_drawn_again(parser: argparse.ArgumentParser) -> None:
    """Add --drawn-again."""
    parser.add_argument(
        "--drawn-again",
        action="store_true",
        help="draw what an earlier run has written, and compute nothing",
    )


def write_records(file: Path, records: Iterable[Any], kind: type) -> None:
    """Write dataclass records of one kind into a file, a column for each field."""
    with atomic_write(file) as temporary, temporary.open("w", newline="", encoding="utf-8") as text:
        writer = csv.DictWriter(text, [field.name for field in fields(kind)])
        writer.writeheader()
        writer.writerows(asdict(record) for record in records)


def read_records(file: Path, kind: Callable[..., Record]) -> list[Record]:
    """The records of a file that ``write_records`` has written. Raises OSError without it."""
    with file.open(newline="", encoding="utf-8") as text:
        rows = list(csv.DictReader(text))
    read = {field.name: _READ[str(field.type)] for field in fields(kind)}  # type: ignore[arg-type]
    return [kind(**{name: of(row[name]) for name, of in read.items()}) for row in rows]
