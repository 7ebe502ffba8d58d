"""The usual test cycle of packaging robots, 25 mm up, 305 mm across, 25 mm down, in numbers.

Both its straight line (305 mm across) and its rounded path, corners rounded from 20 mm on, by three
laws of time: a trapezoid of speed and an S-curve, each a third of the time accelerating, slowed
until they keep the limits, and timed optimally. The free path does not clear the height: it goes
where the motors are fastest.

Then the same over a wall, 25 mm high and 260 mm thick, which all of them clear: the rounded path is
the lowest that does, its corners as wide as they can be; the free path is planned past the wall,
and once more with motors that take 8 ms at least from no torque to their peak: the smooth one.

Robots whose own limits are of torque rates or jerk are left out: their paths are not given.
"""

from __future__ import annotations

import argparse
from math import exp, log
from pathlib import Path as File

import numpy as np

import deltaopt
from deltaopt.cli.streams import say
from deltaopt.curves.halving import bisected_number
from deltaopt.curves.piecewise import Array
from deltaopt.planning.comparisons import rounded_path_over
from deltaopt.robot.model import delta_model
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.task import OnPath
from studies.problems import INDUSTRIAL, PROBLEMS
from studies.smooth import limited

SMALL = {"robots": (INDUSTRIAL,)}
DEPTHS = {"orsino": 0.45, "industrial_drive": 0.97}
USUAL_DEPTH = 0.85
"""m, of start and goal below the base: in the middle of the workspace, with the tool if any."""
_RAMP = 8.0
"""ms, from no torque to the peak, of smooth plans."""
_SAMPLES = 20_001
_SHAPES = ("trapezoid", "S-curve")
_OVER_WALL = """\
| robot | trapezoid | S-curve | timed | free path | smooth | than first | than third | gap |
|---|---|---|---|---|---|---|---|---|"""
"""Heads of the columns of the second table."""


def cycle(robot: deltaopt.Robot, depth: float, path: object) -> deltaopt.Scene:
    """The move at a depth (m) on a path, with 1 kg."""
    ends = {"start": (depth, -0.1525, 0.0), "goal": (depth, 0.1525, 0.0)}
    return deltaopt.Scene.model_validate({"robot": robot, "payload": 1.0, **ends, "path": path})


def over_wall(robot: deltaopt.Robot, depth: float) -> deltaopt.Scene:
    """The move at a depth (m) on a free path over the wall of problems/keep_out."""
    wall = {"from": [depth - 0.025, -0.13, -0.5], "to": [depth + 0.65, 0.13, 0.5]}
    free = cycle(robot, depth, None)
    return deltaopt.Scene.model_validate({**dict(free), "keep_out": [{"box": wall}]})


def wall_row(name: str, scene: deltaopt.Scene) -> str:
    """A row of the table of durations over the wall, for the robot of a name. By how much less and
    the gap are of the smooth plan."""
    path = rounded_path_over(scene)
    assert path is not None
    rounded = scene.model_copy(update={"path": path})
    laws = [by_law(rounded, shape) for shape in _SHAPES]
    timed = deltaopt.plan(rounded, tolerance=1e-4).duration
    smoothly, durations = limited(scene, _RAMP), [*laws, timed]
    for each in (scene, smoothly):
        plan = deltaopt.plan(each)
        assert deltaopt.verify(each, plan.trajectory).ok
        durations.append(plan.duration)
    cells = " | ".join(f"{duration:.4f} s" for duration in durations)
    less = " | ".join(f"{100 * (1 - plan.duration / other):.0f} %" for other in (laws[0], timed))
    return f"| {name} | {cells} | {less} | {100 * plan.gap:.2f} % |"


def by_law(scene: deltaopt.Scene, shape: str) -> float:
    """The duration, s, of a law of time on a scene's path, slowed until it keeps torques and motor
    speeds."""
    model = delta_model(scene.robot, scene.payload)
    x, v, a = sampled_law(scene, shape)
    limits = limits_of(scene)
    torque, speed = limits.upper("torque"), limits.upper("speed")
    assert torque is not None
    rates = model.motion(x, v, np.zeros_like(x))[1][:, 3::3]
    fastest = 0.0 if speed is None else float(np.abs(rates / speed).max())

    def is_kept(duration: float) -> bool:
        tau = model.inverse_dynamics(x, v / duration, a / duration**2)
        return duration >= fastest and bool((np.abs(tau) <= torque).all())

    return exp(bisected_number(lambda s: is_kept(exp(s)), log(1e-2), log(10.0), 23)[1])


def sampled_law(scene: deltaopt.Scene, shape: str) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration along a scene's path in 1 s, (N, 3) each."""
    task = scene.task
    assert isinstance(task, OnPath)
    path = task.path
    t = np.linspace(0.0, 1.0, _SAMPLES)
    ramp = {"trapezoid": 0.0, "S-curve": 1 / 9}[shape]
    starting = _pulse(t, ramp)
    u = starting - starting[::-1]
    rate = np.concatenate([[0.0], np.cumsum((u[1:] + u[:-1]) / 2 * np.diff(t))])
    s = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(t))])
    scale = (path.knots[-1] - path.knots[0]) / s[-1]
    s, rate, u = path.knots[0] + scale * s, (scale * rate)[:, None], (scale * u)[:, None]
    dx, ddx = path(s, 1), path(s, 2)
    return path(s), dx * rate, ddx * rate**2 + dx * u


def _pulse(t: Array, ramp: float) -> Array:
    """1 in the first third of the time, with ramps of so much of the time at both ends."""
    if not ramp:
        return np.where(t < 1 / 3, 1.0, 0.0)
    return np.clip(np.minimum(t, 1 / 3 - t) / ramp, 0.0, 1.0)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    shipped = sorted((PROBLEMS / "robots").glob("*.yaml"))
    parser.add_argument(
        "robots",
        nargs="*",
        type=File,
        default=shipped,
        metavar="ROBOT",
        help="robot files (default: all that are shipped)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Print one row of a table for each robot and path, and one of another for each robot."""
    robots = dict[str, tuple[deltaopt.Robot, float]]()
    for file in arguments.robots:
        robot, depth = deltaopt.load_robot(file), DEPTHS.get(file.stem, USUAL_DEPTH)
        if cycle(robot, depth, None).has_rates:
            say(f"{file.stem} is left out: its limits of rates are for free paths")
        else:
            robots[file.stem] = robot, depth
    print("| robot | path | trapezoid | S-curve | timed optimally | free path |")
    print("|---|---|---|---|---|---|")
    for robot_name, (robot, depth) in robots.items():
        rounded = {"pick_and_place": {"height": 0.025, "blend": 0.02}}
        for name, path in (("line across", "line"), ("25-305-25, rounded", rounded)):
            scene = cycle(robot, depth, path)
            laws = [by_law(scene, shape) for shape in _SHAPES]
            plan = deltaopt.beside_free_path(deltaopt.plan(scene, tolerance=1e-4))
            durations = [*laws, plan.duration, plan.free_duration]
            cells = " | ".join(f"{duration:.4f} s" for duration in durations)
            print(f"| {robot_name} | {name} | {cells} |", flush=True)
    print("\n" + _OVER_WALL)
    for robot_name, (robot, depth) in robots.items():
        print(wall_row(robot_name, over_wall(robot, depth)), flush=True)
    return 0
