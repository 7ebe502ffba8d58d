"""Random motions through a random via point: exactly, in a sphere, and from a random state.

Each is planned and verified. A sphere never takes longer than its centre, a via point never shorter
than none, beyond what the gaps told allow, unless one of the plans is another local optimum.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

import deltaopt
from deltaopt.cli.arguments import one_or_more, seed
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.scene.task import given_points
from studies.bench.random_scenes import random_scenes
from studies.problems import PROBLEMS
from studies.timed import attempted

HELP = "plan random motions through random via points, exactly and in spheres"
ROBOTS = tuple(
    PROBLEMS / "robots" / f"{name}.yaml" for name in ("orsino", "industrial", "industrial_drive")
)
SMALL = {"robots": ROBOTS[:1], "number": 1}
_RADII = (1e-3, 5e-2)
"""Of the spheres, m, drawn uniformly in their logarithm."""
KINDS = ("through a point", "through a sphere", "from a state through a point")


@dataclass(frozen=True)
class Move:
    """A move without a via point and the plans of ``KINDS``, or the errors that stood for them.

    ``seconds``: processor time of each, s, that without a via point first. ``failures``: what is
    wrong, sentences.
    """

    plans: tuple[deltaopt.Plan | None, ...]
    seconds: tuple[float, ...]
    failures: tuple[str, ...]


def moves(robot: deltaopt.Robot, number: int, first: int) -> Iterator[Move]:
    """So many of one robot, seeded: a random move through the start of another, and from a random
    instant of that other one."""
    planner, rng = deltaopt.Planner(robot), np.random.default_rng(first)
    scenes = random_scenes(robot, None, 2 * number, first)
    for scene, other in zip(scenes, scenes, strict=True):
        start, goal = given_points(scene.task)
        point, elsewhere = given_points(other.task)
        under_way = planner.plan(elsewhere, start).trajectory
        now = under_way(float(rng.uniform(0.1, 0.9)) * under_way.duration)
        state = deltaopt.State(at=tuple(now.x.tolist()), velocity=tuple(now.v.tolist()))
        apart = min(float(np.linalg.norm(np.subtract(point, end))) for end in (start, goal))
        radius = min(float(np.exp(rng.uniform(*np.log(_RADII)))), 0.9 * apart)
        given = (
            {"via": None},
            {"via": [point]},
            {"via": [{"at": point, "within": radius}]},
            {"via": [point], "start": state},
        )
        yield _planned(planner, [scene.model_copy(update=each) for each in given])


def _planned(planner: deltaopt.Planner, scenes: list[deltaopt.Scene]) -> Move:
    plans, seconds, failures = list[deltaopt.Plan | None](), list[float](), list[str]()
    for scene in scenes:
        found, failure, spent = attempted(partial(planner.plan_scene, scene))
        seconds.append(spent)
        plans.append(found)
        if found is None:
            failures.append(f"{scene.via} from {scene.start} to {scene.goal}: {failure}")
        else:
            failures += deltaopt.verify(scene, found.trajectory).failures()
    return Move(tuple(plans), tuple(seconds), tuple(failures))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--number", type=one_or_more, default=70, help="of each robot")
    parser.add_argument("--seed", type=seed, default=1, help="of the random moves (default: 1)")
    parser.set_defaults(robots=ROBOTS)


def run(arguments: argparse.Namespace) -> int:
    failed = 0
    for robot in map(deltaopt.load_robot, arguments.robots):
        progress, found = ProgressBar().counting(arguments.number, robot.name), []
        for each in moves(robot, arguments.number, arguments.seed):
            found.append(each)
            progress(len(found))
        wrong = [sentence for each in found for sentence in each.failures]
        failed += len(wrong)
        plans = len(found) * (1 + len(KINDS))
        print(f"{robot.name}: {plans - len(wrong)} of {plans} planned and verified")
        for sentence in wrong:
            print(f"  {sentence}")
        print(_table(found))
    return 1 if failed else 0


def _table(found: list[Move]) -> str:
    """For each kind how many miss their tolerance, and medians."""
    seconds = np.array([each.seconds for each in found])
    lines = [f"  without: median {1e3 * np.median(seconds[:, 0]):.1f} ms"]
    for k, kind in enumerate(KINDS, 1):
        own = [plan for each in found if (plan := each.plans[k]) is not None]
        missed = sum(not plan.within_tolerance for plan in own)
        ratio = np.median(seconds[:, k]) / np.median(seconds[:, 0])
        lines.append(
            f"  {kind}: median {1e3 * np.median(seconds[:, k]):.1f} ms, {ratio:.2f} times that "
            f"without; {missed} of {len(own)} miss the tolerance"
        )
    longer = sum(_is_longer(each.plans[2], each.plans[1]) for each in found)
    shorter = sum(_is_longer(each.plans[0], each.plans[1]) for each in found)
    lines.append(f"  spheres that take longer than their centres: {longer}")
    lines.append(f"  via points that take less time than none: {shorter}")
    return "\n".join(lines)


def _is_longer(one: deltaopt.Plan | None, other: deltaopt.Plan | None) -> bool:
    """Whether a plan takes longer than another beyond its gap, which is then of a local optimum."""
    if one is None or other is None:
        return False
    return one.duration > other.duration * (1 + one.gap)
