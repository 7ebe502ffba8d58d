"""How the time of one iteration grows with the number of intervals.

The default method on uniform meshes, from the plan of the same move; medians over moves and
repetitions.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import deltaopt
from deltaopt.planning.nlp.problem import Guess
from studies.bench.random_scenes import random_scenes
from studies.problems import ORSINO, add_robots
from studies.uniform_mesh import solved_on

HELP = "how the time of an iteration grows with the number of intervals"
MESHES = tuple(10 * 2**k for k in range(7))
SMALL = {"robots": (ORSINO,), "number": 1, "meshes": MESHES[:3]}
_PAYLOAD, _SEED = 1.0, 1
_REPETITIONS = 5


@dataclass(frozen=True)
class Scaling:
    """Milliseconds of an iteration on meshes of so many intervals, (number of meshes,)."""

    intervals: tuple[int, ...]
    milliseconds: NDArray[np.float64]

    @property
    def exponent(self) -> float:
        """The n of time ~ intervals^n, by least squares."""
        return float(np.polyfit(np.log(self.intervals), np.log(self.milliseconds), 1)[0])


def scaling(robot: deltaopt.Robot, moves: int, meshes: Sequence[int]) -> Scaling:
    """Time an iteration on each mesh."""
    times: list[list[float]] = [[] for _ in meshes]
    planner = deltaopt.Planner(robot, _PAYLOAD)
    for scene in random_scenes(robot, _PAYLOAD, moves, _SEED):
        plan = planner.plan(scene.start, scene.goal)
        for own, intervals in zip(times, meshes, strict=True):
            own += [_iteration(plan, intervals) for _ in range(_REPETITIONS)]
    return Scaling(tuple(meshes), np.array([1e3 * np.median(t) for t in times]))


def _iteration(plan: deltaopt.Plan, intervals: int) -> float:
    """Return the seconds of one iteration on a uniform mesh."""
    start = Guess(plan.trajectory, near=True, tolerance=1e-3)
    solved = solved_on(plan.scene, intervals, start)
    return (solved.spent.evaluation + solved.spent.algebra) / (solved.iterations + 1)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robots(parser)
    parser.add_argument("--number", type=int, default=5, metavar="N", help="moves (default: 5)")
    parser.add_argument(
        "--meshes",
        nargs="+",
        type=int,
        default=MESHES,
        metavar="N",
        help="numbers of intervals (default: 10 to 640)",
    )


def run(arguments: argparse.Namespace) -> int:
    for robot in map(deltaopt.load_robot, arguments.robots):
        found = scaling(robot, arguments.number, arguments.meshes)
        print(f"{robot.name}: time of an iteration grows as N^{found.exponent:.2f}")
        for intervals, milliseconds in zip(found.intervals, found.milliseconds, strict=True):
            print(f"  {intervals:4d} intervals {milliseconds:8.3f} ms")
    return 0
