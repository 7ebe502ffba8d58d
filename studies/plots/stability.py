"""The studies of stability as charts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.transforms import Transform

from deltaopt.plots.colours import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY_BLUE,
    VERMILION,
)
from deltaopt.plots.style import SMALL, figure, without_box
from studies.plots.work_precision import Line, panel
from studies.stability.benchmarks import Benchmark, Benchmarks
from studies.stability.drift import MINIMAL, Drift, baumgarte
from studies.stability.edge import TOLERANCE, Edge
from studies.stability.families import Family
from studies.stability.singularities import (
    DISTANCES,
    PROBLEMS,
    Curve,
    Problem,
    Singularities,
)

COLOURS = {
    "closed form": BLUE,
    "partition": GREEN,
    "partition there": SKY_BLUE,
    "null space": PURPLE,
    "rank revealing": GREY,
    "sparse QR": ORANGE,
    "LAPACK LU": VERMILION,
    "least norm": BLACK,
}
"""By constraint matrix of K and L_E, then by solver of L_I."""
NAMES = {
    "partition": "C: partition, fixed",
    "partition there": "C: partition, chosen there",
    "closed form": "C: closed form",
    "null space": "C: null space",
    "rank revealing": "C: rank revealing",
    "sparse QR": "$L_I$, sparse QR",
    "LAPACK LU": "$L_I$, LAPACK LU",
    "least norm": "$L_I$, least norm",
}
STYLES = {"L_E": "-", "K, virtual work": "--", "L_I": "-", "state": ":"}
CONDITIONS = {"J": BLACK, "C in closed form": BLUE, "L_I, inverse": VERMILION}
FORWARD = "L_I, forward"
FLOOR, CEILING = 1e-17, 1e3
"""Errors are drawn between these."""
AT_ZERO = 1e-15
"""Where ε = 0 is drawn."""


def draw_delta_singularities(study: Singularities, path: Path) -> None:
    """Draw errors and condition numbers towards the singularities of the Delta."""
    draw_singularities(study, [f for f in study.families if f.mechanism.name == "delta"], path)


def draw_pendulum_singularities(study: Singularities, path: Path) -> None:
    """Draw the same for the paper's pendulum."""
    draw_singularities(study, [f for f in study.families if f.mechanism.name != "delta"], path)


def draw_singularities(study: Singularities, columns: Sequence[Family], path: Path) -> None:
    """Draw errors and condition numbers of some families, one column each."""
    with figure(path, max(7.2, 2.3 * len(columns) + 0.8), 9.0) as page:
        panels = page.subplots(4, len(columns), sharex=True, sharey="row")
        for column, family in enumerate(columns):
            panels[0, column].set_title(family.title)
            for row, problem in enumerate(PROBLEMS):
                _error_panel(panels[row, column], study, family, problem)
            _condition_panel(panels[3, column], study, family)
            panels[3, column].set_xlabel("distance ε from the singularity")
        for row, problem in enumerate(PROBLEMS):
            panels[row, 0].set_ylabel(f"{problem.title}:\nrelative error")
        panels[3, 0].set_ylabel("condition number")
        page.legend(handles=_singularity_legend(), loc="outside lower center", ncols=3)


def _error_panel(axes: Axes, study: Singularities, family: Family, problem: Problem) -> None:
    _distance_axis(axes)
    axes.set(yscale="log", ylim=(FLOOR / 2, 3 * CEILING))
    key = (family.name, problem.name)
    for curve in [*study.curves, *study.floors]:
        if (curve.family, curve.problem) == key and curve.model in STYLES:
            _curve(axes, curve)


def _curve(axes: Axes, curve: Curve) -> None:
    colour = COLOURS.get(curve.variant, BLACK)
    x = np.where(np.array(DISTANCES) > 0, DISTANCES, AT_ZERO)
    y = np.clip(curve.errors, FLOOR, CEILING)
    axes.plot(x, y, STYLES[curve.model], color=colour, marker=".", markersize=4, linewidth=1.2)
    silent = np.isnan(curve.errors)
    axes.plot(x[silent], np.full(silent.sum(), CEILING), "x", color=colour, markersize=6)


def _condition_panel(axes: Axes, study: Singularities, family: Family) -> None:
    _distance_axis(axes)
    axes.set(yscale="log", ylim=(0.5, 1e20))
    x = np.where(np.array(DISTANCES) > 0, DISTANCES, AT_ZERO)
    for c in study.conditions:
        if c.family == family.name:
            colour, style = (
                CONDITIONS.get(c.matrix, VERMILION),
                "--" if c.matrix == FORWARD else "-",
            )
            axes.plot(x, np.clip(c.numbers, 0.5, 1e19), style, color=colour, linewidth=1.2)


def _distance_axis(axes: Axes) -> None:
    ticks = [1e-2, 1e-5, 1e-8, 1e-11, AT_ZERO]
    axes.set_xscale("log")
    axes.set_xlim(0.3, AT_ZERO / 3)
    axes.set_xticks(ticks, ["10⁻²", "10⁻⁵", "10⁻⁸", "10⁻¹¹", "0"])
    axes.set_xticks([], minor=True)
    without_box(axes)


def _singularity_legend() -> list[Line2D]:
    variants = ("closed form", "partition", "partition there", "null space")
    solvers = ("sparse QR", "LAPACK LU")
    return [
        *(Line2D([], [], color=COLOURS[v], label=NAMES[v]) for v in (*variants, *solvers)),
        Line2D([], [], color=GREY, label="$L_E$ (with any C)"),
        Line2D([], [], color=GREY, linestyle="--", label="K (Kane = virtual work)"),
        Line2D([], [], color=BLACK, linestyle=":", label="rounding of the state alone"),
        Line2D([], [], color=GREY, marker="x", linestyle="none", label="no result"),
        Line2D([], [], color=BLACK, label="cond. of J"),
        Line2D([], [], color=BLUE, label="cond. of C in closed form"),
        Line2D([], [], color=VERMILION, label="cond. of $L_I$, torques"),
        Line2D([], [], color=VERMILION, linestyle="--", label="cond. of $L_I$, accelerations"),
    ]


DRAWN = ("none", baumgarte(10.0), baumgarte(300.0), "projection", MINIMAL)
"""Of the stabilisations: five lines a panel; the table has all frequencies."""


def draw_drift(study: Drift, path: Path) -> None:
    """Draw drift and change of energy against right-hand sides, tolerances from coarse to fine."""
    with figure(path, 7.4, 3.3) as drawn:
        for axes, (name, label, title) in zip(
            drawn.subplots(1, 2),
            (
                ("position", "largest |f|, m", "drift off the constraints"),
                ("energy", "largest change of energy, J", "energy"),
            ),
            strict=True,
        ):
            lines = [_drift_line(study, method, name, look) for look, method in enumerate(DRAWN)]
            whole = f"{title} over {study.duration:g} s"
            panel(axes, lines, title=whole, x="right-hand sides", y=label)
        handles, labels = axes.get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside lower center", ncols=5, columnspacing=1.2)


def _drift_line(study: Drift, method: str, name: str, look: int) -> Line:
    runs = [r for r in study.by(method) if np.isfinite(r.evaluations)]
    label = method.replace("/s", " rad/s")
    return Line(label, [r.evaluations for r in runs], [getattr(r, name) for r in runs], look)


def draw_benchmarks(study: Benchmarks, path: Path) -> None:
    """Draw energy over time where there is a motion, and count the methods without one."""
    with figure(path, max(4.5, 2.7 * len(study.benchmarks)), 4.4) as page:
        panels = page.subplots(1, len(study.benchmarks), sharey=True, squeeze=False)[0]
        for axes, benchmark in zip(panels, study.benchmarks, strict=True):
            _energy_panel(axes, study, benchmark)
        panels[0].set_ylabel("|change of energy|, J")
        models = [
            Line2D([], [], color=GREY, label="$L_E$ (with any C)"),
            Line2D([], [], color=GREY, linestyle="--", label="K (Kane = virtual work)"),
        ]
        shown = [
            Line2D([], [], color=colour, label=NAMES[variant])
            for variant, colour in COLOURS.items()
            if any(o.variant == variant for o in study.outcomes)
        ]
        page.legend(handles=[*shown, *models], loc="outside lower center", ncols=5)


def _energy_panel(axes: Axes, study: Benchmarks, benchmark: Benchmark) -> None:
    axes.set(yscale="log", xlabel="time, s", ylim=(1e-12, 1e3), title=benchmark.title)
    axes.axhline(benchmark.bound, color=BLACK, linestyle=":")
    axes.text(0.02, 1.5 * benchmark.bound, f"bound {benchmark.bound:g} J")
    without_box(axes)
    missing = 0
    for o in study.of(benchmark.name):
        if o.model not in STYLES:
            continue
        if o.times.size:
            error = np.clip(np.abs(o.energy_error), 1e-12, 1e3)
            style = STYLES[o.model]
            axes.plot(o.times, error, style, color=COLOURS[o.variant], linewidth=0.9)
        else:
            missing += 1
    outcomes = study.of(benchmark.name)
    inside = sum(not o.failure for o in outcomes)
    note = f"{inside} of {len(outcomes)} inside the bound"
    axes.text(0.98, 0.02, note, transform=axes.transAxes, ha="right", va="bottom")
    if missing:
        told = f"no motion by {missing} ways: see the table"
        axes.text(0.98, 0.98, told, transform=axes.transAxes, ha="right", va="top", fontsize=SMALL)


GOOD, REFUSED, WRONG = GREEN, ORANGE, VERMILION


def draw_edge(study: Edge, path: Path) -> None:
    """Draw the time spent on every scene and the gap of its plan, or the error it ends in."""
    with figure(path, 7.2, 0.15 * len(study.outcomes) + 1.2) as page:
        spent, gaps = page.subplots(1, 2, sharey=True)
        for row, o in enumerate(study.outcomes):
            colour = REFUSED if o.error else GOOD if o.verified else WRONG
            spent.plot(o.seconds, row, "o", color=colour)
            if o.error:
                gaps.text(
                    0.05,
                    row,
                    o.error,
                    color=colour,
                    va="center",
                    fontsize=SMALL,
                    transform=_rows(gaps),
                )
            else:
                gaps.plot(o.gap, row, "o", color=colour)
        names = [f"{o.family}: {o.name}" for o in study.outcomes]
        spent.set_yticks(range(len(names)), names, fontsize=SMALL)
        spent.set(xscale="log", xlabel="time spent, s", ylim=(len(names) - 0.5, -0.5))
        gaps.set(xscale="log", xlim=(1e-4, 2), xlabel="gap to the shortest duration, as estimated")
        gaps.axvline(TOLERANCE, color=BLACK, linestyle=":")
        for axes in (spent, gaps):
            without_box(axes)
        labels = {
            GOOD: "verified plan",
            REFUSED: "error that names the cause",
            WRONG: "plan that fails verification",
        }
        handles = [
            Line2D([], [], color=c, marker="o", linestyle="none", label=label)
            for c, label in labels.items()
        ]
        page.legend(handles=handles, loc="outside lower center", ncols=3)


def _rows(axes: Axes) -> Transform:
    """Fractions of the width, rows of the data."""
    return axes.get_yaxis_transform()
