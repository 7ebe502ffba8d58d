"""The studies of stability as charts."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.transforms import Transform

from deltaopt.plots.colours import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LIGHT_GREY,
    ORANGE,
    VERMILION,
)
from deltaopt.plots.style import SMALL, figure, without_box
from studies.models.measure import CHOSEN
from studies.plots.models import typeset
from studies.plots.work_precision import LINES, Line, panel
from studies.stability.benchmarks import Benchmark, Benchmarks
from studies.stability.drift import MINIMAL, Drift, baumgarte
from studies.stability.edge import TOLERANCE, Edge
from studies.stability.families import Family
from studies.stability.singularities import (
    DISTANCES,
    PROBLEMS,
    Problem,
    Singularities,
)

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
    x = np.where(np.array(DISTANCES) > 0, DISTANCES, AT_ZERO)
    floor = study.curve(family.name, problem.name, "state", "rounding").errors
    axes.fill_between(x, FLOOR, np.clip(floor, FLOOR, CEILING), color=LIGHT_GREY, linewidth=0)
    for look, (model, variant, _) in enumerate(CHOSEN):
        errors = study.curve(family.name, problem.name, model, variant).errors
        style = {**LINES[look], "markersize": 2.5, "linewidth": 1.1}
        axes.plot(x, np.clip(errors, FLOOR, CEILING), **style)
        silent = np.isnan(errors)
        at = np.full(silent.sum(), CEILING)
        axes.plot(x[silent], at, "x", color=style["color"], markersize=6)


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


def _singularity_legend() -> list[Line2D | Patch]:
    errors = [
        Line2D([], [], label=typeset(name), **{**LINES[look], "markersize": 3})
        for look, (*_, name) in enumerate(CHOSEN)
    ]
    return [
        *errors,
        Patch(color=LIGHT_GREY, label="rounding of the state alone"),
        Line2D([], [], color=GREY, marker="x", linestyle="none", label="no result"),
        Line2D([], [], color=BLACK, label="cond. of J"),
        Line2D([], [], color=BLUE, label="cond. of C, eq. (55)"),
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


LEAST_DRAWN = 1e-7
"""Changes of energy are drawn from here on, J."""


def draw_benchmarks(study: Benchmarks, path: Path) -> None:
    """Draw the largest change of energy of every way, a row each, and why there is none."""
    ways = list(dict.fromkeys((o.model, o.variant) for o in study.outcomes if o.model != "K, Kane"))
    with figure(path, max(5.0, 2.6 * len(study.benchmarks) + 1.4), 3.9) as page:
        panels = page.subplots(1, len(study.benchmarks), sharey=True, squeeze=False)[0]
        for axes, benchmark in zip(panels, study.benchmarks, strict=True):
            _energies(axes, study, benchmark, ways)
        names = [f"{typeset(model)}, {variant}" for model, variant in ways]
        panels[0].set_yticks(range(len(ways)), names)
        panels[0].set_ylim(len(ways) - 0.5, -0.5)
        handles = [
            Line2D([], [], color=GREEN, marker="o", linestyle="none", label="within the bound"),
            Line2D([], [], color=VERMILION, marker="o", linestyle="none", label="beyond it"),
            Line2D([], [], color=VERMILION, marker="x", linestyle="none", label="stops on the way"),
            Line2D([], [], color=GREY, marker="_", linestyle="none", label="cannot be built"),
        ]
        page.legend(handles=handles, loc="outside lower center", ncols=4)


def _energies(
    axes: Axes, study: Benchmarks, benchmark: Benchmark, ways: Sequence[tuple[str, str]]
) -> None:
    axes.set(xscale="log", xlim=(LEAST_DRAWN, 1e1), title=benchmark.title)
    axes.set_xlabel("largest change of energy, J")
    axes.axvline(benchmark.bound, color=BLACK, linestyle=":")
    without_box(axes)
    for o in study.of(benchmark.name):
        if (o.model, o.variant) not in ways:
            continue
        row = ways.index((o.model, o.variant))
        if o.times.size:
            colour = VERMILION if o.failure else GREEN
            axes.plot(np.clip(o.largest, LEAST_DRAWN, 1e1), row, "o", color=colour, markersize=5)
        else:
            built = "cannot be built" not in o.failure
            marker, colour = ("x", VERMILION) if built else ("_", GREY)
            axes.plot([0.97], [row], marker, color=colour, markersize=6, transform=_rows(axes))


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
