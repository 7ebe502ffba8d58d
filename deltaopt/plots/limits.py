"""A chart of the limits of a plan: every limited quantity between its bounds, and the path.

If the motion meets Pontryagin's condition, two more panels show the switching function of each
motor and how constant the Hamiltonian is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import cycle, islice
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from deltaopt.curves.piecewise import Array
from deltaopt.limits.limit import OwnMeasure
from deltaopt.motion.limit_curves import LimitCurves, curves_over_time
from deltaopt.motion.trajectory import Trajectory, ends_of
from deltaopt.output.facts import Facts, together
from deltaopt.output.in_words import is_optimal
from deltaopt.plots.colours import BLACK, COLOURS, GREY, LIGHT_GREY, LINE_COLOURS
from deltaopt.plots.style import SMALL, STROKES, figure, motor_curves, without_box
from deltaopt.plots.surroundings import draw_bodies
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.scene import Scene
from deltaopt.settings import require_type
from deltaopt.verify.duty import exceeding
from deltaopt.verify.pontryagin import Extremal, extremal
from deltaopt.verify.verification import Verification

_TICKS = 10
"""Parts of equal time that dots divide the path into."""
_LIMIT = "limit"
"""Label of the bounds in the legend."""
_LINE, _LABEL = 130, 22
"""Letters of a line of the caption, and of the label beside a panel, which is as tall."""
_NAMED = 8
"""Curves of a panel that are named: those that come nearest to their bound."""
_LIKE_MOTORS = ("motor", "chain")
"""What a limit is of where it has a number for each motor."""
_SAMPLES = 2000
"""Samples of each curve over all intervals, about the pixels of a panel's width."""


def draw_limits(file: Path, facts: Facts) -> None:
    """Draw a motion for a scene into a file, with switching functions where it meets Pontryagin's
    condition. The format follows the file's suffix: png, pdf or svg."""
    scene, trajectory = facts.plan.scene, facts.plan.trajectory
    costates = extremal(scene, trajectory) if is_optimal(facts.verification) else None
    told = caption(facts.verification)
    motion, curves = curves_over_time(problem_of(scene), trajectory, _SAMPLES)
    ends = ends_of(problem_of(scene), trajectory)
    ticks = trajectory(trajectory.instants(_TICKS + 1)[1:-1]).x
    panels = max(2, len(curves))
    rows = panels + (costates is not None)
    with figure(file, 7.0, 2.05 * rows + 0.15 * len(told.splitlines())) as page:
        grid = page.add_gridspec(rows, 2, width_ratios=[1.7, 1])
        left = [page.add_subplot(grid[0, 0])]
        left += [page.add_subplot(grid[i, 0], sharex=left[0]) for i in range(1, panels)]
        for axes, each, names in zip(left, curves, _names(scene, curves), strict=False):
            _limit(axes, motion.t, each, names)
        left[0].set_title(facts.active[0].sentence if facts.active else "no limit is reached")
        if len(curves) < panels:  # there is room to show how fast the motors turn
            left[-1].set_ylabel(r"motor speed $\dot\theta_k$ (rad/s)")
            motor_curves(left[-1], motion.t, motion.dtheta)
        left[-1].set_xlabel(r"time $t$ (s)")
        side = page.add_subplot(grid[0, 1])
        side.set_ylabel("$x$ (mm), down")
        _path(side, ends, motion.x, ticks, along=0)
        side.invert_yaxis()
        draw_bodies(side, scene, lambda points: 1e3 * points[:, [1, 0]])
        above = page.add_subplot(grid[1, 1])
        above.set_ylabel("$z$ (mm)")
        _path(above, ends, motion.x, ticks, along=2)
        draw_bodies(above, scene, lambda points: 1e3 * points[:, [1, 2]])
        if costates is not None:
            switching = page.add_subplot(grid[panels, 0], sharex=left[0])
            _switching(switching, costates)
            _hamiltonian(page.add_subplot(grid[panels, 1]), costates)
        _legend(page, left[0], side)
        page.supxlabel(told, fontsize=SMALL)


def caption(verification: Verification) -> str:
    """What the chart's lines do not show of a motion: duty of the motors, nearest singularity."""
    duty, lines = verification.duty, []
    if duty is not None:
        rms = ", ".join(f"{each.rms_torque:.4g}" for each in duty.motors)
        rated = ", ".join(f"{torque:g}" for torque in dict.fromkeys(duty.rated_torque or ()))
        above = f", {exceeding(duty.above_rated)}" if any(duty.above_rated or ()) else ""
        lines.append(
            f"RMS torque {rms} N·m"
            + (f" (rated {rated}{above})" if rated else "")
            + f"; largest speed {max(each.largest_speed for each in duty.motors):.4g} rad/s"
        )
        lines.append(together(duty))
    if verification.distances:
        least = "; ".join(f"{each.name} {each.least:.2g}" for each in verification.distances)
        lines.append(f"least distance to singularities: {least}")
    return "\n".join(fill(line, _LINE) for line in lines)


def plot_limit(scene: Scene, trajectory: Trajectory, limit: str, axes: Axes | None) -> Axes:
    """Draw a limited quantity over time and its bounds on one's own axes, or on new ones.

    Raises ValueError if the scene has no limit of this name, TypeError for what is no axes.
    """
    if axes is not None:
        require_type("axes", axes, Axes, "an Axes of matplotlib; save() writes pictures")
    motion, curves = curves_over_time(problem_of(scene), trajectory, _SAMPLES)
    named = zip(curves, _names(scene, curves), strict=True)
    found = {each.limit.name: (each, names) for each, names in named}
    if limit not in found:
        raise ValueError(f"limit is {limit!r}; the scene has {', '.join(found)}")
    drawn = Figure(layout="constrained").add_subplot() if axes is None else axes
    _limit(drawn, motion.t, *found[limit])
    drawn.set_xlabel(r"time $t$ (s)")
    return drawn


def _names(scene: Scene, curves: Sequence[LimitCurves]) -> Iterator[list[str]]:
    """What each column of every limit is of: a body of those that the tool keeps clear of, or a
    motor, a chain, and so on."""
    bodies = ((scene.keep_out or ())[index].named(index) for index, _ in scene.obstacles)
    for each in curves:
        columns = each.values.shape[1]
        if each.limit.own_measure is OwnMeasure.CLEARANCE:
            yield list(islice(bodies, columns))
        else:
            yield [f"{each.limit.subject} {k + 1}" for k in range(columns)]


def _limit(axes: Axes, t: Array, curves: LimitCurves, names: Sequence[str]) -> None:
    """Draw a limited quantity over time, and its bounds; ``names``: of its columns."""
    axes.set_ylabel(fill(f"{curves.limit.name} ({curves.limit.unit})", _LABEL))
    if curves.limit.subject in _LIKE_MOTORS and len(names) == len(COLOURS):
        motor_curves(axes, t, curves.values)
    else:
        _named_curves(axes, t, curves, names)
    _limit_lines(axes, curves.lower)
    _limit_lines(axes, curves.upper)
    if curves.limit.order > 0:
        axes.axhline(0.0, linewidth=0.0)  # zero at rest belongs to the scale of a rate


def _named_curves(axes: Axes, t: Array, curves: LimitCurves, names: Sequence[str]) -> None:
    """Draw the columns of a limit, and name those that come nearest to their bound where there are
    several."""
    others = LINE_COLOURS[len(COLOURS) :] if len(names) > 1 else (BLACK,)  # than those of motors
    room = np.minimum(curves.values - curves.lower, curves.upper - curves.values)
    nearest = room.min(axis=0).argsort()
    for k, colour, stroke in zip(nearest[:_NAMED], cycle(others), cycle(STROKES), strict=False):
        axes.plot(t, curves.values[:, k], color=colour, linestyle=stroke, label=names[k])
    axes.plot(t, curves.values[:, nearest[_NAMED:]], color=LIGHT_GREY, zorder=1)
    if len(names) > 1:
        axes.legend(fontsize=SMALL)
    axes.set_xlim(t[0], t[-1])
    without_box(axes)


def _switching(axes: Axes, extremal: Extremal) -> None:
    """Draw the switching functions: the derivative of H by each torque, times its limit.

    They are negative where the torque is at its upper limit and positive at the lower.
    """
    axes.axhline(0.0, color="black", linewidth=0.6, zorder=1)
    motor_curves(axes, extremal.t, extremal.switching)
    axes.set_ylabel(r"$\tau_{k,\mathrm{max}}\,\partial H/\partial\tau_k$")
    axes.set_xlabel(r"time $t$ (s)")


def _hamiltonian(axes: Axes, extremal: Extremal) -> None:
    """Draw how far the Hamiltonian is from its mean, and write the residual above."""
    H = extremal.hamiltonian
    away = np.maximum(np.abs(H - H.mean()), 1e-16)
    axes.semilogy(extremal.t, away, "-", color="black", linewidth=0.7)
    axes.set_ylim(1e-15, 1.0)
    axes.set_xlim(extremal.t[0], extremal.t[-1])
    axes.set_ylabel(r"$|H-\bar H|$")
    axes.set_xlabel(r"time $t$ (s)")
    axes.set_title(
        f"Pontryagin's condition: {extremal.residual:.0e};\nno motion near it is better",
        fontsize=8,
    )
    without_box(axes)


def _limit_lines(axes: Axes, bounds: Array) -> None:
    """Draw bounds: in black if all motors share them, otherwise in each motor's colour."""
    shared = len(set(bounds.tolist())) == 1
    style: dict[str, Any] = {"linewidth": 0.9, "linestyle": (0, (1, 1)), "zorder": 1}
    for colour, bound in zip(("black",) if shared else COLOURS, bounds.tolist(), strict=False):
        if np.isfinite(bound):
            named = any(line.get_label() == _LIMIT for line in axes.get_lines())
            axes.axhline(bound, color=colour, label="" if named else _LIMIT, **style)


def _path(axes: Axes, ends: Array, path: Array, ticks: Array, *, along: int) -> None:
    """Draw a path, (N, 3), m, in a plane of the base frame: y to the right, x or z upwards, mm.

    ``ends``: start and goal, (2, 3), m. ``along``: index of the upward axis, 0 or 2. ``ticks``:
    points of the path to mark, (n, 3), m.
    """
    ends = 1e3 * ends[:, [1, along]].T
    across, up = 1e3 * path[:, [1, along]].T
    axes.plot(*ends, ":", color=GREY, linewidth=0.9, label="straight line")
    axes.plot(across, up, "-", color="black", label="path, a dot each tenth of the time")
    axes.plot(*(1e3 * ticks[:, [1, along]].T), ".", color="black", markersize=5)
    axes.plot(*ends[:, 0], "o", color="black", markerfacecolor="white", ms=5, label="start")
    axes.plot(*ends[:, 1], "o", color="black", ms=5, label="goal")
    axes.set_xlabel("$y$ (mm)")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.12)
    without_box(axes)


def _legend(page: Figure, torques: Axes, path: Axes) -> None:
    """Draw one legend above all panels: a row for the motors, a row for the path."""
    motors, views = (axes.get_legend_handles_labels() for axes in (torques, path))
    handles, labels = (
        [entry for column in zip(*rows, strict=True) for entry in column]
        for rows in zip(motors, views, strict=True)
    )
    page.legend(handles, labels, loc="outside upper center", ncols=len(motors[0]))
