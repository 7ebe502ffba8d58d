"""Charts as the paper's Figs. 4 and 5: a prescribed motion, and the torques it takes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from deltaopt.motion.trajectory import Trajectory
from deltaopt.plots.colours import COLOURS
from deltaopt.plots.style import figure, motor_curves

_SAMPLES = 1001
"""Instants, close enough together for a smooth line of a motion without jumps."""


def draw_motion(file: Path, trajectory: Trajectory) -> None:
    """Draw displacement, velocity and acceleration of the platform over time, as Fig. 4."""
    motion = trajectory(trajectory.instants(_SAMPLES))
    rows = (
        ("displacement (m)", motion.x - motion.x[0]),
        ("velocity (m/s)", motion.v),
        ("acceleration (m/s²)", motion.a),
    )
    with figure(file, 3.5, 5.0) as page:
        way, speed = rows[0][1], np.linalg.norm(motion.v, axis=1)
        page.suptitle(
            f"{1e3 * np.linalg.norm(way[-1]):.0f} mm in {motion.t[-1] - motion.t[0]:.3g} s, "
            f"{speed.max():.2g} m/s at most"
        )
        panels = page.subplots(3, 1, sharex=True)
        for panel, (label, values) in zip(panels, rows, strict=True):
            motor_curves(panel, motion.t, values)
            for line, axis in zip(panel.get_lines(), "xyz", strict=True):
                line.set_label(f"${axis}$")
            panel.set_ylabel(label)
        page.align_ylabels(panels)
        panels[-1].set_xlabel(r"time $t$ (s)")
        page.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)


def draw_torques(file: Path, trajectory: Trajectory) -> None:
    """Draw motor torques over time, as Fig. 5, and those that hold the platform at rest there."""
    motion = trajectory(trajectory.instants(_SAMPLES))
    rest = np.zeros_like(motion.x)
    holding = trajectory.model.inverse_dynamics(motion.x, rest, rest)
    with figure(file, 3.5, 2.9) as page:
        most, least = np.abs(motion.tau).max(), np.abs(holding).max()
        page.suptitle(f"up to {most:.3g} N·m, to hold it still up to {least:.3g}")
        axes = page.subplots()
        motor_curves(axes, motion.t, motion.tau)
        for k, colour in enumerate(COLOURS):
            label = "at rest" if k == 0 else ""
            axes.plot(motion.t, holding[:, k], ":", color=colour, linewidth=0.9, label=label)
        axes.set_xlabel(r"time $t$ (s)")
        axes.set_ylabel(r"torque $\tau_k$ (N·m)")
        page.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2)
