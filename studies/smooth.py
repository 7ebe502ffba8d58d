"""What smooth torques cost: durations under limits of torque rate, on free paths and on the line.

Each scene is planned without such a limit and with several: the time that a motor takes at least
from no torque to its peak. Beside them stands the S-curve that controllers drive on the straight
line, its ramps chosen as they are best for it, as fast as the same limits allow. Random moves tell
the time of planning beside that of plans whose torques jump.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

import deltaopt
from deltaopt import Plan, Scene, Trajectory
from deltaopt.cli.arguments import positive
from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.plots.colours import COLOURS, GREY
from deltaopt.plots.style import figure
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.task import given_points
from studies.problems import CROSS, PICK_AND_PLACE, PROBLEMS, add_directory, add_scenes
from studies.timed import timed

HELP = "what smooth torques cost in time"
RAMPS = (2.0, 4.0, 8.0, 16.0, 32.0)
"""Times from no torque to the peak, ms."""
SIX = (
    PICK_AND_PLACE,
    CROSS,
    PROBLEMS / "industrial_drive.yaml",
    PROBLEMS / "limits" / "drive_joints_workspace.yaml",
    PROBLEMS / "hornet" / "1_kg.yaml",
    PROBLEMS / "rl5" / "1_kg.yaml",
)
"""A scene of each shipped robot."""
SMALL = {"scenes": (PICK_AND_PLACE,), "ramps": (8.0,), "moves": 2}
_SWING = 0.2
"""Of the peak torque, by which a motor's torque must turn back to count as a swing."""
_SHAPES = np.linspace(0.02, 0.24, 23)
"""Ramps of acceleration of the S-curves that are tried, as shares of the duration."""


@dataclass(frozen=True)
class Ramped:
    """A plan under a limit of torque rate, and the S-curve's duration (s) on the straight line."""

    ramp: float
    plan: Plan
    s_curve: float


def limited(scene: Scene, ramp: float) -> Scene:
    """A scene whose motors take so many ms at least from no torque to their peak."""
    rate = tuple(torque / (1e-3 * ramp) for torque in scene.robot.torque_limits)
    given = {} if scene.limits is None else scene.limits.model_dump(exclude_none=True)
    return scene.model_copy(update={"limits": {**given, "torque_rate": rate}})


def s_curve(scene: Scene, ramp: float) -> Trajectory:
    """Along the straight line the acceleration rises for a share of the duration, holds, falls to
    its opposite, holds and rises to zero."""
    start, goal = (np.array(point) for point in given_points(scene.task))
    knots = np.array([0.0, ramp, 0.5 - ramp, 0.5 + ramp, 1 - ramp, 1.0])
    bends = np.array([0.0, 1.0, 1.0, -1.0, -1.0, 0.0])
    s = rate = 0.0
    pieces = []
    for h, a, b in zip(np.diff(knots), bends[:-1], bends[1:], strict=True):
        pieces.append([s, rate, a / 2, (b - a) / (6 * h)])
        s, rate = s + h * rate + h**2 * (2 * a + b) / 6, rate + h * (a + b) / 2
    coefficients = np.array(pieces)[:, :, None] / s * (goal - start)
    coefficients[:, 0] += start
    return Trajectory(PiecewisePolynomial(knots, coefficients), problem_of(scene).model)


def best_s_curve(scene: Scene) -> float:
    """The duration of the fastest of these, slowed until it keeps all limits, s."""
    curves = (s_curve(scene, float(shape)) for shape in _SHAPES)
    return min(safe_factor(problem_of(scene), curve, at_least=0.0) for curve in curves)


def swings(plan: Plan) -> int:
    """How often any motor's torque turns back by more than a share of its limit."""
    knots, shares = plan.trajectory.knots, np.linspace(0, 1, 9)
    times = (knots[:-1, None] + np.diff(knots)[:, None] * shares).ravel()
    torques = plan.trajectory(np.clip(times, knots[0], knots[-1])).tau
    total = 0
    for torque, limit in zip(torques.T, plan.scene.robot.torque_limits, strict=True):
        low = high = float(torque[0])
        rising = None
        for value in torque.tolist():
            low, high = min(low, value), max(high, value)
            if rising is not True and value - low > _SWING * limit:
                total, rising, high = total + (rising is False), True, value
            elif rising is not False and high - value > _SWING * limit:
                total, rising, low = total + (rising is True), False, value
            if rising is True:
                low = value if value >= high else low
            elif rising is False:
                high = value if value <= low else high
    return total


def table(name: str, plain: Plan, trials: Sequence[Ramped]) -> str:
    """A line for each ramp."""
    rows = [f"{name}: {plain.duration:.6f} s with torques that jump, {swings(plain)} swings"]
    rows.append(f"{'ms':>6}{'T, s':>11}{'longer':>9}{'swings':>8}{'gap':>9}{'S-curve':>11}")
    for each in trials:
        longer = each.plan.duration / plain.duration - 1
        of_curve = each.s_curve / each.plan.duration - 1
        rows.append(
            f"{each.ramp:>6g}{each.plan.duration:>11.6f}{longer:>9.2%}{swings(each.plan):>8}"
            f"{each.plan.gap:>9.0e}{of_curve:>+11.1%}"
        )
    return "\n".join(rows)


def campaign(scene: Scene, ramps: Sequence[float], number: int) -> str:
    """Random moves about a scene's, verified, beside plans without limits of rates."""
    start, goal = (np.array(point) for point in given_points(scene.task))
    middle, half = (start + goal) / 2, np.linalg.norm(goal - start) / 2
    rng, progress = np.random.default_rng(1), ProgressBar().counting(number, "moves")
    ratios, gaps, bad = list[float](), list[float](), 0
    for i in range(number):
        ends = middle + half * rng.uniform(-1, 1, (2, 3)) * [0.4, 1.2, 1.2]
        begin, end = (tuple(point) for point in ends.tolist())
        plain = scene.model_copy(update={"start": begin, "goal": end})
        smooth = limited(plain, float(rng.choice(ramps)))
        for each in (plain, smooth) if i == 0 else ():
            deltaopt.plan(each)  # compiles
        _, once = timed(partial(deltaopt.plan, plain))
        found, again = timed(partial(deltaopt.plan, smooth))
        ratios.append(again / once)
        gaps.append(found.gap)
        bad += not (found.within_tolerance and deltaopt.verify(smooth, found.trajectory).ok)
        progress(i + 1)
    half_, most = np.percentile(ratios, [50, 90])
    return (
        f"{number} random moves: {bad} not verified or beyond the tolerance, largest gap "
        f"{max(gaps):.1e}; time over that of plain plans {half_:.1f} (median), {most:.1f} (90 %)"
    )


def draw(found: dict[str, tuple[Plan, list[Ramped]]], file: Path) -> None:
    """Draw how much longer plans and S-curves take by the ramp."""
    with figure(file, 7.2, 3.6) as page:
        axes = page.subplots()
        for i, (name, (plain, trials)) in enumerate(found.items()):
            colour = [*COLOURS, *COLOURS][i]
            ramps = [each.ramp for each in trials]
            style = "-" if i < len(COLOURS) else ":"
            free = [100 * (each.plan.duration / plain.duration - 1) for each in trials]
            line = [100 * (each.s_curve / plain.duration - 1) for each in trials]
            axes.plot(ramps, free, style, color=colour, marker="o", label=name)
            axes.plot(ramps, line, style, color=GREY, marker="s", markersize=3)
        axes.set_xscale("log", base=2)
        axes.set_xticks(ramps, [f"{ramp:g}" for ramp in ramps])
        axes.set_xlabel("time from no torque to the peak, ms")
        axes.set_ylabel("longer than with jumps, %")
        axes.set_title("smooth torques: free paths (colours), S-curves on the line (grey)")
        axes.legend(fontsize=7)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scenes(parser, SIX)
    add_directory(parser, "smooth", "smooth.png")
    parser.add_argument("--ramps", nargs="+", type=positive, default=RAMPS, metavar="MS")
    parser.add_argument("--moves", type=int, default=0, help="random moves of each scene")


def run(arguments: argparse.Namespace) -> int:
    found = dict[str, tuple[Plan, list[Ramped]]]()
    for file in arguments.scenes:
        scene, trials = deltaopt.load_scene(file), list[Ramped]()
        plain = deltaopt.plan(scene)
        for ramp in arguments.ramps:
            smooth = limited(scene, ramp)
            trials.append(Ramped(ramp, deltaopt.plan(smooth), best_s_curve(smooth)))
        found[scene.robot.name] = plain, trials
        print(table(f"{file.parent.name}/{file.stem}", plain, trials), flush=True)
        if arguments.moves:
            print(campaign(scene, arguments.ramps, arguments.moves), flush=True)
    arguments.directory.mkdir(parents=True, exist_ok=True)
    draw(found, arguments.directory / "smooth.png")
    return 0
