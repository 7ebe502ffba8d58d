"""What Coulomb friction costs: plans of random moves beside those of the same moves without it.

Each move is planned by a robot with friction and by the same robot without Coulomb friction. Told
are processor time and work (iterations times intervals) with friction as multiples of those
without, and how many plans miss their tolerance, are not verified, or are longer than the best that
is known, from other first meshes and to a tighter tolerance, by more than their own gap. Every move
is kept in a file as soon as it is measured; a run that is begun again goes on where that ends.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest
from math import inf

import numpy as np

from deltaopt import Plan, Scene, load_robot, plan, verify
from deltaopt.cli.arguments import positive
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.robot.drive import Friction
from deltaopt.robot.robot import Robot
from studies.bench.random_scenes import random_scenes
from studies.kept_rows import kept_rows
from studies.problems import PROBLEMS, add_directory
from studies.smooth import limited
from studies.timed import attempted

SMALL = {"moves": 1}
CASES = (
    ("industrial_drive", 0.5, 2.0, 0.05),
    ("industrial_drive", 0.5, 2.0, 0.01),
    ("packer", 0.5, 0.5, 0.1),
    ("industrial", 1.0, 3.0, 0.03),
    ("orsino", 0.1, 0.4, 0.05),
    ("rl5", 0.5, 15.0, 0.02),
    ("hornet_565", 0.5, 1.5, 0.1),
)
"""Robots, payloads in kg, their Coulomb friction in N·m, and the speed in which it changes its
sign, rad/s."""
_OTHERS: tuple[dict[str, float], ...] = (
    {"intervals": 20},
    {"intervals": 24},
    {"intervals": 32},
    {"tolerance": 1e-4},
)
"""Settings of the plans that the usual one is held against."""


@dataclass(frozen=True)
class Measured:
    """What is known of a move: processor seconds without and with friction, work as a multiple of
    that without, and of the plan with friction how long it takes (s), its gap, whether it is within
    its tolerance, whether it is verified, and the least duration that is known (s)."""

    case: int
    move: int
    plain: float
    spent: float
    work: float
    duration: float
    gap: float
    within: bool
    verified: bool
    best: float
    meshes: int


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--moves", type=positive, default=50, metavar="N", help="of each robot")
    parser.add_argument("--seed", type=int, default=11, metavar="N", help="of the random moves")
    parser.add_argument(
        "--best", action="store_true", help="look for shorter plans of each move, in ten times"
    )
    parser.add_argument(
        "--ramp",
        type=positive,
        metavar="MS",
        help="least time from no torque to the peak, of both robots (default: not limited)",
    )
    add_directory(parser, "friction", "moves")


def run(arguments: argparse.Namespace) -> int:
    number, seed, ramp = arguments.moves, arguments.seed, arguments.ramp
    drawn = zip_longest(*(_moves(k, number, seed, ramp) for k in range(len(CASES))))
    moves = {
        (case, index): move for together in drawn for case, index, move in filter(None, together)
    }
    kind = ("best" if arguments.best else "moves") + (f"_{ramp:g}ms" if ramp else "")
    told = kept_rows(
        arguments.directory / f"{kind}_{seed}.csv",
        Measured,
        moves,
        lambda row: (row.case, row.move),
        lambda key: _measured(*key, moves[key], arguments.best),
        ProgressBar().counting(len(moves), "moves"),
    )
    print("times of a plan without Coulomb friction at 50, 90, 99 % and most: time; work; plans")
    for k, (name, _, coulomb, speed) in enumerate(CASES):
        of_case = [each for each in told if each.case == k]
        print(f"{name}, {coulomb:g} N·m, {speed:g} rad/s: {_in_words(of_case, arguments)}")
    print(f"all: {_in_words(told, arguments)}")
    return 0


def _in_words(told: list[Measured], asked: argparse.Namespace) -> str:
    ratios = [[each.spent / each.plain for each in told], [each.work for each in told]]
    shares = ["  ".join(f"{v:.1f}" for v in np.percentile(x, [50, 90, 99, 100])) for x in ratios]
    missed = sum(not each.within for each in told)
    wrong = sum(not each.verified for each in told)
    longer = sum(each.duration > (1 + each.gap) * each.best for each in told)
    known = f", {longer} longer than known" if asked.best else ""
    gaps = f", gaps up to {max(each.gap for each in told):.1g}" if asked.ramp else ""
    outcomes = f"{len(told)}, {missed} missed{gaps}, {wrong} not verified{known}"
    return f"{shares[0]};  {shares[1]};  {outcomes}"


def _moves(
    case: int, number: int, seed: int, ramp: float | None
) -> Iterator[tuple[int, int, Scene]]:
    name, payload, coulomb, speed = CASES[case]
    robot = _with(load_robot(PROBLEMS / "robots" / f"{name}.yaml"), coulomb, speed)
    for index, free in enumerate(random_scenes(robot, payload, number, seed)):
        move = free if ramp is None else limited(free, ramp)
        if index == 0:  # what is compiled once is compiled now
            plan(move)
            plan(_without(move))
        yield case, index, move


def _measured(case: int, index: int, move: Scene, best: bool) -> Measured:
    """A move with friction beside that without; a refusal is an infinite duration and gap."""
    times = [attempted(partial(plan, _without(move))) for _ in range(3)]
    plain = times[0][0]
    assert plain is not None
    found, _, spent = attempted(partial(plan, move))
    if spent < 1:
        spent = min(spent, *(attempted(partial(plan, move))[2] for _ in range(2)))
    others = [attempted(partial(plan, move, **other))[0] for other in _OTHERS * best]  # type: ignore[arg-type]
    known = [other.duration for other in (found, *others) if other]
    return Measured(
        case,
        index,
        min(each[2] for each in times),
        spent,
        _work(found) / _work(plain) if found else inf,
        found.duration if found else inf,
        found.gap if found else inf,
        found is not None and found.within_tolerance,
        found is not None and verify(move, found.trajectory).ok,
        min(known, default=inf),
        len(found.meshes) if found else 0,
    )


def _work(found: Plan) -> int:
    return sum(mesh.iterations * mesh.intervals for mesh in found.meshes)


def _without(move: Scene) -> Scene:
    assert isinstance(move.robot, Robot)
    return move.model_copy(update={"robot": _with(move.robot, None, None)})


def _with(robot: Robot, coulomb: float | None, speed: float | None) -> Robot:
    known = robot.drive.friction
    friction = (known or Friction(viscous=None, coulomb=1.0, speed=1.0)).model_copy(
        update={"coulomb": coulomb, "speed": speed}
    )
    none = friction.viscous is None and coulomb is None
    drive = robot.drive.model_copy(update={"friction": None if none else friction})
    return robot.model_copy(update={"drive": drive})
