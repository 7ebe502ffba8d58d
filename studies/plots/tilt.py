"""On the way into the tilt of the platform: what motors and bars bear."""

from __future__ import annotations

from pathlib import Path

from deltaopt.plots.colours import BLUE, GREY, VERMILION
from deltaopt.plots.style import figure, without_box
from studies.tilt import DISTANCES, Tilt

MARKERS = "os^v"


def draw(found: Tilt, file: Path) -> None:
    """Draw torques and forces of bars over the distance, as multiples of those at its first."""
    with figure(file, 5.2, 3.3) as drawn:
        axes = drawn.subplots()
        for approach, marker in zip(found.approaches, MARKERS, strict=False):
            for values, colour, what in (
                (approach.forces, VERMILION, "bar"),
                (approach.torques, BLUE, "motor"),
            ):
                axes.plot(
                    DISTANCES,
                    values / values[0],
                    marker=marker,
                    markersize=3.2,
                    color=colour,
                    label=f"{what}, {approach.robot}",
                )
        axes.set(xscale="log", yscale="log", xlim=(DISTANCES[0] * 1.3, DISTANCES[-1] / 1.3))
        axes.set_xlabel("distance ε from tilting: volume of the parallelograms' normals")
        axes.set_ylabel(f"times that at ε = {DISTANCES[0]:g}, at rest")
        axes.set_title("Bars break where motors feel nothing: on the way to tilting, at rest")
        axes.text(0.98, 0.04, "tilts at ε = 0", color=GREY, ha="right", transform=axes.transAxes)
        axes.legend(loc="upper left")
        without_box(axes)
