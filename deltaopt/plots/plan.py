"""A plan as one picture for whoever decides: the robot, the durations, the use of its motors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import pi
from pathlib import Path
from textwrap import fill
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import Normal, Stroke

from deltaopt.curves.piecewise import Array
from deltaopt.motion.limit_curves import limit_curves
from deltaopt.motion.sure_bounds import signed_distances
from deltaopt.motion.trajectory import Trajectory, ends_of
from deltaopt.output.facts import assumption, title, too_warm
from deltaopt.plots.bodies import draw_bodies, draw_via_points
from deltaopt.plots.colours import BLACK, COLOURS, GREY, LIGHT_GREY
from deltaopt.plots.robot_view import View, draw_robot, view_of_move
from deltaopt.plots.style import LARGE, SMALL, figure, motor_curves, verbatim, without_box
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.robot import as_delta
from deltaopt.scene.scene import Scene
from deltaopt.verify.duty import Duty

_INSTANTS = 5
"""Of the motion, at which the robot is drawn: more hide each other."""
_FAINTEST = 0.15
"""How opaque the robot is at the start; it grows until the goal."""
_SAMPLES = 1000
"""Samples of each curve over all intervals."""
_SHADOWS = "bodies are grey shadows: a path may pass them on this side or beyond"
_VIA, _SPHERES = "via points are diamonds", "circles the spheres about them"
"""What is to be known of the path's panels where a scene has bodies or via points."""
_TORQUE = "torque"
_LINE = 130
"""Letters of a line of the caption."""


def draw(
    file: Path,
    scene: Scene,
    trajectory: Trajectory,
    others: Mapping[str, float] = MappingProxyType({}),
    duty: Duty | None = None,
) -> None:
    """Draw a motion for a scene into a file.

    ``others``: durations to compare with, s, by what they are of. ``duty``: of the motors; their
    RMS torques are told where it is known. The format follows the file's suffix: png, pdf or svg.
    """
    has_marks = bool(scene.keep_out or scene.task.via)
    beside = [1.25, 1.0, 0.9] if has_marks else [1.25, 0.9]  # heights of what is beside the robot
    below = [1.1, 0.6] if scene.keep_out else [1.1]
    rows, height = [*beside, *below], 5.5 + 1.2 * has_marks + 0.9 * bool(scene.keep_out)
    with figure(file, 7.2, height) as page:
        page.suptitle(title(scene.task, trajectory.duration), fontsize=LARGE)
        grid = page.add_gridspec(len(rows), 2, width_ratios=[1.2, 1], height_ratios=rows)
        _robot(page.add_subplot(grid[: len(beside), 0]), scene, trajectory)
        _path(page.add_subplot(grid[0, 1]), scene, trajectory, _SIDE)
        if has_marks:
            _path(page.add_subplot(grid[1, 1]), scene, trajectory, _TOP)
        bars = page.add_subplot(grid[len(beside) - 1, 1])
        _bars(bars, {**others, "this plan": trajectory.duration})
        torques = page.add_subplot(grid[len(beside), :])
        _torques(torques, scene, trajectory, duty)
        if scene.keep_out:
            _clearance(page.add_subplot(grid[-1, :], sharex=torques), scene, trajectory)
            torques.set_xlabel("")
        told = (
            verbatim(fill(_what(scene, trajectory), _LINE)),
            assumption(scene.task),
            too_warm(duty),
            _marks(scene),
        )
        caption = "\n".join(filter(None, told))
        page.supxlabel(caption, fontsize=SMALL, color=GREY)


@dataclass(frozen=True)
class _Side:
    """A panel of the path: the angle it is seen from above, rad, and what its upward axis and its
    title say."""

    tilt: float
    up: str
    title: str


_SIDE = _Side(0.0, "above the start (mm)", "path (solid) and straight line (dotted)")
_TOP = _Side(pi / 2, "beside the start (mm)", "the same from above")


def _marks(scene: Scene) -> str:
    """What the marks in the path's panels are; empty where there are none."""
    has_spheres = any(point.within for point in scene.task.via)
    told = {
        _SHADOWS: bool(scene.keep_out),
        _VIA: bool(scene.task.via),
        _SPHERES: has_spheres,
    }
    return ", ".join(sentence for sentence, holds in told.items() if holds)


def _what(scene: Scene, trajectory: Trajectory) -> str:
    """The robot, the distance, the load and the objective."""
    start, goal = ends_of(problem_of(scene), trajectory)
    way = float(np.linalg.norm(goal - start))
    load = f" {scene.payload_in_words}" if scene.payload else ""
    return f"{scene.robot.name}: {1e3 * way:.3g} mm{load}, {scene.objective}"


def _robot(axes: Axes, scene: Scene, trajectory: Trajectory) -> None:
    """Draw the robot at some instants, the later the darker, and the path of its tool."""
    view = view_of_move(*ends_of(problem_of(scene), trajectory))
    motion = trajectory(trajectory.instants(_INSTANTS))
    strengths = np.linspace(_FAINTEST, 1, _INSTANTS) ** 1.5
    for x, theta, strength in zip(motion.x, motion.theta, strengths, strict=True):
        draw_robot(axes, as_delta(scene.robot), x, theta, view, strength=float(strength))
    _lines(axes, scene, trajectory, view)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_axis_off()
    axes.set_title(f"the robot at {_INSTANTS} instants, the last the darkest")


def _lines(
    axes: Axes, scene: Scene, trajectory: Trajectory, view: Callable[[Array], Array]
) -> None:
    """Draw the straight line from start to goal, the path, and where it begins and ends."""
    ends = view(ends_of(problem_of(scene), trajectory))
    path = view(trajectory(trajectory.instants(_SAMPLES)).x)
    above: dict[str, Any] = {"color": BLACK, "zorder": 4}
    halo = [Stroke(linewidth=3.0, foreground="white"), Normal()]
    axes.plot(*path.T, "-", linewidth=1.5, path_effects=halo, **above)
    axes.plot(*ends.T, ":", linewidth=1.0, **above)
    axes.plot(*ends[0], "o", markerfacecolor="white", markersize=4, **above)
    axes.plot(*ends[1], "o", markersize=4, **above)
    draw_via_points(axes, scene, view)


def _path(axes: Axes, scene: Scene, trajectory: Trajectory, side: _Side) -> None:
    """Draw the path alone, along the move to the right, mm: from the side, where up is up, or from
    above."""
    start, goal = ends_of(problem_of(scene), trajectory)
    view = View(view_of_move(start, goal, aside=0.0).turn, side.tilt)

    def place(points: Array) -> Array:
        return 1e3 * (view(points) - view(start))

    _lines(axes, scene, trajectory, place)
    dots = place(trajectory(trajectory.instants(_INSTANTS)[1:-1]).x)
    axes.plot(*dots.T, "o", color=BLACK, markersize=4, zorder=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    draw_bodies(axes, scene, place)
    axes.set_xlabel("along the move (mm)")
    axes.set_ylabel(side.up)
    axes.set_title(side.title)
    without_box(axes)


def _torques(axes: Axes, scene: Scene, trajectory: Trajectory, duty: Duty | None) -> None:
    """Draw each motor's torque over time in percent of its limit."""
    inside = np.linspace(0, 1, max(2, _SAMPLES // (len(trajectory.knots) - 1)))
    t = 1e3 * (trajectory.inside_intervals(inside).t - trajectory.knots[0])
    curves = next(
        c for c in limit_curves(problem_of(scene), trajectory, inside) if c.limit.name == _TORQUE
    )
    motor_curves(axes, t, 100 * curves.values / curves.upper)
    if duty is not None:
        _name_rms(axes, duty, curves.upper)
    axes.set_ylim(-105, 105)
    axes.set_yticks([-100, -50, 0, 50, 100])
    axes.set_xlabel("time (ms)")
    axes.set_ylabel("torque (% of the limit)")
    axes.legend(
        loc="lower left",
        bbox_to_anchor=(0, 1),
        ncols=4,
        borderaxespad=0.2,
        handlelength=2.2,
        columnspacing=1.2,
    )


def _clearance(axes: Axes, scene: Scene, trajectory: Trajectory) -> None:
    """Draw the distance from the tool to the nearest body over time, and the least that is asked
    for, mm."""
    t = trajectory.instants(_SAMPLES)
    distances, _ = signed_distances(problem_of(scene), trajectory(t).x)
    asked = 1e3 * scene.least_clearance
    axes.axhline(asked, color=BLACK, linewidth=1.0, linestyle=":")
    axes.plot(1e3 * (t - t[0]), 1e3 * distances.min(axis=1), color=BLACK)
    axes.set_ylim(bottom=min(0.0, float(1e3 * distances.min())))
    axes.set_xlabel("time (ms)")
    axes.set_ylabel("clearance (mm)")
    axes.set_title(f"distance from the tool to the nearest body; at least {asked:.3g} mm (dotted)")
    without_box(axes)


def _name_rms(axes: Axes, duty: Duty, limits: Array) -> None:
    """Write each motor's RMS torque beside its name, in percent of its limit (N·m, (3,)), and draw
    what it may be in the long run where the robot names that."""
    for line, motor, limit in zip(axes.get_lines(), duty.motors, limits.tolist(), strict=True):
        line.set_label(f"{line.get_label()}, RMS {100 * motor.rms_torque / limit:.0f} %")
    if duty.rated_torque is None:
        return
    for share in np.unique(np.divide(duty.rated_torque, limits)):
        name = f"rated RMS {100 * share:.0f} %"
        axes.axhline(100 * share, color=GREY, linewidth=0.9, linestyle=":", label=name)


def _bars(axes: Axes, durations: Mapping[str, float]) -> None:
    """Draw durations, s, as bars, the first on top; the last is the plan's."""
    names, values = list(durations), list(durations.values())
    colours = [LIGHT_GREY] * (len(names) - 1) + [COLOURS[0]]
    axes.barh(names, values, color=colours, height=0.6)
    for row, value in enumerate(values):
        axes.annotate(
            f"{value:.3f} s",
            (value, row),
            (-3, 0),
            ha="right",
            va="center",
            textcoords="offset points",
            color="white" if row == len(names) - 1 else BLACK,
        )
    axes.invert_yaxis()
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xticks([])
    axes.tick_params(axis="y", length=0)
    axes.grid(False)
    axes.spines[["top", "right", "bottom"]].set_visible(False)
    axes.set_title("duration")
