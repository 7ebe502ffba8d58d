"""A plan as one picture for whoever decides: the robot, the durations, the use of its motors."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import Normal, Stroke

from deltaopt.curves.piecewise import Array
from deltaopt.motion.active_limits import active_limits, shares_of_time
from deltaopt.motion.limit_curves import curves_over_time
from deltaopt.motion.trajectory import Trajectory, ends_of
from deltaopt.output.facts import assumption, title
from deltaopt.plots.colours import BLACK, COLOURS, GREY, LIGHT_GREY
from deltaopt.plots.robot_view import along_move, draw_robot, view_of_move
from deltaopt.plots.style import (
    LARGE,
    SMALL,
    figure,
    motor_curves,
    name_lines,
    name_rms,
    verbatim,
    without_box,
)
from deltaopt.plots.surroundings import draw_bodies_near, draw_surroundings
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.robot import as_delta
from deltaopt.scene.scene import Scene
from deltaopt.verify.clearance import clearances
from deltaopt.verify.duty import Duty

_INSTANTS = 5
"""Of the motion, at which the robot is drawn: more hide each other."""
_FAINTEST = 0.15
"""How opaque the robot is at the start; it grows until the goal."""
_SAMPLES = 1000
"""Samples of each curve over all intervals."""
_TORQUE = "torque"
_LINE = 130
"""Letters of a line of the caption."""
_ROOM = 0.22
"""Share of the width of what is drawn over time that the names of its lines take."""
_LABEL = 0.3
"""Of the longest bar: on a shorter one its label has no room, and stands beside it."""


def draw(
    file: Path, scene: Scene, trajectory: Trajectory, others: Mapping[str, float], duty: Duty | None
) -> None:
    """Draw a motion for a scene into a file.

    ``others``: durations to compare with, s, by what they are of. ``duty``: of the motors; their
    RMS torques are told where it is known. The format follows the file's suffix: png, pdf or svg.
    """
    rows = [1.0, 1.0, *([0.7] if others else []), 1.0, *([0.7] if scene.keep_out else [])]
    with figure(file, 7.2, 1.7 * sum(rows) + 0.8) as page:
        page.suptitle(headline_of(scene, trajectory, duty), fontsize=LARGE)
        grid = page.add_gridspec(len(rows), 2, width_ratios=[1.2, 1], height_ratios=rows)
        beside = 3 if others else 2
        ends = ends_of(problem_of(scene), trajectory)
        _robot(page.add_subplot(grid[:beside, 0]), scene, trajectory, ends)
        for row, tilt in enumerate((0.0, pi / 2)):
            _path(page.add_subplot(grid[row, 1]), scene, trajectory, ends, tilt)
        if others:
            _bars(page.add_subplot(grid[2, 1]), {**others, "this plan": trajectory.duration})
        over_time = [page.add_subplot(grid[row, :]) for row in range(beside, len(rows))]
        _torques(over_time[0], scene, trajectory, duty)
        if scene.keep_out:
            _clearance(over_time[1], scene, trajectory)
        over_time[-1].set_xlabel("time (ms)", loc="left")
        load = f" {scene.payload_in_words}" if scene.payload else ""
        way = f"{1e3 * np.linalg.norm(ends[1] - ends[0]):.4g} mm{load}, {scene.objective}"
        what = verbatim(fill(f"{scene.robot.name}: {way}", _LINE))
        told = "\n".join(filter(None, (what, assumption(scene.task), _marks(scene))))
        page.supxlabel(told, fontsize=SMALL, color=GREY)


def headline_of(scene: Scene, trajectory: Trajectory, duty: Duty | None) -> str:
    """The duration, what it permits, and how far the warmest motor is above its rated torque."""
    said = title(scene.task, trajectory.duration)
    if duty is None or (duty.rms_share or 0.0) <= 1:
        return said
    return f"{said}; RMS torque {duty.rms_share:.2g} times the rated one: needs pauses"


def _marks(scene: Scene) -> str:
    """What the marks about the path are; empty where there are none."""
    told = {
        "grey: keep out": bool(scene.keep_out),
        "blue: stay within": bool(scene.tube or scene.columns),
        "diamonds: via points": bool(scene.task.via),
        "circles: pass within": any(point.within for point in scene.task.via),
        "orange: velocities at the ends": scene.moves_at_ends,
    }
    return "; ".join(sentence for sentence, holds in told.items() if holds)


def _robot(axes: Axes, scene: Scene, trajectory: Trajectory, ends: Array) -> None:
    """Draw the robot at some instants, the later the darker, and the path of its tool; ``ends``:
    start and goal, (2, 3), m."""
    view = view_of_move(*ends)
    motion = trajectory(trajectory.instants(_INSTANTS))
    strengths = np.linspace(_FAINTEST, 1, _INSTANTS) ** 1.5
    for x, theta, strength in zip(motion.x, motion.theta, strengths, strict=True):
        draw_robot(axes, as_delta(scene.robot), x, theta, view, strength=float(strength))
    path = trajectory(trajectory.instants(_SAMPLES)).x
    _lines(axes, view(ends), view(path))
    draw_bodies_near(axes, scene, path, view)
    draw_surroundings(axes, scene.model_copy(update={"keep_out": None}), trajectory, view)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_axis_off()
    axes.set_title(f"the robot at {_INSTANTS} instants, the last the darkest")


def _lines(axes: Axes, ends: Array, path: Array) -> None:
    """Draw the straight line from start to goal, (2, 2), the path, (N, 2), and its ends."""
    above: dict[str, Any] = {"color": BLACK, "zorder": 4}
    halo = [Stroke(linewidth=3.0, foreground="white"), Normal()]
    axes.plot(*path.T, "-", linewidth=1.5, path_effects=halo, **above)
    axes.plot(*ends.T, ":", linewidth=1.0, **above)
    axes.plot(*ends[0], "o", markerfacecolor="white", markersize=4, **above)
    axes.plot(*ends[1], "o", markersize=4, **above)


def _path(axes: Axes, scene: Scene, trajectory: Trajectory, ends: Array, tilt: float) -> None:
    """Draw the path alone, along the move to the right, mm: from the side, where up is up, or from
    above, which ``tilt`` says as a `View`'s. ``ends``: start and goal, (2, 3), m."""
    place = along_move(ends[0], ends[1], tilt)
    path = place(trajectory(trajectory.instants(_SAMPLES)).x)
    _lines(axes, place(ends), path)
    dots = place(trajectory(trajectory.instants(_INSTANTS)[1:-1]).x)
    axes.plot(*dots.T, "o", color=BLACK, markersize=3, zorder=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    draw_surroundings(axes, scene, trajectory, place)
    ups = path[:, 1]
    if tilt == 0:
        axes.set_title(f"side view: {ups.max():.0f} mm up at most")
        axes.set_ylabel("up (mm)")
    else:
        axes.set_title(f"from above: {max(ups.max(), -ups.min()):.0f} mm aside at most")
        axes.set_ylabel("aside (mm)")
        axes.set_xlabel("along the move (mm)")
    without_box(axes)


def _torques(axes: Axes, scene: Scene, trajectory: Trajectory, duty: Duty | None) -> None:
    """Draw each motor's torque over time in percent of its limit."""
    motion, limits = curves_over_time(problem_of(scene), trajectory, _SAMPLES)
    t = 1e3 * (motion.t - trajectory.knots[0])
    curves = next(each for each in limits if each.limit.name == _TORQUE)
    percent = 100 * curves.values / curves.upper
    motor_curves(axes, t, percent)
    if duty is not None:
        rms = [motor.rms_torque for motor in duty.motors]
        name_rms(axes, rms, duty.rated_torque, curves.upper)
    active = active_limits(problem_of(scene), trajectory)
    share = shares_of_time(active, trajectory.duration).get(_TORQUE, 0.0)
    axes.set_title(f"torques: one is at its limit {100 * share:.0f} % of the time")
    axes.set_ylim(-105, 105)
    axes.set_yticks([-100, -50, 0, 50, 100])
    axes.set_ylabel("% of the limit")
    name_lines(axes, room=_ROOM, apart=0.14)


def _clearance(axes: Axes, scene: Scene, trajectory: Trajectory) -> None:
    """Draw the distances of the tool and of the links from the nearest body over time, and the
    least that is asked for, mm; the title tells the least of those that the scene keeps."""
    t, asked = trajectory.instants(_SAMPLES), 1e3 * scene.least_clearance
    _, instant, _ = _nearest(_in_mm(scene, trajectory, t))
    around = t[max(0, instant - 1)], t[min(instant + 1, len(t) - 1)]
    t = np.sort(np.append(t, np.linspace(*around, _SAMPLES // 5)))  # where a path turns sharply
    kept = _in_mm(scene, trajectory, t)
    for (name, values), colour in zip(kept.items(), (BLACK, GREY), strict=False):
        axes.plot(1e3 * (t - t[0]), values.min(axis=1), color=colour, label=name)
    name, instant, body = _nearest(kept)
    least, kind = float(kept[name][instant, body]), (scene.keep_out or ())[body].kind
    axes.set_title(
        f"clearance: from {name} to a {kind} {least:.2f} mm at least, {asked:.3g} mm are asked for"
    )
    at = 1e3 * (t[instant] - t[0])
    axes.plot(at, least, "o", color=BLACK, markersize=4, label="_nearest")
    axes.axhline(asked, color=BLACK, linewidth=1.0, linestyle=":", label="_asked", zorder=1)
    axes.set_ylim(bottom=min(0.0, least))
    axes.set_xlim(0.0, 1e3 * trajectory.duration)
    axes.set_ylabel("mm")
    name_lines(axes, room=_ROOM, apart=0.2)
    without_box(axes)


def _in_mm(scene: Scene, trajectory: Trajectory, t: Array) -> dict[str, Array]:
    """Distances from each body, mm, at instants, s, of what keeps clear."""
    return {name: 1e3 * each for name, each in clearances(scene, trajectory(t)).items()}


def _nearest(distances: Mapping[str, Array]) -> tuple[str, int, int]:
    """What of the robot is nearest to a body: its name, and the indices of instant and body."""
    name = min(distances, key=lambda name: float(distances[name].min()))
    instant, body = np.unravel_index(distances[name].argmin(), distances[name].shape)
    return name, int(instant), int(body)


def _bars(axes: Axes, durations: Mapping[str, float]) -> None:
    """Draw durations, s, as bars, the first on top; the last is the plan's."""
    names, values = list(durations), list(durations.values())
    colours = [LIGHT_GREY] * (len(names) - 1) + [COLOURS[0]]
    axes.barh(names, values, color=colours, height=0.6)
    for row, value in enumerate(values):
        is_inside = value > _LABEL * max(values)
        axes.annotate(
            f"{value:.3f} s",
            (value, row),
            (-3 if is_inside else 3, 0),
            ha="right" if is_inside else "left",
            va="center",
            textcoords="offset points",
            color="white" if is_inside and row == len(names) - 1 else BLACK,
        )
    axes.invert_yaxis()
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xticks([])
    axes.tick_params(axis="y", length=0)
    axes.grid(False)
    axes.spines[["top", "right", "bottom"]].set_visible(False)
    change = 100 * (values[-1] / min(values[:-1]) - 1)
    how = "less" if change < 0 else "more"
    best = min(names[:-1], key=lambda name: durations[name]).partition(",")[0]
    axes.set_title(f"{abs(change):.0f} % {how} time than the {best}")
