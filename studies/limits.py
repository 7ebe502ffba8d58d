"""What each limit and each term of the model costs: processor time of plans and their duration.

Random moves between points where the limit can be kept are planned with one limit or term more,
and with all of them, and without. Every motion is verified. How much time a limit takes is the
ratio of processor times for the same move, of which the median is shown.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial, reduce
from pathlib import Path
from typing import Any

import numpy as np

from deltaopt import Limits, Planner, Robot, Scene, load_robot, verify
from deltaopt.cli.arguments import positive
from deltaopt.errors import DeltaOptError
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.motion.time_scaling import highest_rows
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.known_limits import limits_of
from studies.bench.random_scenes import random_scenes
from studies.problems import INDUSTRIAL, add_robots
from studies.timed import timed

HELP = "what each limit and each term of the model costs: processor time and duration of moves"
SMALL = {"robots": (INDUSTRIAL,), "moves": 1, "tolerances": (1e-3,), "only": ("workspace radius",)}
_RUNS, _LONG = 3, 0.2
"""Of each plan; the least processor time counts. Once is enough for plans of so many seconds."""
_AT_LIMIT = 0.999
"""Share of a bound from which on a limit counts as reached."""


@dataclass(frozen=True)
class Case:
    """A limit or a term: keys of the robot's file and under ``limits``, for a robot."""

    name: str
    robot: dict[str, Any] = field(default_factory=dict)
    limits: dict[str, float] = field(default_factory=dict)

    def of(self, robot: Robot) -> Robot:
        """The robot with these keys."""
        return Robot.model_validate(_merged(robot.model_dump(exclude_none=True), self.robot))

    def __or__(self, other: Case) -> Case:
        robot = _merged(self.robot, other.robot)
        return Case("all of them", robot, self.limits | other.limits)


def _merged(content: dict[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    """The keys of both, with those of mappings in both."""
    return content | {
        key: {**content.get(key, {}), **value} if isinstance(value, dict) else value
        for key, value in more.items()
    }


def cases(robot: Robot) -> list[Case]:
    """One for each kind of limit, with numbers that many moves of the robot reach; all at last."""
    reach, torque = robot.upper_arm.length + robot.forearm.length, min(robot.torque_limits)
    speed = min(robot.speed_limits) if robot.speed_limits else 12.0
    curve = [[0.0, torque], [0.4 * speed, torque], [speed, 0.5 * torque]]
    each = [
        Case("platform speed", limits={"platform_speed": 0.35 * speed * reach}),
        Case("specific force", limits={"specific_force": 0.4 * speed**2 * reach}),
        Case("torque at speed", {"drive": {"torque_curve": curve}}),
        Case("arm angle", {"joints": {"arm": [-1.0, 0.4]}}),
        Case("ball joint angle", {"joints": {"ball": 0.35}}),
        Case("workspace depth", {"workspace": {"depth": [0.65 * reach, 0.85 * reach]}}),
        Case("workspace radius", {"workspace": {"radius": 0.3 * reach}}),
    ]
    return [*each, reduce(Case.__or__, each)]


def terms(robot: Robot) -> list[Case]:
    """One for each term beyond the paper, with numbers of usual proportions; all at last."""
    arm, platform, torque = robot.upper_arm, robot.platform.mass, min(robot.torque_limits)
    speed = min(robot.speed_limits) if robot.speed_limits else 12.0
    viscous, coulomb = 0.075 * torque / speed, 0.05 * torque
    dry = {"coulomb": coulomb, "speed": 0.005 * speed}
    each = [
        Case("drive inertia", {"drive": {"inertia": arm.mass * arm.length**2 / 3}}),
        Case("viscous friction", {"drive": {"friction": {"viscous": viscous}}}),
        Case("Coulomb friction", {"drive": {"friction": dry}}),
        Case("arm's centre", {"upper_arm": {"centre": [0.45 * arm.length, 0.02 * arm.length]}}),
        Case("elbow", {"elbow": {"mass": 0.1 * arm.mass}}),
        Case("pins", {"platform": {"pins": 0.1 * platform}}),
        Case("tool", {"tool": {"offset": [0.1 * arm.length, 0.0, 0.02], "mass": 0.5 * platform}}),
        Case("tilted gravity", {"gravity": [8.5, 0.0, 4.9]}),
    ]
    together = reduce(Case.__or__, each)
    together.robot["drive"]["friction"] = {"viscous": viscous, **dry}
    return [*each, together]


CASES = {"limits": cases, "terms": terms}
"""By what is added to the robot or the scene."""


@dataclass(frozen=True)
class Found:
    """A move planned with a limit or term and without. ``seconds``, ``durations``: of both;
    ``verified``, ``within``: whether the plan with it keeps all limits, and says that it is within
    the tolerance; ``active``: whether the motion reaches a limit of the case."""

    seconds: tuple[float, float]
    durations: tuple[float, float]
    verified: bool
    within: bool
    active: bool


def study(
    robot: Robot, case: Case, moves: int, tolerance: float, seed: int
) -> Iterator[Found | DeltaOptError]:
    """Plan random moves with a case's limits or terms and without; the error where a plan fails."""
    limited, limits = case.of(robot), Limits.model_validate(case.limits)
    with_it = Planner(limited, None, limits, tolerance)
    without = Planner(robot, None, None, tolerance)
    for scene in random_scenes(limited, None, moves, seed):
        ends = scene.start, scene.goal
        try:
            plain, plain_seconds = _timed(partial(without.plan, *ends))
            plan, seconds = _timed(partial(with_it.plan, *ends))
        except DeltaOptError as error:
            yield error
            continue
        yield Found(
            (seconds, plain_seconds),
            (plan.duration, plain.duration),
            verify(plan.scene, plan.trajectory).ok,
            plan.within_tolerance,
            _reaches(plan.scene, plan.trajectory, limits_of(plain.scene)),
        )


def _timed(plan: Callable[[], Any]) -> tuple[Any, float]:
    """A plan and the least processor time of some, s."""
    seconds = []
    for _ in range(_RUNS):
        found, spent = timed(plan)
        seconds.append(spent)
        if seconds[-1] > _LONG and len(seconds) > 1:
            break
    return found, min(seconds)


def _reaches(scene: Scene, trajectory: Any, before: SceneLimits) -> bool:
    """Whether a motion reaches a limit that the scene has and others had not."""
    constraints, highest = (
        limits_of(scene).constraints,
        highest_rows(problem_of(scene), trajectory).values,
    )
    parts = zip(constraints.items, constraints.slices, strict=True)
    new = [rows for item, rows in parts if item not in before.constraints.items]
    return any((highest[rows] > _AT_LIMIT).any() for rows in new)


def line(name: str, found: Sequence[Found | DeltaOptError]) -> str:
    """A line of the table."""
    planned = [each for each in found if isinstance(each, Found)]
    ratios = [each.seconds[0] / each.seconds[1] for each in planned]
    longer = [each.durations[0] / each.durations[1] - 1 for each in planned]
    return (
        f"{name:<18}{len(planned):>4} of {len(found):<4}{sum(f.verified for f in planned):>9}"
        f"{sum(f.within for f in planned):>8}{sum(f.active for f in planned):>8}"
        f"{np.median(ratios):>9.2f}"
        f"{np.percentile(ratios, 90):>9.2f}{np.mean(longer):>10.2%}"
    )


HEADER = (
    f"{'with':<18}{'planned':>12}{'verified':>9}{'within':>8}{'active':>8}"
    f"{'time':>9}{'90th %':>9}{'longer':>10}"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robots(parser)
    parser.add_argument("--moves", type=int, default=50, help="of each robot and case")
    parser.add_argument(
        "--tolerances", type=positive, nargs="+", default=[1e-3, 1e-6], help="of the gap"
    )
    parser.add_argument("--of", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--only", nargs="+", metavar="NAME", help="limits or terms, by their names")
    parser.add_argument("--seed", type=int, default=1)


def run(arguments: argparse.Namespace) -> int:
    for file in map(Path, arguments.robots):
        robot = load_robot(file)
        for tolerance in arguments.tolerances:
            print(f"{robot.name}, gap {tolerance:g}\n{HEADER}", flush=True)
            for case in (each for kind in arguments.of for each in CASES[kind](robot)):
                if not arguments.only or case.name in arguments.only:
                    _print_case(robot, case, tolerance, arguments)
            print()
    return 0


def _print_case(robot: Robot, case: Case, tolerance: float, arguments: argparse.Namespace) -> None:
    progress, found = ProgressBar(), []
    for each in study(robot, case, arguments.moves, tolerance, arguments.seed):
        found.append(each)
        progress(len(found) / arguments.moves, case.name)
        if isinstance(each, DeltaOptError):
            print(f"{case.name}: {each}")
    if any(isinstance(each, Found) for each in found):
        print(line(case.name, found), flush=True)
