"""What smooth torques cost: durations under limits of torque rate, on free paths and on the line.

Each scene is planned without such a limit and with several: the time that a motor takes at least
from no torque to its peak. Beside them stand two motions on the straight line, as fast as the same
limits allow: the best that there is on it, by Ipopt, and the S-curve that controllers drive, its
ramps chosen as they are best for it. Random moves tell the time of planning beside that of plans
whose torques jump.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import Any

import casadi as ca
import numpy as np

import deltaopt
from deltaopt import Plan, Scene, Trajectory
from deltaopt.cli.arguments import positive
from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.limits.joints import TorqueCurve
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.plots.colours import COLOURS, GREY
from deltaopt.plots.style import figure, name_lines, verbatim
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.task import given_points
from studies.problems import CROSS, PICK_AND_PLACE, PROBLEMS, add_directory, add_scenes
from studies.timed import timed

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
SMALL = {"scenes": (PICK_AND_PLACE,), "ramps": (8.0,), "moves": 1}
_SWING = 0.2
"""Of the peak torque, by which a motor's torque must turn back to count as a swing."""
_SHAPES = np.linspace(0.02, 0.24, 23)
"""Ramps of acceleration of the S-curves that are tried, as shares of the duration."""
_INTERVALS = 150
"""Of the line timed optimally: within some 1e-3 of its time; Ipopt fails on some finer meshes."""
_IPOPT: dict[str, Any] = {
    "print_time": False,
    "show_eval_warnings": False,
    "detect_simple_bounds": True,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.mu_init": 1e-3,
    "ipopt.max_iter": 300,
}


@dataclass(frozen=True)
class Ramped:
    """A plan under a limit of torque rate, and durations (s) on the straight line: timed optimally,
    and by the S-curve."""

    ramp: float
    plan: Plan
    line: float
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


def timed_line(scene: Scene) -> float:
    """The duration of the fastest motion on the straight line whose jerk is constant in each of
    many equal intervals, slowed until it keeps all limits at all instants, s.

    The unknowns are the share s of the line and its derivatives by the share of the time. Torques,
    speeds and rates of torques are limited at both ends of each interval.
    """
    n, problem, limits = _INTERVALS, problem_of(scene), limits_of(scene)
    start, goal = (np.array(point) for point in given_points(scene.task))
    model, way = problem.model, goal - start
    assert isinstance(model, DeltaModel)
    state, jerk = ca.SX.sym("state", 3), ca.SX.sym("jerk")
    s, v, a = ca.vertsplit(state)
    functions, p = model.functions, model.parameters
    motion = (start + s * way, v * way)
    tau = functions.explicit_torques(*motion, a * way, p)
    rates = ca.jtimes(tau, state, ca.vertcat(v, a, jerk))
    speeds = functions.velocity(*motion, p)[1][functions.motors]
    measures = {"torque": tau, "torque rate": rates, "speed": speeds}
    bounds = {name: limits.upper(name) for name in measures}
    shares = [measures[name] / most for name, most in bounds.items() if most is not None]
    for limit, numbers in zip(limits.constraints.limits, limits.of_items, strict=True):
        if isinstance(limit, TorqueCurve):
            shares.append((tau + numbers[0] * speeds) / numbers[1])
    asked = ca.Function("asked", [state, jerk], [ca.vertcat(*shares)]).map(n)

    opti, h = ca.Opti(), 1 / n
    T, z, j = opti.variable(), opti.variable(3, n + 1), opti.variable(1, n)
    step = np.array([[1, h, h**2 / 2], [0, 1, h], [0, 0, 1]])
    opti.subject_to(z[:, 1:] == step @ z[:, :-1] + np.array([[h**3 / 6], [h**2 / 2], [h]]) @ j)
    opti.subject_to(z[:, 0] == np.zeros(3))
    opti.subject_to(z[:, -1] == np.array([1, 0, 0]))
    powers = ca.repmat(ca.vertcat(1, 1 / T, 1 / T**2), 1, n)
    for ends in (z[:, :-1], z[:, 1:]):
        opti.subject_to(opti.bounded(-1, ca.vec(asked(powers * ends, j / T**3)), 1))
    opti.subject_to(opti.bounded(0, ca.vec(z[0, 1:-1]), 1))
    opti.minimize(T)
    u = np.linspace(0, 1, n + 1)
    opti.set_initial(T, 1.3 * best_s_curve(scene))
    quintic = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6])
    opti.set_initial(z, np.stack([quintic.deriv(order)(u) for order in range(3)]))
    opti.solver("ipopt", _IPOPT)
    found = opti.solve()
    states, jerks = np.array(found.value(z)), np.array(found.value(j))
    pieces = np.stack([*states[:2, :-1], states[2, :-1] / 2, jerks / 6], axis=1)
    coefficients = pieces[:, :, None] * way
    coefficients[:, 0] += start
    curve = Trajectory(PiecewisePolynomial(u, coefficients), model)
    return safe_factor(problem, curve, at_least=0.0)


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
    return total


def table(name: str, plain: Plan, trials: Sequence[Ramped]) -> str:
    """A line for each ramp."""
    rows = [f"{name}: {plain.duration:.6f} s with torques that jump, {swings(plain)} swings"]
    rows.append(
        f"{'ms':>6}{'T, s':>11}{'longer':>9}{'swings':>8}{'gap':>9}{'line':>9}{'S-curve':>9}"
    )
    for each in trials:
        longer = each.plan.duration / plain.duration - 1
        of_line, of_curve = (d / each.plan.duration - 1 for d in (each.line, each.s_curve))
        rows.append(
            f"{each.ramp:>6g}{each.plan.duration:>11.6f}{longer:>9.2%}{swings(each.plan):>8}"
            f"{each.plan.gap:>9.0e}{of_line:>+9.1%}{of_curve:>+9.1%}"
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


def message(found: dict[str, tuple[Plan, list[Ramped]]]) -> str:
    """What the ramp in the middle costs, and what the line costs more, medians of all scenes."""
    pairs = [(plain, trials[len(trials) // 2]) for plain, trials in found.values()]
    longer = np.median([each.plan.duration / plain.duration - 1 for plain, each in pairs])
    line, curve = (
        np.median(
            [
                duration / each.plan.duration - 1
                for duration, (_, each) in zip(of, pairs, strict=True)
            ]
        )
        for of in ([each.line for _, each in pairs], [each.s_curve for _, each in pairs])
    )
    return (
        f"{pairs[0][1].ramp:g} ms of ramp cost {100 * longer:.0f} %; the straight line costs "
        f"{100 * line:.0f} % more, by an S-curve {100 * curve:.0f} %"
    )


def draw(found: dict[str, tuple[Plan, list[Ramped]]], file: Path) -> None:
    """Draw how much longer plans, timed lines and S-curves take by the ramp, a part for each
    robot."""
    columns = min(len(found), 3)
    rows = -(-len(found) // columns)
    with figure(file, 7.2, 0.6 + 2.1 * rows, message(found)) as page:
        parts = page.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
        for axes, (name, (plain, trials)) in zip(parts, found.items(), strict=False):
            ramps = [each.ramp for each in trials]
            for label, style, colour, durations in (
                ("line, S-curve", "s:", GREY, [each.s_curve for each in trials]),
                ("line, timed", "D--", COLOURS[1], [each.line for each in trials]),
                ("free path", "o-", COLOURS[0], [_found(each.plan) for each in trials]),
            ):
                longer = [100 * (duration / plain.duration - 1) for duration in durations]
                axes.plot(ramps, longer, style, color=colour, markersize=3, label=label)
            axes.set_xscale("log", base=2)
            axes.set_xticks(ramps, [f"{ramp:g}" for ramp in ramps])
            axes.set_title("\n".join(wrap(verbatim(name), 34)), fontsize=7)
        for axes in parts[len(found) :]:
            axes.remove()
        parts[0].set_ylim(bottom=0)  # of all: they share it, and names in the last one
        name_lines(parts[len(found) - 1], room=0.4, apart=0.1)
        page.supxlabel("time from no torque to the peak, ms", fontsize=8)
        page.supylabel("longer than with jumps on a free path, %", fontsize=8)


def _found(plan: Plan) -> float:
    """The duration of a plan, s; NaN if it misses its tolerance."""
    return plan.duration if plan.within_tolerance else float("nan")


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
            on_line = timed_line(smooth), best_s_curve(smooth)
            trials.append(Ramped(ramp, deltaopt.plan(smooth), *on_line))
        found[scene.robot.name] = plain, trials
        print(table(f"{file.parent.name}/{file.stem}", plain, trials), flush=True)
        if arguments.moves:
            print(campaign(scene, arguments.ramps, arguments.moves), flush=True)
    arguments.directory.mkdir(parents=True, exist_ok=True)
    draw(found, arguments.directory / "smooth.png")
    return 0
