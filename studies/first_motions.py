"""How often the first of the first motions leads to a plan, and how good a straight line is.

Moves of some strata of the campaign (`python -m studies bench any`), each planned: at how many
attempts, in how many iterations; and by what factor the straight line, driven as fast as its limits
roughly allow, takes longer than the lower bound for every path.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from math import inf
from time import process_time

import numpy as np

from deltaopt.cli.arguments import one_or_more, seed
from deltaopt.errors import DeltaOptError
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.motion.lower_bound import lower_bound
from deltaopt.planning.first_motions.initial_motion import detour, line, roughly_fastest
from deltaopt.planning.first_motions.order_of_merit import SLOW
from deltaopt.planning.journal import Entry
from deltaopt.planning.planner import plan
from deltaopt.scene.scene import Scene
from studies.bench.hard_moves import ROBOTS, move
from studies.bench.strata import STRATA

OF = ("inside", "edge", "border", "longest inside", "longest edge", "longest border", "weak edge")
SMALL = {"number": 1, "strata": OF[:1]}


@dataclass(frozen=True)
class Searched:
    """A planned move: how many ``attempts`` were made and ``iterations`` the one took that the
    plan is of; how many times the lower bound the straight ``line`` takes, infinite where it cannot
    be driven; how long planning took, and comparing the ``curves``, s."""

    attempts: int
    iterations: int
    line: float
    seconds: float
    curves: float


def searched(scene: Scene) -> Searched | None:
    """Plan a scene; None if it is refused."""
    begin = process_time()
    try:
        found = plan(scene)
    except DeltaOptError:
        return None
    planned = process_time()
    with suppress(DeltaOptError):
        detour(scene)
    return Searched(
        sum(isinstance(each, Entry) for each in found.journal),
        found.iterations,
        _times_the_bound(scene),
        planned - begin,
        process_time() - planned,
    )


def _times_the_bound(scene: Scene) -> float:
    try:
        return roughly_fastest(scene, line(scene)).duration / lower_bound(scene)
    except DeltaOptError:
        return inf


def moves_of(stratum: str, number: int, first: int) -> Iterator[Scene]:
    """So many moves of a stratum for each robot; ``first``: the seed."""
    cycle, begin = len(ROBOTS) * len(STRATA), len(ROBOTS) * list(STRATA).index(stratum)
    for i in range(number):
        for robot in range(len(ROBOTS)):
            yield move(first, i * cycle + begin + robot).scene


def row(stratum: str, moves: int, found: list[Searched]) -> str:
    """The line of a table for the moves of a stratum that were planned."""
    attempts = np.array([each.attempts for each in found])
    iterations = [each.iterations for each in found]
    lines = np.array([each.line for each in found])
    driven = lines[np.isfinite(lines)]
    return (
        f"{stratum:<16}{moves:>6}{moves - len(found):>8}{np.mean(attempts == 1):>9.1%}"
        f"{attempts.max():>7}{np.median(iterations):>11.0f}{np.percentile(iterations, 99):>7.0f}"
        f"{1 - len(driven) / len(lines):>9.1%}{np.median(driven):>8.2f}"
        f"{np.percentile(driven, 99):>8.2f}{np.mean(driven > SLOW):>8.1%}"
    )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--number", type=one_or_more, default=12, help="moves of each robot in each stratum"
    )
    parser.add_argument("--seed", type=seed, default=1, help="of the moves (default: 1)")
    parser.set_defaults(strata=OF)


def run(arguments: argparse.Namespace) -> int:
    print(
        f"{'':<30}{'attempts':>16}{'iterations':>18}{'straight line / lower bound':>33}\n"
        f"{'stratum':<16}{'moves':>6}{'refused':>8}{'one':>9}{'most':>7}{'median':>11}{'99 %':>7}"
        f"{'blocked':>9}{'median':>8}{'99 %':>8}{f'> {SLOW:g}':>8}"
    )
    everything = list[Searched]()
    for stratum in arguments.strata:
        number, found = arguments.number * len(ROBOTS), list[Searched]()
        progress = ProgressBar().counting(number, stratum)
        for i, scene in enumerate(moves_of(stratum, arguments.number, arguments.seed), 1):
            outcome = searched(scene)
            found += [] if outcome is None else [outcome]
            progress(i)
        print(row(stratum, number, found), flush=True)
        everything += found
    ratio = np.median([each.curves / each.seconds for each in everything])
    print(f"comparing curves takes {ratio:.1f} times as long as a plan, median")
    return 0
