"""Motions that are interrupted at random instants: by a new goal, and by the fastest stop.

The old motion to its end and then one from rest to rest is always possible. So every interruption
must lead to a plan, which verification accepts and which takes no longer than that.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from math import nan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import deltaopt
from deltaopt.cli.arguments import one_or_more, seed
from deltaopt.files.progress_bar import ProgressBar
from studies.bench.random_scenes import random_scenes
from studies.keep_out.random_bodies import is_possible, scene_of
from studies.kept_rows import kept_rows
from studies.problems import PROBLEMS, add_directory
from studies.reproduced import write_scene
from studies.timed import attempted, timed

HELP = "interrupt verified motions at random instants: a new goal, a stop"
KINDS: dict[str, tuple[str, dict[str, float] | None]] = {
    "orsino": ("orsino", None),
    "industrial": ("industrial", None),
    "industrial_drive": ("industrial_drive", None),
    "industrial_limits": ("industrial", {"platform_speed": 3.0, "acceleration": 60.0, "speed": 6}),
    "hornet_565": ("hornet_565", None),
    "rl5": ("rl5", None),
    "industrial_bodies": ("industrial", None),
}
"""Robots by their files, and limits beside those of their drives: with friction and a gripper, of
speeds and accelerations, with torques that fall with speed, with pins and heavy arms."""
_BODIES = "industrial_bodies"
"""The kind with one to four keep-out bodies, which stay where they are for both goals."""
SMALL = {"kinds": ("orsino",), "number": 3}
_SAME = 1e-9
"""Share of a duration by which one may be longer than another that it equals: rounding."""
_GOALS = 100
"""Of how many random goals one is clear of the bodies."""
_MOST = 1_000_000
"""Interruptions of one seed that are different from those of the next."""


@dataclass(frozen=True)
class Interruption:
    """A motion that is interrupted at random: a plan to a new goal, and a stop.

    ``number``: of the interruption. ``seconds``, ``seconds_at_rest``: processor time of the plan
    to the new goal and of one from rest to rest, s. ``ratio``: duration of the first over that of
    finishing the old motion and then the second. ``stop``: duration of the fastest stop over what
    is left of the old motion. ``gap``: told by the first. ``failure``: what is wrong, in words.
    """

    number: int
    seconds: float
    seconds_at_rest: float
    ratio: float
    stop: float
    gap: float
    failure: str


@dataclass(frozen=True)
class Case:
    """An interruption by itself: the scene of the old motion, how far through it (a share) it is
    interrupted, and the scene from its goal to the new one, from rest to rest."""

    scene: deltaopt.Scene
    share: float
    then: deltaopt.Scene


def case(kind: str, number: int, first: int) -> Case:
    """The interruption of a kind and a number: a random move, a random instant, another random
    goal."""
    own, (name, limits) = _MOST * first + number, KINDS[kind]
    robot = deltaopt.load_robot(PROBLEMS / "robots" / f"{name}.yaml")
    share = float(np.random.default_rng([own, 1]).uniform())
    if kind != _BODIES:
        scene, other = random_scenes(robot, None, 2, own)
        scene = scene.model_copy(update={"limits": limits})
        return Case(scene, share, _then(scene, other))
    scene = scene_of(robot, first, 5 * (number // 4) + number % 4)
    others = (_then(scene, other) for other in random_scenes(robot, None, _GOALS, own))
    return Case(scene, share, next(filter(is_possible, others)))


def _then(scene: deltaopt.Scene, other: deltaopt.Scene) -> deltaopt.Scene:
    """The scene from the goal of one to that of another."""
    return scene.model_copy(update={"start": scene.goal, "goal": other.goal})


def interruption(each: Case, number: int, name: Path) -> Interruption:
    """Plan a case and verify its plans; what fails is written as a scene whose file begins so."""
    planner = deltaopt.Planner(each.scene.robot)
    old = planner.plan_scene(each.scene)
    now = old.trajectory(each.share * old.duration)
    left = old.duration - float(now.t)
    rest, at_rest = timed(lambda: planner.plan_scene(each.then))
    to_goal, to_rest = (
        each.scene.model_copy(update={"goal": goal})
        for goal in (each.then.goal, deltaopt.Anywhere())
    )
    new = _tried(lambda: planner.plan_scene(to_goal, start=now), left + rest.duration)
    stop = _tried(lambda: planner.plan_scene(to_rest, start=now), left)
    for scene, tried in ((to_goal, new), (to_rest, stop)):
        if tried.failure:
            state = deltaopt.State(at=tuple(now.x.tolist()), velocity=tuple(now.v.tolist()))
            what = "stop" if tried is stop else "new_goal"
            file = name.with_name(f"{name.name}_{what}")
            write_scene(file, scene.model_copy(update={"start": state}), tried.failure)
    return Interruption(
        number=number,
        seconds=new.seconds,
        seconds_at_rest=at_rest,
        ratio=new.duration / (left + rest.duration),
        stop=stop.duration / left,
        gap=new.gap,
        failure="; ".join(filter(None, (new.failure, stop.failure and f"stop: {stop.failure}"))),
    )


@dataclass(frozen=True)
class _Tried:
    """A plan that was tried: processor time and duration, s, gap, and what is wrong in words."""

    seconds: float
    duration: float
    gap: float
    failure: str


def _tried(make: Callable[[], deltaopt.Plan], most: float) -> _Tried:
    """Make a plan, which is to be verified and to take no longer than ``most`` (s)."""
    found, failure, seconds = attempted(make)
    if found is None:
        return _Tried(seconds, nan, nan, failure)
    failures = list(deltaopt.verify(found.scene, found.trajectory).failures())
    if found.duration > most * (1 + _SAME):
        failures.append(f"it takes {found.duration:.6g} s, where {most:.6g} s are possible")
    return _Tried(seconds, found.duration, found.gap, "; ".join(failures))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--number", type=one_or_more, default=145, help="of each robot")
    parser.add_argument("--seed", type=seed, default=1, help="of the random moves (default: 1)")
    parser.set_defaults(kinds=tuple(KINDS))
    add_directory(parser, "interruptions", "one CSV file for each robot, and scenes that fail")


def run(arguments: argparse.Namespace) -> int:
    """Print a table for each robot, and every failure."""
    folder, first, failed = arguments.directory, arguments.seed, 0
    for kind in arguments.kinds:

        def of(i: int, kind: str = kind) -> Interruption:
            return interruption(case(kind, i, first), i, folder / f"{kind}_{first}_{i:05d}")

        rows = kept_rows(
            folder / f"{kind}_{first}.csv",
            Interruption,
            range(arguments.number),
            lambda row: row.number,
            of,
            ProgressBar().counting(arguments.number, kind),
        )
        wrong = [row for row in rows if row.failure]
        failed += len(wrong)
        print(f"{kind}: {len(rows) - len(wrong)} of {len(rows)} planned and verified")
        for row in wrong:
            print(f"  {row.number}: {row.failure}")
        print(_table(rows), flush=True)
    return 1 if failed else 0


def _table(found: list[Interruption]) -> str:
    """Medians and extremes, one line each."""
    ratio, stop, gaps = (_column(found, name) for name in ("ratio", "stop", "gap"))
    seconds, at_rest = (_column(found, name) for name in ("seconds", "seconds_at_rest"))
    known = gaps[np.isfinite(gaps)]
    slower = np.median(seconds) / np.median(at_rest)
    return "\n".join(
        [
            f"  duration over that of the old motion and then from rest: median "
            f"{np.nanmedian(ratio):.3f}, largest {np.nanmax(ratio):.6f}",
            f"  stop over the rest of the old motion: median {np.nanmedian(stop):.3f}, largest "
            f"{np.nanmax(stop):.6f}",
            f"  gaps: median {np.median(known):.1e}, largest {np.max(known):.1e}; "
            f"{np.isinf(gaps).sum()} finished the old motion first",
            f"  processor time: median {1e3 * np.median(seconds):.1f} ms, {slower:.2f} "
            "times a plan from rest to rest",
        ]
    )


def _column(found: list[Interruption], name: str) -> NDArray[np.float64]:
    return np.array([getattr(each, name) for each in found])
