"""How near the proven lower bound on every path comes to the durations of plans.

Scenes, then random moves of each robot without payload: the ratio of bound to duration, which no
method could bring above 1. What a ratio lacks to 1 is unknown: the bound may be low, or a shorter
motion may exist. Draws lower_bound.png.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

import deltaopt
from deltaopt.cli.arguments import load_fastest, one_or_more, seed
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.planning.planner import Planner
from deltaopt.robot.robot import as_delta
from studies.bench.random_scenes import random_scenes
from studies.problems import PICK_AND_PLACE, PROBLEMS, add_directory

SCENES = tuple(sorted(PROBLEMS.glob("*.yaml")))
ROBOTS = tuple(
    PROBLEMS / "robots" / f"{name}.yaml" for name in ("orsino", "industrial", "hornet_565", "rl5")
)
SMALL = {"scenes": (PICK_AND_PLACE,), "robots": ROBOTS[:1], "number": 3}


def ratio(plan: deltaopt.Plan) -> float:
    """Lower bound divided by duration."""
    return plan.lower_bound / plan.duration


def random_ratios(planner: Planner, number: int, first: int) -> NDArray[np.float64]:
    """The ratios of so many random moves of a planner's robot; ``first``: the seed."""
    progress, found = ProgressBar().counting(number, planner.robot.name), []
    for scene in random_scenes(as_delta(planner.robot), planner.payload, number, first):
        found.append(ratio(planner.plan(scene.start, scene.goal)))
        progress(len(found))
    return np.array(found)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_directory(parser, "lower_bound", "lower_bound.png")
    parser.add_argument("--number", type=one_or_more, default=100, help="moves of each robot")
    parser.add_argument("--seed", type=seed, default=1, help="of the random moves (default: 1)")
    parser.set_defaults(scenes=SCENES, robots=ROBOTS)


def run(arguments: argparse.Namespace) -> int:
    from studies.plots.lower_bound import draw  # slow to import

    print("ratio of lower bound to duration")
    for file in arguments.scenes:
        plan = deltaopt.plan(load_fastest(file))
        print(
            f"  {file.stem:<20}{plan.lower_bound:>10.4f} s{plan.duration:>10.4f} s"
            f"{ratio(plan):>7.2f}"
        )
    robots = {}
    for robot in map(deltaopt.load_robot, arguments.robots):
        found = robots[robot.name] = random_ratios(Planner(robot), arguments.number, arguments.seed)
        print(
            f"  {len(found)} random moves: least {found.min():.2f}, median {np.median(found):.2f}, "
            f"largest {found.max():.2f}; {robot.name}"
        )
    file = arguments.directory / "lower_bound.png"
    draw(robots, file)
    print("written:", file)
    return 0
