"""A chart of the comparison of plans: what accuracy costs, and where the time goes."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from deltaopt.compare.plans.report import FORMULATIONS, compiled_modes, uniform
from deltaopt.compare.plans.study import PlanStudy, Row
from deltaopt.plots.colours import BLACK, BLUE, ORANGE, VERMILION
from deltaopt.plots.style import figure, plain_numbers, without_box

COLOURS = {"flat": BLACK, "forward": ORANGE, "explicit": BLUE, "multiplier": VERMILION}
"""Colours of the formulations."""
MARKERS = {
    "": "o",
    "constraints at knots": "s",
    "projection at knots": "^",
    "Baumgarte": "v",
    "acceleration level": "D",
}
DASHES: dict[int, Any] = {1: "-", 2: (0, (3, 2))}
FLOOR = 1e-16
"""Smallest error drawn: those below are drawn there."""

Measure = Callable[[Row], float]
PANELS: tuple[tuple[str, Measure], ...] = (
    ("kinematic error $E_K$ (m, m/s)", lambda row: row.quality.kinematic_error),
    ("dynamic error $E_D$ (m/s², rad/s²)", lambda row: row.quality.dynamic_error),
    ("arrival error (m)", lambda row: row.quality.arrival_distance),
)


def draw(study: PlanStudy, case: str, path: Path) -> None:
    """Draw one case and save the chart as PNG: gap against time in each mode, where time goes,
    errors against time."""
    modes = compiled_modes(study)
    rows = [row for row in study.rows if row.case == case]
    with figure(path, 10.0, 6.6) as page:
        grid = page.subplots(2, 3)
        for axes, mode in zip(grid[0, :2], [False, modes[-1]], strict=True):
            name = "compiled" if mode else "interpreted"
            _curves(axes, [row for row in rows if row.compiled == mode], lambda row: row.gap)
            axes.set_title(f"{case.replace('_', ' ')}: functions {name}")
            axes.set_ylabel("gap of the safe duration")
        _shares(grid[0, 2], study, case, modes)
        for axes, (label, measure) in zip(grid[1], PANELS, strict=True):
            _curves(axes, [row for row in rows if row.compiled == modes[-1]], measure)
            axes.set_ylabel(label)
        for axes in page.axes:
            without_box(axes)
        page.legend(handles=_legend(), loc="outside lower center", ncols=6)


def _curves(axes: Axes, rows: list[Row], measure: Measure) -> None:
    """Draw a line for each method over its meshes, and failures as crosses at the upper edge."""
    axes.set(xscale="log", yscale="log", xlabel="wall time of the solve (s)")
    plain_numbers(axes.xaxis, (1, 3))
    for method in dict.fromkeys(row.method for row in rows):
        own = [row for row in rows if row.method == method]
        good = [row for row in own if not row.failure and isfinite(measure(row))]
        colour = COLOURS[method.formulation]
        axes.plot(
            [row.seconds for row in good],
            [max(measure(row), FLOOR) for row in good],
            color=colour,
            marker=MARKERS[method.closure],
            markersize=4,
            markerfacecolor=colour if method.transcription.degree == 1 else "none",
            linestyle=DASHES[method.transcription.degree],
            linewidth=0.9,
        )
        for row in own:
            if row.failure:
                axes.plot(
                    row.seconds,
                    0.97,
                    "x",
                    color=colour,
                    markersize=8,
                    markeredgewidth=2,
                    transform=axes.get_xaxis_transform(),
                )


def _shares(axes: Axes, study: PlanStudy, case: str, modes: list[bool]) -> None:
    """Draw the time of functions and of linear algebra per iteration and interval, on the finest
    uniform mesh."""
    places = np.arange(len(FORMULATIONS))
    width = 0.8 / len(modes)
    for i, mode in enumerate(modes):
        rows = [uniform(study, case, formulation, mode) for formulation in FORMULATIONS]
        for place, formulation, row in zip(places, FORMULATIONS, rows, strict=True):
            if row is None:
                continue
            unit = 1e6 / (row.iterations * row.intervals)
            x = place + (i - (len(modes) - 1) / 2) * width
            functions, algebra = (
                row.evaluation_seconds * unit,
                (row.seconds - row.evaluation_seconds) * unit,
            )
            axes.bar(x, functions, 0.9 * width, color=COLOURS[formulation])
            axes.bar(
                x, algebra, 0.9 * width, bottom=functions, color=COLOURS[formulation], alpha=0.35
            )
            axes.text(x, functions + algebra, "ic"[i], ha="center", va="bottom", fontsize=8)
    axes.set_xticks(places, FORMULATIONS)
    axes.set_ylabel("µs per iteration and interval")
    axes.set_title("functions (dark) and algebra (light),\ninterpreted (i) and compiled (c)")
    axes.grid(axis="x", visible=False)


def _legend() -> list[Line2D | Patch]:
    formulations = [
        Patch(color=colour, label=formulation) for formulation, colour in COLOURS.items()
    ]
    closures = [
        Line2D([], [], color="0.4", marker=marker, linestyle="none", label=name or "none needed")
        for name, marker in MARKERS.items()
    ]
    degrees = [
        Line2D([], [], color="0.4", linestyle=dash, label=f"acceleration of degree {degree}")
        for degree, dash in DASHES.items()
    ]
    failed = Line2D([], [], color="0.4", marker="x", linestyle="none", label="failed")
    return [*formulations, *closures, *degrees, failed]
