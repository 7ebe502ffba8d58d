"""Design files: what of robots and scenes may be changed, within which bounds, and what is best."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, product
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from deltaopt.errors import SceneError, shown
from deltaopt.files.csv_table import WrongCsv, read_csv
from deltaopt.files.units import DURATION, begins_with_number
from deltaopt.files.validated_record import NonNegative, Number, Positive, Record, Text, optional
from deltaopt.files.yaml_file import placed_in, read_yaml
from deltaopt.scene.scene_file import load_job
from deltaopt.sensitivity.keys import (
    Content,
    changed,
    content_of,
    job_of,
    require_once,
)

_KEY = "a key of a scene or of its robot, such as robot.drive.gear.ratio"
_MAPPINGS = "a list of mappings with the keys"
_CATALOGUES = f"{_MAPPINGS} file, name, price, number, columns"


class Change(Record):
    """A number that may be changed from ``least`` to ``most``, SI units, at a ``price`` for one of
    its unit."""

    key: Text = Field(description=_KEY)
    least: Number = Field(description="a number in SI units")
    most: Number = Field(description="a number in SI units, greater than least")
    price: Number = Field(default=0.0, description="what one of its unit costs")

    def require_consistent(self) -> None:
        if not self.least < self.most:
            raise SceneError(None, "most", self.most, f"a number greater than {self.least:g}")


class Catalogue(Record):
    """A maker's table, of which one row is chosen: its ``file``, the columns with the ``name`` and
    the ``price`` of a row, the ``number`` that is bought, and ``columns``: for each key the column
    with its value. What stands in brackets in a column's head is the unit of its numbers: "peak
    torque [N*m]"."""

    file: Text = Field(description="the path of a CSV file, relative to this file")
    name: Text = Field(description="the head of the column with names")
    price: Text | None = optional("the head of the column with prices")
    number: Positive = Field(default=1.0, description="a number greater than 0")
    columns: dict[str, Text] = Field(description=f"for each key ({_KEY}) the head of a column")


class DesignFile(Record):
    """What is designed.

    ``scenes``: files of scenes and cycles. ``over``: whether the sum of their durations counts or
    that of the ``worst``. ``per_second``: what a second of it costs. ``longest``: what each may
    take at most, s.
    """

    scenes: tuple[Text, ...] = Field(min_length=1, description="a list of scene files")
    change: tuple[Change, ...] = Field((), description=f"{_MAPPINGS} key, least, most, price")
    catalogues: tuple[Catalogue, ...] = Field((), description=_CATALOGUES)
    over: Literal["sum", "worst"] = Field(default="sum", description="sum or worst")
    per_second: NonNegative = Field(default=1.0, description="a price, at least 0")
    longest: Annotated[Positive, DURATION] | None = None

    def require_consistent(self) -> None:
        of_rows = chain.from_iterable(catalogue.columns for catalogue in self.catalogues)
        require_once([*(change.key for change in self.change), *of_rows])


@dataclass(frozen=True)
class Choice:
    """A row of a catalogue, or one of each: its ``name``, ``price``, and the ``values`` of keys as
    a file would have them, "3.82 N*m"."""

    name: str
    price: float
    values: Mapping[str, str]


@dataclass(frozen=True)
class Design:
    """What is designed, with all files read: ``contents`` of scenes, rows of ``catalogues``."""

    asked: DesignFile
    contents: tuple[Content, ...]
    catalogues: tuple[tuple[Choice, ...], ...]

    def choices(self) -> Iterator[Choice]:
        """Rows of all catalogues, one of each."""
        for rows in product(*self.catalogues):
            name = ", ".join(row.name for row in rows) or "design"
            values = {key: value for row in rows for key, value in row.values.items()}
            yield Choice(name, sum(row.price for row in rows), values)

    def jobs(self, choice: Choice, values: Sequence[float]) -> list[Any]:
        """The scenes and cycles with the rows that were chosen and other values of what may be
        changed. Raises SceneError for those that cannot be used."""
        keys = (each.key for each in self.asked.change)
        given = {**choice.values, **dict(zip(keys, values, strict=True))}
        return [job_of(changed(content, given)) for content in self.contents]

    def worth(self, choice: Choice, values: Sequence[float], durations: Sequence[float]) -> float:
        """What a design costs: its rows, what was changed, and the durations of its scenes, s."""
        asked = self.asked
        prices = (each.price * x for each, x in zip(asked.change, values, strict=True))
        seconds = sum(durations) if asked.over == "sum" else max(durations)
        return choice.price + sum(prices) + asked.per_second * seconds


def load_design(path: str | Path) -> Design:
    """Read a design file and all files that it names.

    Raises SceneError, naming file and key, if one cannot be used.
    """
    file = Path(path)
    asked = DesignFile.from_content(read_yaml(file), file)
    contents = tuple(content_of(load_job(file.parent / name)) for name in asked.scenes)
    rows = tuple(_rows(file, index, each) for index, each in enumerate(asked.catalogues))
    found = Design(asked, contents, rows)
    for choice, side in product(found.choices(), ("least", "most")):
        try:
            found.jobs(choice, [getattr(each, side) for each in asked.change])
        except SceneError as error:
            expected = f"{error.expected}, at the bounds of change of {choice.name}"
            raise SceneError(file, error.key, error.value, expected, error.problem) from None
    return found


def _rows(file: Path, index: int, asked: Catalogue) -> tuple[Choice, ...]:
    """The rows of a catalogue. Raises SceneError, also where a cell in a column that is used has no
    number: the row would be ranked with the number of another motor."""
    name, price = asked.name.lower(), [asked.price.lower()] if asked.price else []
    try:
        table = read_csv(file.parent / asked.file)
        for head in (asked.name, *asked.columns.values(), *([asked.price] if asked.price else [])):
            if head.lower() not in table.names:
                raise WrongCsv(f"has no column {head}")
        prices = asked.number * table.columns(price).sum(axis=1)
        rows = [dict(zip(table.names, cells, strict=True)) for cells in table.rows]
        for head in asked.columns.values():
            cells = [(row[head.lower()], line) for row, line in zip(rows, table.lines, strict=True)]
            wrong = [f"{shown(x)} in line {line}" for x, line in cells if not begins_with_number(x)]
            if wrong:
                raise WrongCsv(f"has no number in column {head}, but {', '.join(wrong)}")
    except WrongCsv as error:
        key = f"catalogues[{index}].file"
        expected = "a CSV file with numbers in the columns that are named"
        with placed_in(file):
            raise SceneError(None, key, asked.file, expected, f"{asked.file} {error}") from None
    units = {key: (head.lower(), _unit(head)) for key, head in asked.columns.items()}
    found = list[Choice]()
    for row, cost in zip(rows, prices.tolist(), strict=True):
        values = {key: f"{row[head]} {unit}".strip() for key, (head, unit) in units.items()}
        found.append(Choice(row[name], cost, values))
    return tuple(found)


def _unit(head: str) -> str:
    """What stands in brackets in the head of a column."""
    return head.partition("[")[2].rstrip("] ")
