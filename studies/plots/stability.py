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
from deltaopt.plots.style import SMALL, figure, plain_numbers, without_box
from studies.stability.benchmarks import Benchmark, Benchmarks
from studies.stability.drift import (
    FREQUENCIES,
    MINIMAL,
    TOLERANCES,
    Drift,
    Run,
    baumgarte,
)
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
        page.legend(handles=_singularity_legend(), loc="outside lower center", ncols=4)


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


METHOD_COLOURS = {
    "none": BLACK,
    "projection": VERMILION,
    MINIMAL: GREEN,
    **{
        baumgarte(w): colour
        for w, colour in zip(
            FREQUENCIES,
            ("#c6dbef", "#9ecae1", "#6baed6", "#4292c6", "#2171b5", "#084594"),
            strict=True,
        )
    },
}
MARKERS = dict(zip(TOLERANCES, ("o", "s", "^"), strict=True))


def draw_drift(study: Drift, path: Path) -> None:
    """Draw drift and energy against time spent, and over Baumgarte's frequency."""
    with figure(path, 7.2, 6.0) as page:
        (position, energy), (over, over_energy) = page.subplots(2, 2)
        for axes in (position, energy):
            axes.set(xscale="log", yscale="log", xlabel="time spent, s")
            plain_numbers(axes.xaxis)
        position.set(ylabel="largest |f|, m", title=f"Drift over {study.duration:g} s")
        energy.set(ylabel="largest change of energy, J", title="Energy")
        for method, colour in METHOD_COLOURS.items():
            runs = study.by(method)
            for axes, name in ((position, "position"), (energy, "energy")):
                axes.plot(
                    [r.seconds for r in runs],
                    [getattr(r, name) for r in runs],
                    color=colour,
                    linewidth=1,
                )
                for r in runs:
                    axes.plot(r.seconds, getattr(r, name), MARKERS[r.tolerance], color=colour)
        _over_frequency(over, study, "position", "largest |f|, m")
        _over_frequency(over_energy, study, "energy", "largest change of energy, J")
        for axes in (position, energy, over, over_energy):
            without_box(axes)
        page.legend(handles=_drift_legend(), loc="outside lower center", ncols=4)


def _over_frequency(axes: Axes, study: Drift, name: str, label: str) -> None:
    axes.set(xscale="log", yscale="log", xlabel="Baumgarte's ω, rad/s", ylabel=label)
    for tolerance, marker in MARKERS.items():
        runs: list[Run] = [study.run(baumgarte(w), tolerance) for w in FREQUENCIES]
        axes.plot(FREQUENCIES, [getattr(r, name) for r in runs], f"{marker}-", color=BLUE)
        for method in ("none", "projection", MINIMAL):
            level = getattr(study.run(method, tolerance), name)
            axes.axhline(level, color=METHOD_COLOURS[method], linestyle=":", linewidth=1)


def _drift_legend() -> list[Line2D]:
    methods = [Line2D([], [], color=c, label=_frequency(m)) for m, c in METHOD_COLOURS.items()]
    markers = [
        Line2D([], [], color=GREY, marker=m, linestyle="none", label=f"tolerance {t:.0e}")
        for t, m in MARKERS.items()
    ]
    return [*methods, *markers]


def _frequency(method: str) -> str:
    return method.replace("Baumgarte ", "Baumgarte ω = ")


def draw_benchmarks(study: Benchmarks, path: Path) -> None:
    """Draw energy over time where there is a motion, and name the methods without one."""
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
    missing = []
    for o in study.of(benchmark.name):
        if o.model not in STYLES:
            continue
        if o.times.size:
            error = np.clip(np.abs(o.energy_error), 1e-12, 1e3)
            style = STYLES[o.model]
            axes.plot(o.times, error, style, color=COLOURS[o.variant], linewidth=0.9)
        else:
            missing.append(f"{o.model}, {o.variant}")
    outcomes = study.of(benchmark.name)
    inside = sum(not o.failure for o in outcomes)
    note = f"{inside} of {len(outcomes)} inside the bound"
    axes.text(0.98, 0.02, note, transform=axes.transAxes, ha="right", va="bottom")
    if missing:
        axes.text(
            0.98,
            0.98,
            "no motion: " + "\n".join(missing),
            transform=axes.transAxes,
            ha="right",
            va="top",
            fontsize=SMALL,
        )


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
