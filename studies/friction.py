"""What Coulomb friction costs: plans of random moves beside those of the same moves without it.

Each move is planned by a robot with friction and by the same robot without Coulomb friction. Told
are processor time and work (iterations times intervals) with friction as multiples of those
without, and how many plans miss their tolerance or are longer than the best that is known, from
other first meshes, by more than their own gap.
"""

from __future__ import annotations

import argparse
from functools import partial

import numpy as np

from deltaopt import Plan, Scene, load_robot, plan
from deltaopt.cli.arguments import positive
from deltaopt.planning.plan import Iteration
from deltaopt.robot.robot import Robot
from studies.bench.random_scenes import random_scenes
from studies.problems import PROBLEMS
from studies.timed import attempted

HELP = "what Coulomb friction costs in time"
SMALL = {"moves": 3}
CASES = (("industrial_drive", 2.0, 0.05), ("industrial_drive", 2.0, 0.01), ("packer", 0.5, 0.1))
"""Robots, their Coulomb friction in N·m, and the speed in which it changes its sign, rad/s."""
_MESHES = (20, 24, 32)
"""Intervals of the other first meshes."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--moves", type=positive, default=50, metavar="N", help="of each robot")
    parser.add_argument("--seed", type=int, default=11, metavar="N", help="of the random moves")


def run(arguments: argparse.Namespace) -> int:
    print("times of a plan without Coulomb friction at 50, 90, 99 % and most: time; work; plans")
    for name, coulomb, speed in CASES:
        robot = load_robot(PROBLEMS / "robots" / f"{name}.yaml")
        moves = list(
            random_scenes(_with(robot, coulomb, speed), 0.5, arguments.moves, arguments.seed)
        )
        plan(moves[0])  # what is compiled once is compiled now
        plan(_of(moves[0], _with(robot, None, None)))
        told = [_measured(move, _of(move, _with(robot, None, None))) for move in moves]
        time, work, missed, longer = np.array([each for each in told if each]).T
        shares = [
            "  ".join(f"{v:.1f}" for v in np.percentile(x, [50, 90, 99, 100])) for x in (time, work)
        ]
        print(
            f"{name}, {speed:g} rad/s: {shares[0]};  {shares[1]};  {len(time)} of {len(moves)}, "
            f"{missed.sum():.0f} missed, {longer.sum():.0f} longer than known"
        )
    return 0


def _measured(move: Scene, without: Scene) -> tuple[float, float, bool, bool] | None:
    plain, _, usual = attempted(lambda: plan(without))
    found, _, spent = attempted(lambda: plan(move))
    if plain is None or found is None:
        return None
    others = (attempted(partial(plan, move, intervals=n))[0] for n in _MESHES)
    best = min([found.duration, *(other.duration for other in others if other)])
    longer = found.duration > (1 + found.gap) * best
    return spent / usual, _work(found) / _work(plain), not found.within_tolerance, longer


def _work(found: Plan) -> int:
    meshes = (mesh for mesh in found.meshes if isinstance(mesh, Iteration))
    return sum(mesh.iterations * mesh.intervals for mesh in meshes)


def _of(move: Scene, robot: Robot) -> Scene:
    return move.model_copy(update={"robot": robot})


def _with(robot: Robot, coulomb: float | None, speed: float | None) -> Robot:
    assert robot.drive.friction is not None
    friction = robot.drive.friction.model_copy(update={"coulomb": coulomb, "speed": speed})
    drive = robot.drive.model_copy(update={"friction": friction})
    return robot.model_copy(update={"drive": drive})
