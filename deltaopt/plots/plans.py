"""A chart of the comparison of plans: what accuracy costs, and where the time goes.

A line for the best method of each formulation: more would hide each other. The tables and the CSV
file have all.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, sqrt
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from deltaopt.compare.plans.report import FORMULATIONS, compiled_modes, uniform
from deltaopt.compare.plans.study import Method, PlanStudy, Row
from deltaopt.plots.colours import BLACK, BLUE, ORANGE, VERMILION
from deltaopt.plots.style import figure, plain_numbers, without_box

COLOURS = {"flat": BLACK, "forward": ORANGE, "explicit": BLUE, "multiplier": VERMILION}
"""Colours of the formulations."""
MARKERS = {"flat": "o", "forward": "^", "explicit": "s", "multiplier": "D"}
"""And their markers, in print without colour."""
KEPT = ("", "constraints at knots", "projection at knots")
"""Closures that keep the loops closed at the knots: others are refused by verification, whatever
their gap."""
FLOOR = 1e-16
"""Smallest error drawn: those below are drawn there."""

Measure = Callable[[Row], float]
PANELS: tuple[tuple[str, Measure], ...] = (
    ("gap of the safe duration", lambda row: row.gap),
    ("dynamic error $E_D$ (m/s², rad/s²)", lambda row: row.quality.dynamic_error),
    ("arrival error (m)", lambda row: row.quality.arrival_distance),
)


def draw(study: PlanStudy, case: str, path: Path) -> None:
    """Draw one case and save the chart as PNG: gap and errors against time of the best method of
    each formulation, in machine code if it was, and where time goes."""
    modes = compiled_modes(study)
    rows = [row for row in study.rows if row.case == case and row.compiled == modes[-1]]
    best = best_of_each(rows)
    with figure(path, 7.4, 6.4) as page:
        grid = page.subplots(2, 2)
        for axes, (label, measure) in zip(grid.ravel()[:3], PANELS, strict=True):
            _curves(axes, [row for row in rows if row.method in best], measure)
            axes.set_ylabel(label)
        grid[0, 0].set_title(f"{case.replace('_', ' ')}: the best of each formulation")
        _shares(grid[1, 1], study, case, modes)
        for axes in page.axes:
            without_box(axes)
        page.legend(handles=_legend(best), loc="outside lower center", ncols=2)


def best_of_each(rows: list[Row]) -> list[Method]:
    """Of each formulation the method that comes nearest to the reference on any mesh without drift,
    in the order of ``FORMULATIONS``; of equals the quicker one."""
    found = []
    for formulation in FORMULATIONS:
        own = [row for row in rows if row.method.formulation == formulation and not row.failure]
        kept = [row for row in own if row.method.closure in KEPT]
        if kept:
            found.append(min(kept, key=lambda row: (row.gap, row.seconds)).method)
    return found


def _curves(axes: Axes, rows: list[Row], measure: Measure) -> None:
    """Draw a line for each method over its meshes, and failures as crosses at the upper edge."""
    axes.set(xscale="log", yscale="log", xlabel="wall time of the solve (s)")
    plain_numbers(axes.xaxis, (1, 3))
    seconds = [row.seconds for row in rows]
    middle = sqrt(min(seconds) * max(seconds))  # a decade at least, for the axis to have numbers
    axes.set_xlim(min(middle / 4, 0.8 * min(seconds)), max(4 * middle, 1.25 * max(seconds)))
    for method in dict.fromkeys(row.method for row in rows):
        own = [row for row in rows if row.method == method]
        good = [row for row in own if not row.failure and isfinite(measure(row))]
        colour, marker = COLOURS[method.formulation], MARKERS[method.formulation]
        axes.plot(
            [row.seconds for row in good],
            [max(measure(row), FLOOR) for row in good],
            color=colour,
            marker=marker,
            markersize=3.5,
            linewidth=1.1,
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


def _legend(best: list[Method]) -> list[Line2D]:
    lines = [
        Line2D([], [], color=COLOURS[m.formulation], marker=MARKERS[m.formulation], label=str(m))
        for m in best
    ]
    failed = Line2D([], [], color="0.4", marker="x", linestyle="none", label="failed")
    return [*lines, failed]
