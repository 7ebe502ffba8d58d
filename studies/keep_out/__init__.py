"""Keep-out bodies: clearances, refusals and planted passages, by means of their own.

scenes    random scenes with one to five bodies: clearances measured, refusals held against a grid
walls     a wall or a thin plate across the way, with points between, ends that move, a belt
passages  walls that leave 1, 3 and 20 mm beside the tool, or nothing
ways      whether the best of many first motions is faster than the plan, past walls, in bins, ...
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from math import inf
from pathlib import Path

import numpy as np

import deltaopt
from deltaopt.cli.arguments import WrongUsage, one_or_more, positive, seed
from deltaopt.files.progress_bar import ProgressBar
from studies.keep_out.other_ways import OtherWays, other_ways
from studies.keep_out.passages import CLOSED, KINDS, WIDTHS, Planted, planted
from studies.keep_out.planned import FAILED, PLANNED, REFUSED, Planned, planned
from studies.keep_out.random_bodies import scene_of
from studies.keep_out.walls import WALLS, beside_wall
from studies.kept_rows import kept_rows
from studies.problems import INDUSTRIAL, add_directory

SMALL = {
    "number": 1,
    "each": 1,
    "walls": 1,
    "obstacles": 1,
    "starts": 3,
    "kinds": KINDS[:1],
    "widths": (0.001,),
    "scenes_of_walls": ("wall",),
    "spacing": 0.05,
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "parts",
        nargs="*",
        default=tuple(PARTS),
        metavar="PART",
        help="of scenes, walls, passages, ways",
    )
    parser.add_argument("--number", type=one_or_more, default=500, help="random scenes (500)")
    parser.add_argument("--each", type=one_or_more, default=10, help="walls of a kind (10)")
    parser.add_argument("--walls", type=one_or_more, default=24, help="scenes of a kind (24)")
    parser.add_argument("--obstacles", type=one_or_more, default=60, help="scenes of ways (60)")
    parser.add_argument("--starts", type=one_or_more, default=30, help="first motions each (30)")
    parser.add_argument("--spacing", type=positive, default=0.03, help="of the grid, m (0.03)")
    parser.add_argument("--seed", type=seed, default=1, help="of the random numbers (1)")
    parser.add_argument("--robot", type=Path, default=INDUSTRIAL, metavar="ROBOT")
    parser.set_defaults(kinds=KINDS, widths=(*WIDTHS, CLOSED), scenes_of_walls=WALLS)
    add_directory(parser, "keep_out", "CSV files, and scenes that are refused or fail")


def run(arguments: argparse.Namespace) -> int:
    """Print what each part found; 1 if something failed."""
    unknown = [name for name in arguments.parts if name not in PARTS]
    if unknown:
        raise WrongUsage(f"{unknown[0]} is no part; {', '.join(PARTS)} are")
    failed = [PARTS[name](arguments) for name in arguments.parts]
    return int(any(failed))


def _scenes(arguments: argparse.Namespace) -> bool:
    """Print one line for each number of bodies and for each kind of body; whether one failed."""
    robot = deltaopt.load_robot(arguments.robot)
    drawn = partial(scene_of, robot, arguments.seed)
    rows = _planned(arguments, f"scenes_{arguments.seed}", arguments.number, drawn)
    for row in rows:
        if row.reason:
            print(f"{row.outcome}, scene {row.number}, {row.kinds}: {row.reason}")
    for number in sorted({len(row.kinds.split()) for row in rows}):
        own = [row for row in rows if len(row.kinds.split()) == number]
        print(f"{number} bodies: {_summary(own)}")
    for kind in sorted({kind for row in rows for kind in row.kinds.split()}):
        own = [row for row in rows if kind in row.kinds.split()]
        print(f"with a {kind}: {_summary(own)}")
    print(f"all: {_summary(rows)}", flush=True)
    return any(row.outcome == FAILED for row in rows)


def _planned(
    arguments: argparse.Namespace,
    name: str,
    number: int,
    drawn: Callable[[int], deltaopt.Scene | Planted],
) -> list[Planned]:
    """What came of so many scenes, by their numbers: from the file of this name, or planned now."""
    folder: Path = arguments.directory / name

    def made(i: int) -> Planned:
        each = drawn(i)
        if isinstance(each, Planted):
            return planned(each.scene, i, arguments.spacing, folder, each.on_the_way)
        return planned(each, i, arguments.spacing, folder)

    progress = ProgressBar().counting(number, name)
    file = arguments.directory / f"{name}.csv"
    return kept_rows(file, Planned, range(number), lambda row: row.number, made, progress)


def _summary(rows: list[Planned]) -> str:
    counts = {name: sum(row.outcome == name for row in rows) for name in (PLANNED, REFUSED, FAILED)}
    done = [row for row in rows if row.outcome == PLANNED]
    clearance = min((row.clearance for row in done), default=inf)
    least = f", least clearance beyond what is asked for {clearance:.1e} m"
    missed = sum(row.gap > _GAP for row in done)
    return (
        f"{len(rows)} scenes, {counts[PLANNED]} planned and verified, {counts[REFUSED]} refused as "
        f"a grid does, {counts[FAILED]} failed{least if done else ''}; {missed} miss a gap of "
        f"{_GAP:g}; median {1e3 * np.median([row.seconds for row in rows]):.0f} ms"
    )


_GAP = 1e-3
"""The tolerance of plans."""


def _passages(arguments: argparse.Namespace) -> bool:
    """Print a line for each kind of wall and each width; whether a passage was not found."""
    robot, failed = deltaopt.load_robot(arguments.robot), False
    for kind in arguments.kinds:
        for width in arguments.widths:
            name = f"{kind.replace(' ', '_')}_{1e3 * width:g}mm_{arguments.seed}"
            drawn = partial(planted, robot, kind, width, arguments.seed)
            rows = _planned(arguments, name, arguments.each, drawn)
            right = PLANNED if width > 0 else REFUSED
            good = sum(row.outcome == right for row in rows)
            failed |= good < len(rows)
            print(f"{kind}, {1e3 * width:g} mm beside the tool: {good} of {len(rows)} {right}")
            for row in rows:
                if row.outcome != right:
                    print(f"  {row.number}: {row.outcome} {row.reason}")
    return failed


def _walls(arguments: argparse.Namespace) -> bool:
    """Print a line for each kind of scene; whether one was refused or is wrong."""
    robot, failed = deltaopt.load_robot(arguments.robot), False
    for kind in arguments.scenes_of_walls:
        name = f"walls_{kind.replace(' ', '_')}_{robot.name.replace(' ', '_')}_{arguments.seed}"
        drawn = partial(beside_wall, robot, kind, arguments.seed)
        rows = _planned(arguments, name, arguments.walls, drawn)
        resting = sum(row.gap == inf for row in rows)
        print(f"{kind}: {_summary(rows)}; {resting} rest between legs", flush=True)
        for row in rows:
            if row.outcome == FAILED:
                print(f"  {row.number}: {row.reason}")
                failed = True
    return failed


def _ways(arguments: argparse.Namespace) -> bool:
    """Print for each kind of obstacle how often another motion is faster, by how much; whether the
    fastest of a scene is not verified."""
    robot = deltaopt.load_robot(arguments.robot)
    rows = kept_rows(
        arguments.directory / f"ways_{arguments.seed}_{arguments.starts}.csv",
        OtherWays,
        range(arguments.obstacles),
        lambda row: row.number,
        lambda i: other_ways(robot, arguments.seed, i, arguments.starts),
        ProgressBar().counting(arguments.obstacles, "ways"),
    )
    for kind in sorted({row.obstacle for row in rows}):
        print(f"{kind}: {_gains([row for row in rows if row.obstacle == kind])}")
    print(f"all: {_gains(rows)}", flush=True)
    for row in rows:
        if row.reason and not np.isnan(row.fastest):
            print(f"  {row.number}, {row.obstacle}: refused as usual alone: {row.reason}")
    return any(not row.verified for row in rows if not np.isnan(row.fastest))


def _gains(rows: list[OtherWays]) -> str:
    known = [row.gain for row in rows if not np.isnan(row.gain)]
    counts = (f"{sum(gain > least for gain in known)} by {least:.1%}" for least in _GAINS)
    return (
        f"{len(rows)} scenes, {len(known)} planned; longer than the best: {', '.join(counts)}; "
        f"at most {max(known, default=0.0):.1%}"
    )


_GAINS = (0.002, 0.01, 0.03)
"""Twice the tolerance of plans is the least difference that means another motion."""


PARTS: dict[str, Callable[[argparse.Namespace], bool]] = {
    "scenes": _scenes,
    "walls": _walls,
    "passages": _passages,
    "ways": _ways,
}
