"""Sweep files: which scenes and robots, and what is changed in them.

scene: ../pick_and_place.yaml          # or a list of files; likewise robot, instead of theirs
grid:                                  # each value with each of the others
  payload: [500 g, 1 kg]
  robot.drive.torque times: {from: 0.8, to: 1.2, steps: 5}
points:                                # each with all of the grid
  - {robot.upper_arm.length plus: 20 mm, robot.upper_arm.mass plus: 50 g}
samples:                               # each with all of the grid and the points
  number: 1000
  ranges: {robot.forearm.length: {from: 700 mm, to: 900 mm}}
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, product
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator

from deltaopt.errors import SceneError, installed
from deltaopt.files.validated_record import Number, Record, Text, optional
from deltaopt.files.yaml_file import read_yaml
from deltaopt.robot.robot import load_robot
from deltaopt.scene.scene_file import content_with_files, load_job, made_of
from deltaopt.sensitivity.keys import changed, in_si, require_once
from deltaopt.settings import TOLERANCES
from deltaopt.sweeps.points import NUMBERS, Base, Changes, SweepPoints, column_of

MOST_POINTS = 1_000_000
_NUMBER = f"a whole number from 1 to {MOST_POINTS}"
_STEPS = f"a whole number, at least 2 and below {MOST_POINTS}"
_VALUES = "a list of values, or {from, to, steps}"
_FILES = "the path of a file relative to this one, or a list of one of them at least"
_GRID = f"a mapping of keys, such as robot.drive.torque, each to {_VALUES}"
_METHOD = "sobol or latin_hypercube"
_RANGES = "a mapping of keys, such as robot.drive.torque, each to {from, to}"
_POINTS = "a list of mappings of keys to values"
_SAMPLES = "a mapping with the keys number, ranges, method, seed"
_COLUMN = "a key of the sweep, or one of " + ", ".join(NUMBERS)

_TOLERANCE = "a number from {:g} to {:g}".format(*TOLERANCES)

_Files = Text | Annotated[tuple[Text, ...], Field(min_length=1)]
_Tolerance = Annotated[Number, Field(ge=TOLERANCES[0], le=TOLERANCES[1])]


class Samples(Record):
    """Points spread evenly over ``ranges`` of keys: so many (``number``), by a ``method`` of
    ``scipy.stats.qmc``, always the same for a ``seed``."""

    ranges: dict[str, Any] = Field(min_length=1, description=_RANGES)
    number: Annotated[int, Field(ge=1, le=MOST_POINTS)] = Field(description=_NUMBER)
    method: Literal["sobol", "latin_hypercube"] = Field("sobol", description=_METHOD)
    seed: Annotated[int, Field(ge=0)] = Field(default=1, description="a whole number, at least 0")

    @field_validator("ranges")
    @classmethod
    def _in_si(cls, ranges: dict[str, Any]) -> dict[str, Any]:
        return {key: _ends("ranges", key, given) for key, given in ranges.items()}

    @property
    def drawn(self) -> list[dict[str, Any]]:
        """The points. Raises MissingPackage without scipy."""
        qmc = installed("scipy.stats", "sweep").qmc
        least, most = np.array(list(self.ranges.values())).T
        if self.method == "sobol":  # of which the first of a power of two are taken
            points = qmc.Sobol(len(least), rng=self.seed).random_base2(self.number.bit_length())
        else:
            points = qmc.LatinHypercube(len(least), rng=self.seed).random(self.number)
        values = qmc.scale(points[: self.number], least, most).tolist()
        return [dict(zip(self.ranges, each, strict=True)) for each in values]


class Sweep(Record):
    """A sweep as its file says it: the docstring of this module has an example.

    ``scene``: files of scenes or cycles. ``robot``: files of robots in their place; None for their
    own. ``grid``, ``points``, ``samples``: what is changed. ``tolerance``: of the plans.
    ``column``: what is shown, and least in the best plan. ``pareto``: two columns of which less is
    better, for a picture of the best compromises. Raises SceneError for what cannot be used.

    Examples:
        >>> heavier = {"payload": [0.5, 1.0]}
        >>> deltaopt.Sweep(scene="problems/pick_and_place.yaml", grid=heavier).tolerance
        0.001
    """

    scene: _Files = Field(description=_FILES)
    robot: _Files | None = optional(_FILES)
    grid: dict[str, Any] = Field(default={}, description=_GRID)
    points: tuple[dict[str, Any], ...] | None = optional(_POINTS, min_length=1)
    samples: Samples | None = optional(_SAMPLES)
    tolerance: _Tolerance = Field(default=1e-3, description=_TOLERANCE)
    column: Text = Field(default="duration", description=_COLUMN)
    pareto: tuple[Text, Text] | None = optional(f"two columns, each {_COLUMN}")

    @field_validator("grid")
    @classmethod
    def _in_si(cls, grid: dict[str, Any]) -> dict[str, Any]:
        return {key: _values(key, given) for key, given in grid.items()}

    def require_consistent(self) -> None:
        for each in self.points or [{}]:
            require_once([*self.grid, *each, *(self.samples.ranges if self.samples else {})])
        changes = chain.from_iterable(self._axes)
        pairs = chain.from_iterable(each.items() for each in changes)
        others = {column_of(key) for key, value in pairs if not isinstance(value, int | float)}
        known = {*self.headers, *NUMBERS} - others
        for key, given in (("column", self.column), *(("pareto", p) for p in self.pareto or ())):
            if given not in known:
                expected = f"one of {', '.join(sorted(known))}, columns of numbers"
                raise SceneError(None, key, given, expected)
        if self.pareto and len(set(self.pareto)) < len(self.pareto):
            raise SceneError(None, "pareto", list(self.pareto), "two columns that differ")

    @property
    def headers(self) -> list[str]:
        """Of the columns of what is changed."""
        parts = (self.grid, *(self.points or ()), self.samples.ranges if self.samples else {})
        return list(dict.fromkeys(map(column_of, chain(*parts))))

    @property
    def _axes(self) -> list[list[Changes]]:
        """What is changed by the grid and by points, each with all of the others."""
        axes: list[list[Changes]]
        axes = [[{key: value} for value in values] for key, values in self.grid.items()]
        if self.points:
            axes.append([{k: in_si(k, v) for k, v in each.items()} for each in self.points])
        return axes

    def points_from(self, folder: Path) -> SweepPoints:
        """All points; files are relative to a folder. Raises SceneError, also where no value of a
        key can be used."""
        bases = [
            base_of(folder, scene, robot)
            for scene in ([self.scene] if isinstance(self.scene, str) else self.scene)
            for robot in (self.robot if isinstance(self.robot, tuple) else [self.robot])
        ]
        axes = self._axes + ([self.samples.drawn] if self.samples else [])
        for changes in axes:
            _require_usable(bases, changes)
        return SweepPoints(bases, axes, self.headers, self.tolerance)


def load_sweep(path: str | Path) -> tuple[Sweep, SweepPoints]:
    """The sweep of a file, and its points.

    Raises SceneError, naming file and key, if it or a file that it names cannot be used.
    """
    file = Path(path)
    sweep = Sweep.from_content(read_yaml(file), file)
    try:
        return sweep, sweep.points_from(file.parent)
    except SceneError as error:
        raise (error if error.file else error.inside(file=file)) from None


def base_of(folder: Path, scene: str, robot: str | None) -> Base:
    """The content of a scene's file and of that of a robot, its own unless one is named. Raises
    SceneError."""
    file = folder / scene
    load_job(file)  # its own errors name lines
    content = content_with_files(file)
    if robot is None:
        return Base({"scene": scene}, file, content)
    load_robot(folder / robot)
    content["robot"] = read_yaml(folder / robot)
    return Base({"scene": scene, "robot": robot}, file, content)


def _require_usable(bases: Sequence[Base], changes: Sequence[Changes]) -> Any:
    """Raise SceneError where no base can be used with any of some changes."""
    for base, each in product(bases, changes):
        try:
            return made_of(changed(base.content, each), base.file)
        except SceneError as error:
            wrong = error
            if error.problem == "is not a known key":
                break
    raise SceneError(None, wrong.key, wrong.value, wrong.expected, wrong.problem)


def _values(key: str, given: Any) -> list[Any]:
    """The values that stand under a key of the grid. Raises SceneError."""
    if isinstance(given, list | tuple) and given:
        return [in_si(key, each) for each in given]
    if isinstance(given, dict) and "steps" in given:
        steps = given["steps"]
        if steps not in range(2, MOST_POINTS):
            raise SceneError(None, f"grid.{key}.steps", steps, _STEPS)
        ends = _ends("grid", key, {name: each for name, each in given.items() if name != "steps"})
        return [*np.linspace(*ends, int(steps)).tolist()]
    raise SceneError(None, f"grid.{key}", given, _VALUES)


def _ends(part: str, key: str, given: Any) -> tuple[float, float]:
    """The ends of a range of a key, in a part of the file. Raises SceneError."""
    if isinstance(given, dict) and set(given) == {"from", "to"}:
        least, most = in_si(key, given["from"]), in_si(key, given["to"])
        if isinstance(least, int | float) and isinstance(most, int | float) and least < most:
            return least, most
    raise SceneError(None, f"{part}.{key}", given, "{from, to}, numbers, the first the lesser")
