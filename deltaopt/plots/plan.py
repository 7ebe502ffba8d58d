"""A plan on one page: torques against their limits, motor speeds, and the path.

Where the motion meets Pontryagin's condition, below them: what each motor's torque is worth,
and how constant the Hamiltonian is.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from deltaopt.files.validated_record import Vector3
from deltaopt.motion.trajectory import Array, Trajectory
from deltaopt.plots.style import COLOURS, GREY, figure, motor_curves, without_box
from deltaopt.scene.scene import Scene
from deltaopt.verify.pontryagin import Extremal

_TICKS = 10  # along the path, at equal times
_SAMPLES = 2000  # over all intervals


def draw(
    file: Path, scene: Scene, trajectory: Trajectory, extremal: Extremal | None = None
) -> None:
    """Draw a motion that solves a scene, and its switching functions if they are given."""
    steps = max(2, _SAMPLES // (len(trajectory.knots) - 1))
    motion = trajectory.inside_intervals(np.linspace(0, 1, steps))  # both sides of each knot
    begin, end = trajectory.knots[[0, -1]]
    ticks = trajectory(np.linspace(begin, end, _TICKS + 1)[1:-1]).x
    rows = 2 if extremal is None else 3
    with figure(file, 7.0, 2.05 * rows) as page:
        grid = page.add_gridspec(rows, 2, width_ratios=[1.7, 1])
        torques = page.add_subplot(grid[0, 0])
        torques.set_ylabel(r"torque $\tau_k$ (N·m)")
        motor_curves(torques, motion.t, motion.tau)
        _limit_lines(torques, scene.robot.torque_limits)
        speeds = page.add_subplot(grid[1, 0], sharex=torques)
        speeds.set_ylabel(r"motor speed $\dot\theta_k$ (rad/s)")
        speeds.set_xlabel(r"time $t$ (s)")
        motor_curves(speeds, motion.t, motion.dtheta)
        _limit_lines(speeds, scene.robot.speed_limits)
        side = page.add_subplot(grid[0, 1])
        side.set_ylabel("$x$ (mm), down")
        _path(side, scene, motion.x, ticks, along=0)
        side.invert_yaxis()
        above = page.add_subplot(grid[1, 1])
        above.set_ylabel("$z$ (mm)")
        _path(above, scene, motion.x, ticks, along=2)
        if extremal is not None:
            switching = page.add_subplot(grid[2, 0], sharex=torques)
            _switching(switching, extremal)
            _hamiltonian(page.add_subplot(grid[2, 1]), extremal)
        _legend(page, torques, side)


def _switching(axes: Axes, extremal: Extremal) -> None:
    """What more torque would cost; negative at the upper limit, positive at the lower."""
    axes.axhline(0.0, color="black", linewidth=0.6, zorder=1)
    motor_curves(axes, extremal.t, extremal.switching)
    axes.set_ylabel(r"$\tau_{k,\mathrm{max}}\,\partial H/\partial\tau_k$")
    axes.set_xlabel(r"time $t$ (s)")


def _hamiltonian(axes: Axes, extremal: Extremal) -> None:
    """How far H is from its mean, and the residual in words."""
    H = extremal.hamiltonian
    away = np.maximum(np.abs(H - H.mean()), 1e-16)
    axes.semilogy(extremal.t, away, "-", color="black", linewidth=0.7)
    axes.set_ylim(1e-15, 1.0)
    axes.set_xlim(extremal.t[0], extremal.t[-1])
    axes.set_ylabel(r"$|H-\bar H|$")
    axes.set_xlabel(r"time $t$ (s)")
    axes.set_title(
        f"Pontryagin's condition is met to {extremal.residual:.0e}:\n"
        "no motion near it is better, others may be",
        fontsize=8,
    )
    without_box(axes)


def _limit_lines(axes: Axes, limits: Vector3 | None) -> None:
    """Limits of both signs: black where the motors share them, else in each motor's colour."""
    if limits is None:
        return
    colours = ("black",) if len(set(limits)) == 1 else COLOURS
    style: dict[str, Any] = {"linewidth": 0.9, "linestyle": (0, (1, 1)), "zorder": 1}
    for colour, limit in zip(colours, limits, strict=False):
        axes.axhline(-limit, color=colour, **style)
        axes.axhline(limit, color=colour, **style, label="limit" if colour is colours[0] else "")


def _path(axes: Axes, scene: Scene, path: Array, ticks: Array, *, along: int) -> None:
    """The path (N, 3), m, seen along a base axis: y to the right, x or z (``along``) up; mm."""
    ends = 1e3 * np.array([scene.start, scene.goal])[:, [1, along]].T
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
    """All explanations above the panels: a row for the motors, a row for the path."""
    motors, views = (axes.get_legend_handles_labels() for axes in (torques, path))
    handles, labels = (
        [entry for column in zip(*rows, strict=True) for entry in column]
        for rows in zip(motors, views, strict=True)
    )
    page.legend(handles, labels, loc="outside upper center", ncols=len(motors[0]))
