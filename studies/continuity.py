"""Whether neighbouring problems have neighbouring plans: durations along lines of problems.

On a line one number of a scene, such as the height of a wall, goes from one value to another in
equal steps. The least duration is continuous in it, also where two ways are equally fast. So where
the duration jumps by more than it changes beside, one of the two plans is not the fastest.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np

import deltaopt
from deltaopt.cli.arguments import one_or_more
from deltaopt.curves.piecewise import Array
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.files.yaml_file import read_yaml
from studies.bodies import scenes as random_bodies
from studies.kept_rows import kept_rows
from studies.problems import INDUSTRIAL, PROBLEMS, add_directory
from studies.text_table import table
from studies.timed import attempted

SMALL = {"problems": 4, "lines": ["via x", "payload"]}
_RANDOM = 12
"""Lines among random bodies."""
FLIP = 2e-3
"""Share of the duration by which it jumps, beyond what it changes in the steps beside."""
_BESIDE = 1.5
"""By how much more than in the steps beside a duration may change where it is steep and bent."""

Key = tuple[str | int, ...]
_WALL = {"box": {"from": [0.81, -0.005, -0.5], "to": [1.5, 0.005, 0.5]}}
_SPHERE = {"sphere": {"centre": [0.85, 0.0, 0.01], "radius": 0.04}}
_ACROSS = {"start": [0.85, -0.1525, 0.0], "goal": [0.85, 0.1525, 0.0], "payload": 1.0}


@dataclass(frozen=True)
class Line:
    """Problems in which a number goes from ``first`` to ``last``; ``scene``: that of a number."""

    name: str
    scene: Callable[[float], deltaopt.Scene]
    first: float
    last: float


def _line(name: str, file: str, key: Key, first: float, last: float, **changes: Any) -> Line:
    """A scene of ``problems/`` with some changes, of which the number at a key changes."""

    def scene(number: float) -> deltaopt.Scene:
        content: dict[str, Any] = read_yaml(PROBLEMS / f"{file}.yaml") | deepcopy(changes)
        robot = content["robot"].split("/")[-1]
        inner: Any = content
        for each in key[:-1]:
            inner = inner[each]
        inner[key[-1]] = number
        content["robot"] = deltaopt.load_robot(PROBLEMS / "robots" / robot)
        return deltaopt.Scene(**content)

    return Line(name, scene, first, last)


def _among_bodies() -> Iterator[Line]:
    """Random moves with one to five bodies about them, whose goals go across; every other one
    begins at a speed, across too."""
    robot = deltaopt.load_robot(INDUSTRIAL)
    for k, move in enumerate(random_bodies(robot, _RANDOM, seed=5)):
        start, goal = np.array(move.given_points)
        across = np.cross(goal - start, [1.0, 0.3, -0.2])
        across *= 0.1 * np.linalg.norm(goal - start) / np.linalg.norm(across)

        def scene(
            share: float,
            move: deltaopt.Scene = move,
            goal: Array = goal,
            across: Array = across,
            is_moving: bool = k % 2 == 1,
        ) -> deltaopt.Scene:
            given: dict[str, Any] = {"goal": (goal + share * across).tolist()}
            if is_moving:
                state = {"at": move.start, "velocity": (10.0 * across).tolist()}
                given["start"] = deltaopt.State(**state)
            return move.model_copy(update=given)

        yield Line(f"among bodies {k + 1}", scene, -1.0, 1.0)


_CROSS, _BOX, _OVER = "industrial_cross", "keep_out/into_a_box", "keep_out/wall_25_305_25"
_BELT, _STATE, _VIA = "moving/belt", "moving/passed_state", "via/within"
_CELL = {"start": [0.85, -0.15, -0.1], "keep_out": [_WALL]}
_FROM_BELT = {
    "start": {"at": [0.85, -0.15, -0.05], "velocity": [0.0, 0.0, 0.5]},
    "goal": [0.85, 0.15, 0.0],
    "keep_out": [_WALL],
}
_ROBOTS = ("hornet_565", "industrial", "industrial_drive", "industrial_limited", "rl5")
LINES = (
    *(_line(f"goal y, {r}", _CROSS, ("goal", 1), 0.02, 0.16, robot=f"{r}.yaml") for r in _ROBOTS),
    *(
        _line(f"wall height, {r}", _OVER, ("keep_out", 0, "box", "from", 0), 0.84, 0.79, **c)
        for r in _ROBOTS
        for c in [{"robot": f"{r}.yaml", "keep_out": [_WALL]}]
    ),
    *(
        _line(f"sphere z, {r}", _CROSS, ("keep_out", 0, "sphere", "centre", 2), -0.03, 0.05, **c)
        for r in _ROBOTS
        for c in [{"robot": f"{r}.yaml", "keep_out": [_SPHERE], **_ACROSS}]
    ),
    _line("goal y, orsino", "pick_and_place", ("goal", 1), -0.03, 0.12),
    _line("goal z, orsino", "pick_and_place", ("goal", 2), -0.08, 0.08),
    _line("goal x, orsino", "pick_and_place", ("goal", 0), 0.36, 0.54),
    _line("start y, diagonal", "long_diagonal", ("start", 1), -0.08, 0.0),
    _line("payload", _CROSS, ("payload",), 0.1, 4.0),
    _line("torque", "pick_and_place", ("limits", "torque"), 5.0, 10.0),
    _line("wide wall height", _OVER, ("keep_out", 0, "box", "from", 0), 0.845, 0.80),
    _line("wide wall side", _OVER, ("keep_out", 0, "box", "to", 1), 0.0, 0.14),
    _line("wall y", _OVER, ("goal", 1), 0.02, 0.16, keep_out=[_WALL]),
    _line("wall side", _OVER, ("keep_out", 0, "box", "to", 2), 0.0, 0.2, keep_out=[_WALL]),
    _line("box side", _BOX, ("keep_out", 0, "box", "from", 0), 0.88, 0.79),
    _line("box start z", _BOX, ("start", 2), -0.15, 0.15),
    _line("box start y", _BOX, ("start", 1), -0.25, 0.0),
    _line("sphere radius", _CROSS, ("keep_out", 0, "sphere", "radius"), 0.005, 0.07,
          keep_out=[_SPHERE], **_ACROSS),
    _line("tool radius", _OVER, ("tool", "radius"), 1e-3, 0.02, tool={"radius": 0.0}),
    _line("column z", "keep_out/beside_a_column", ("start", 2), -0.08, 0.08),
    _line("belt speed", _BELT, ("goal", "belt", 2), -0.7, 0.3),
    _line("belt y", _BELT, ("goal", "at", 1), -0.05, 0.15),
    _line("belt speed, wall", _BELT, ("goal", "belt", 2), -0.6, 0.3, **_CELL),
    _line("belt y, wall", _BELT, ("goal", "at", 1), 0.02, 0.15, **_CELL),
    _line("belt wall height", _BELT, ("keep_out", 0, "box", "from", 0), 0.84, 0.79, **_CELL),
    _line("from belt speed, wall", _STATE, ("start", "velocity", 2), -0.7, 0.7, **_FROM_BELT),
    _line("from belt y, wall", _STATE, ("start", "at", 1), -0.16, -0.02, **_FROM_BELT),
    _line("from belt wall height", _STATE, ("keep_out", 0, "box", "from", 0), 0.84, 0.79,
          **_FROM_BELT),
    _line("state speed", _STATE, ("goal", "velocity", 1), -0.5, 2.0),
    _line("stop speed", "moving/stop", ("start", "velocity", 1), 0.5, 4.0),
    _line("via x", _VIA, ("via", 0, "at", 0), 0.78, 0.86),
    _line("via y, wall", _VIA, ("via", 0, "at", 1), -0.12, -0.02, keep_out=[_WALL]),
    _line("belt, via", "via/onto_a_belt", ("goal", "belt", 2), -0.7, 0.2),
    _line("approach height", "approach/25_305_25", ("approach", "goal", "height"), 0.01, 0.06),
    _line("approach wall", "approach/25_305_25", ("keep_out", 0, "box", "from", 0), 0.84, 0.80,
          keep_out=[_WALL]),
    _line("tube", "paths/tube", ("tube",), 1e-3, 0.02),
    _line("path blend", "paths/industrial_25_305_25", ("path", "pick_and_place", "blend"), 2e-3,
          0.024),
    _line("torque rate", _CROSS, ("limits", "torque_rate"), 1e4, 4e4, limits={"torque_rate": 1e4}),
    _line("effort", "objectives/pick_and_place_gently", ("duration",), 0.16, 0.4),
    _line("friction", "industrial_drive", ("goal", 1), 0.02, 0.16),
    _line("range", "payload/range", ("goal", 1), 0.02, 0.16),
    *_among_bodies(),
)  # fmt: skip


@dataclass(frozen=True)
class Row:
    """A problem: its ``line`` and the number there, the cost (s; of effort, N²m²s) and the gap of
    its plan, NaN where there is none, seconds of the processor, and why there is none."""

    line: str
    place: float
    cost: float
    gap: float
    seconds: float
    failure: str


def flips(cost: Array) -> list[int]:
    """After which problems of a line the cost jumps: it changes by more than ``FLIP`` beyond what
    it changes that way in the steps beside, or there is a plan for one of two alone. One problem
    whose plan is longer than those beside it makes two."""
    with np.errstate(invalid="ignore"):
        steps = np.diff(np.log(cost))
    usual = np.full(len(steps), np.inf)
    for k in range(len(steps)):
        beside = [np.sign(steps[k]) * steps[i] for i in (k - 1, k + 1) if 0 <= i < len(steps)]
        usual[k] = _BESIDE * np.nanmax([0.0, *beside])
    ends = np.isfinite(cost[1:]) != np.isfinite(cost[:-1])
    return np.flatnonzero(ends | (np.abs(steps) > usual + FLIP)).tolist()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--problems", type=one_or_more, default=200, help="of a line (200)")
    parser.add_argument("--lines", nargs="+", metavar="NAME", help="these alone")
    parser.add_argument("--tolerance", type=float, default=1e-3, help="of plans (1e-3)")
    add_directory(parser, "continuity", "rows")


def run(arguments: argparse.Namespace) -> int:
    """Print, for each line with flips, where they are and how large, and how many there are."""
    lines = [each for each in LINES if not arguments.lines or each.name in arguments.lines]
    shares = np.linspace(0.0, 1.0, arguments.problems).tolist()
    keys = [
        (line.name, line.first + share * (line.last - line.first))
        for line in lines
        for share in shares
    ]
    named = {line.name: line for line in lines}

    def made(key: tuple[str, float]) -> Row:
        scene = named[key[0]].scene(key[1])
        found, failure, seconds = attempted(
            lambda: deltaopt.plan(scene, tolerance=arguments.tolerance)
        )
        cost, gap = (found.cost, found.gap) if found else (np.nan, np.nan)
        return Row(*key, cost, gap, seconds, failure)

    file, bar = arguments.directory / "continuity.csv", ProgressBar()
    rows = kept_rows(
        file, Row, keys, lambda row: (row.line, row.place), made, bar.counting(len(keys), "plans")
    )
    print(_told(lines, rows))
    return 0


def _told(lines: Sequence[Line], rows: Sequence[Row]) -> str:
    lines_told, number = [("line", "flips", "largest", "where", "no plan", "gap, most")], 0
    for line in lines:
        own = [row for row in rows if row.line == line.name]
        cost = np.array([row.cost for row in own])
        found = flips(cost)
        number += len(found)
        sizes = np.abs(np.diff(np.log(cost)))[found]
        largest = f"{np.nanmax(sizes):.2%}" if np.isfinite(sizes).any() else ""
        where = " ".join(f"{own[k].place:.4g}" for k in found[:4])
        none, gap = str(int(np.isnan(cost).sum())), f"{np.nanmax([row.gap for row in own]):.0e}"
        lines_told.append((line.name, str(len(found)), largest, where, none, gap))
    total = f"{number} flips in {len(rows)} problems on {len(lines)} lines"
    return f"{table(lines_told)}\n{total}"
