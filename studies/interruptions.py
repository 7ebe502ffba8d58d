"""Motions that are interrupted at random instants: by a new goal, and by the fastest stop.

The old motion to its end and then one from rest to rest is always possible. So every interruption
must lead to a plan, which verification accepts and which takes no longer than that.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from time import thread_time

import numpy as np
from numpy.typing import NDArray

import deltaopt
from deltaopt.bench.random_scenes import random_scenes
from deltaopt.cli.arguments import one_or_more, seed
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.scene.task import given_points
from studies.problems import PROBLEMS

HELP = "interrupt verified motions at random instants: a new goal, a stop"
ROBOTS = tuple(
    PROBLEMS / "robots" / f"{name}.yaml" for name in ("orsino", "industrial", "industrial_drive")
)
SMALL = {"robots": ROBOTS[:1], "number": 3}
_SAME = 1e-9
"""Share of a duration by which one may be longer than another that it equals: rounding."""


@dataclass(frozen=True)
class Interruption:
    """A motion that is interrupted at random: a plan to a new goal, and a stop.

    ``seconds``: processor time of the plan to the new goal and of one from rest to rest, s.
    ``ratio``: duration of the first over that of finishing the old motion and then the second.
    ``stop``: duration of the fastest stop over what is left of the old motion. ``gap``: told by the
    first. ``failures``: what is wrong, sentences.
    """

    seconds: tuple[float, float]
    ratio: float
    stop: float
    gap: float
    failures: tuple[str, ...]


def interruptions(robot: deltaopt.Robot, number: int, first: int) -> Iterator[Interruption]:
    """So many of one robot, seeded: a random move, a random instant, another random goal."""
    planner, rng = deltaopt.Planner(robot), np.random.default_rng(first)
    scenes = random_scenes(robot, None, 2 * number, first)
    for scene, other in zip(scenes, scenes, strict=True):
        old = planner.plan(scene.start, scene.goal)
        now = old.trajectory(float(rng.uniform(0, old.duration)))
        begin = thread_time()
        rest = planner.plan(given_points(scene.task)[1], other.goal)
        plain = thread_time() - begin
        left = old.duration - float(now.t[0])
        try:
            begin = thread_time()
            new = planner.plan(now, other.goal)
            seconds = thread_time() - begin
            stop = planner.stop(now)
        except deltaopt.DeltaOptError as error:
            yield Interruption((np.nan, plain), np.nan, np.nan, np.nan, (str(error),))
            continue
        failures = []
        for plan, most in ((new, left + rest.duration), (stop, left)):
            failures += deltaopt.verify(plan.scene, plan.trajectory).failures()
            if plan.duration > most * (1 + _SAME):
                failures.append(f"it takes {plan.duration:.6g} s, where {most:.6g} s are possible")
        ratio = new.duration / (left + rest.duration)
        yield Interruption((seconds, plain), ratio, stop.duration / left, new.gap, tuple(failures))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--number", type=one_or_more, default=334, help="of each robot")
    parser.add_argument("--seed", type=seed, default=1, help="of the random moves (default: 1)")
    parser.set_defaults(robots=ROBOTS)


def run(arguments: argparse.Namespace) -> int:
    failed = 0
    for robot in map(deltaopt.load_robot, arguments.robots):
        progress, found = ProgressBar().counting(arguments.number, robot.name), []
        for each in interruptions(robot, arguments.number, arguments.seed):
            found.append(each)
            progress(len(found))
        wrong = [sentence for each in found for sentence in each.failures]
        failed += sum(bool(each.failures) for each in found)
        print(f"{robot.name}: {len(found) - len(wrong)} of {len(found)} planned and verified")
        for sentence in wrong:
            print(f"  {sentence}")
        print(_table(found))
    return 1 if failed else 0


def _table(found: list[Interruption]) -> str:
    """Medians and extremes, one line each."""
    ratio, stop = (_column(found, name) for name in ("ratio", "stop"))
    gaps, seconds = _column(found, "gap"), np.array([each.seconds for each in found])
    known = gaps[np.isfinite(gaps)]
    slower = np.nanmedian(seconds[:, 0]) / np.nanmedian(seconds[:, 1])
    return "\n".join(
        [
            f"  duration over that of the old motion and then from rest: median "
            f"{np.nanmedian(ratio):.3f}, largest {np.nanmax(ratio):.6f}",
            f"  stop over the rest of the old motion: median {np.nanmedian(stop):.3f}, largest "
            f"{np.nanmax(stop):.6f}",
            f"  gaps: median {np.nanmedian(known):.1e}, largest {np.nanmax(known):.1e}; "
            f"{len(found) - len(known)} finished the old motion first",
            f"  processor time: median {1e3 * np.nanmedian(seconds[:, 0]):.1f} ms, {slower:.2f} "
            "times a plan from rest to rest",
        ]
    )


def _column(found: list[Interruption], name: str) -> NDArray[np.float64]:
    return np.array([getattr(each, name) for each in found])
