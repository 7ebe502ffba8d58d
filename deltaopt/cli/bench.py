"""Measure what is claimed, on seeded random moves.

deltaopt bench random    plan and verify random moves of both shipped robots' kind
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from deltaopt.cli.arguments import positive
from deltaopt.cli.progress import ProgressBar
from deltaopt.robot import Robot, load_robot
from deltaopt.studies.random_plans import Outcome, random_plans

HELP = "measure what is claimed, on seeded random moves"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    studies = parser.add_subparsers(title="studies", metavar="STUDY", required=True)
    random = studies.add_parser(
        "random", help="plan and verify random moves: how many succeed", description=__doc__
    )
    random.add_argument("robots", nargs="+", type=Path, metavar="ROBOT", help="robot files")
    random.add_argument("--number", type=int, default=200, metavar="N", help="moves per robot")
    random.add_argument("--payload", type=positive, default=1.0, metavar="KG", help="payload, kg")
    random.add_argument("--seed", type=int, default=1, help="of the random numbers")
    random.set_defaults(study=_random)


def run(arguments: argparse.Namespace) -> int:
    return int(arguments.study(arguments))


def _random(arguments: argparse.Namespace) -> int:
    robots = [load_robot(file) for file in arguments.robots]
    good = True
    for robot in robots:
        outcomes = _with_progress(robot, arguments)
        failed = [o for o in outcomes if o.failures]
        good = good and not failed
        print(_summary(robot, outcomes))
        for outcome in failed:
            print(f"  {outcome.scene.start} -> {outcome.scene.goal}: {outcome.failures[0]}")
    return 0 if good else 1


def _with_progress(robot: Robot, arguments: argparse.Namespace) -> list[Outcome]:
    bar, number = ProgressBar(), arguments.number
    return random_plans(
        robot,
        arguments.payload,
        number,
        arguments.seed,
        lambda done: bar(done / number, robot.name),
    )


def _summary(robot: Robot, outcomes: list[Outcome]) -> str:
    seconds = [o.seconds for o in outcomes]
    succeeded = sum(not o.failures for o in outcomes)
    return (
        f"{robot.name}: {succeeded} of {len(outcomes)} solved and verified; "
        f"planning median {np.median(seconds):.2f} s, 99 % {np.percentile(seconds, 99):.2f} s; "
        f"estimated gap median {np.nanmedian([o.gap for o in outcomes]):.1e}"
    )
