"""Rows of results in a CSV file: one that grows as they come, so that what was interrupted goes on,
or one that is drawn from, so that drawing is separate from computing.

A row is a frozen dataclass of bool, int, float and str; its fields are the columns.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Hashable, Iterable
from concurrent.futures import Executor, as_completed
from dataclasses import asdict, fields
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from deltaopt.files.atomic_write import atomic_write
from deltaopt.files.regular_file import content_of

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

R = TypeVar("R", bound="DataclassInstance")
"""The kind of a row."""
K = TypeVar("K", bound=Hashable)
"""What a row is known by."""
_LARGEST = 1000
"""Size of a file, MB: of millions of rows."""


def read_rows(file: Path, kind: type[R]) -> list[R]:
    """The rows of a file. An incomplete one at its end is left out, and so are all of a file that
    lacks a column. Raises OSError where there is no file."""
    kinds = {each.name: each.type for each in fields(kind)}
    rows = []
    for line in csv.DictReader(StringIO(content_of(file, _LARGEST).decode("utf-8"), newline="")):
        if None not in line.values() and kinds.keys() <= line.keys():
            rows.append(kind(**{name: _parsed(kinds[name], line[name]) for name in kinds}))
    return rows


def append_rows(file: Path, rows: Iterable[DataclassInstance]) -> None:
    """Add rows to a file, which gets a header if it is empty."""
    with file.open("a", newline="", encoding="utf-8") as lines:
        for row in rows:
            writer = csv.DictWriter(lines, [each.name for each in fields(row)])
            if not lines.tell():
                writer.writeheader()
            writer.writerow(asdict(row))


def rewrite_rows(file: Path, rows: Iterable[DataclassInstance]) -> None:
    """Write a file anew with these rows alone, at once or not at all: without one at which writing
    it was interrupted."""
    with atomic_write(file) as temporary:
        temporary.touch()
        append_rows(temporary, rows)


def kept_rows(
    file: Path,
    kind: type[R],
    keys: Iterable[K],
    key_of: Callable[[R], K],
    made: Callable[[K], R],
    progress: Callable[[int], None],
    pool: Executor | None = None,
) -> list[R]:
    """A row for each key, in their order: from the file where it has one, else made and appended.

    ``progress``: is called with the number of rows that are done. ``pool``: makes rows at the same
    time, which are appended as they come.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    known = read_rows(file, kind) if file.exists() else []
    rewrite_rows(file, known)
    found, keys = {key_of(row): row for row in known}, list(keys)
    left = [key for key in keys if key not in found]
    progress(len(keys) - len(left))
    if pool is None:
        rows: Iterable[R] = map(made, left)
    else:
        rows = (each.result() for each in as_completed([pool.submit(made, key) for key in left]))
    for done, row in enumerate(rows, len(keys) - len(left) + 1):
        found[key_of(row)] = row
        append_rows(file, [row])
        progress(done)
    return [found[key] for key in keys]


def _parsed(kind: object, text: str) -> Any:
    """A value of a field, whose type is a name where annotations are not evaluated."""
    name = kind.__name__ if isinstance(kind, type) else str(kind)
    if name == "bool":
        return text == "True"
    return {"int": int, "float": float}.get(name, str)(text)
