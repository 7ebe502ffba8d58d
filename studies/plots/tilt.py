"""On the way into the tilt of the platform: what motors and bars bear."""

from __future__ import annotations

from pathlib import Path

from deltaopt.plots.style import figure
from studies.plots.work_precision import Line, panel
from studies.tilt import DISTANCES, Tilt

DRAWN = 2
"""Robots: the others' lines lie on theirs, and a panel has five lines at most."""


def draw(found: Tilt, file: Path) -> None:
    """Draw torques and forces of bars over the distance, as multiples of those at its first."""
    approaches = found.approaches[:DRAWN]
    lines = [
        Line(f"{what}, {a.robot}", DISTANCES.tolist(), (values / values[0]).tolist(), 2 * k + i)
        for k, what in enumerate(("largest force of a bar", "largest motor torque"))
        for i, a in enumerate(approaches)
        for values in ((a.forces, a.torques)[k],)
    ]
    with figure(file, 5.2, 3.3) as drawn:
        axes = drawn.subplots()
        panel(
            axes,
            lines,
            title="Towards the tilt of the platform bars bear ever more; motors do not feel it",
            x="distance ε from tilting (0: the platform tilts)",
            y=f"times that at ε = {DISTANCES[0]:g}, at rest",
        )
        axes.invert_xaxis()
        axes.legend(loc="upper left")
