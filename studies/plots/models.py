"""Which model of the Delta, when: errors towards two singularities above, costs below."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from deltaopt.plots.colours import GREY, LIGHT_GREY
from deltaopt.plots.style import figure, without_box
from studies.models.measure import CHOSEN, FAMILIES, TASKS, Models
from studies.plots.work_precision import LINES

FLOOR, CEILING = 1e-17, 1e2
"""Errors are drawn between these."""
DRAWN = ("stretched", "coplanar")
"""A serial singularity and a parallel one."""
NAMES = tuple(name for *_, name in CHOSEN)


def draw(found: Models, file: Path) -> None:
    """Draw errors over the distance and costs, torques on the left, accelerations on the right."""
    with figure(file, 7.4, 7.0) as drawn:
        panels = drawn.subplots(3, 2, sharex="row", sharey="row", height_ratios=(3, 3, 2.2))
        for column, (task, what) in enumerate(TASKS.items()):
            for row, family in enumerate(DRAWN):
                _errors(panels[row, column], found, family, task)
                panels[row, column].set_title(f"{what}, towards {FAMILIES[family]}")
            _costs(panels[2, column], found, task)
            panels[2, column].set_title(f"cost of {what}: • compiled, ○ interpreted; operations")
            panels[1, column].set_xlabel("distance ε from the singularity")
        for row in range(2):
            panels[row, 0].set_ylabel("relative error")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside lower center", ncols=3)


def _errors(axes: Axes, found: Models, family: str, task: str) -> None:
    axes.set(xscale="log", yscale="log", ylim=(FLOOR, 3 * CEILING))
    axes.set_xlim(0.2, found.distances[-1] / 2)
    for look, name in enumerate(NAMES):
        errors = found.errors[family, task, name]
        style = {**LINES[look], "markersize": 3}
        axes.plot(found.distances, np.clip(errors, FLOOR, CEILING), label=typeset(name), **style)
        silent = np.isnan(errors)
        axes.plot(
            found.distances[silent],
            np.full(silent.sum(), CEILING),
            "x",
            color=style["color"],
            markersize=6,
        )
    floor = found.floors[family, task]
    axes.fill_between(
        found.distances,
        FLOOR,
        floor,
        color=LIGHT_GREY,
        alpha=0.6,
        linewidth=0,
        label="rounding of the state",
    )
    without_box(axes)


def _costs(axes: Axes, found: Models, task: str) -> None:
    for look, name in enumerate(NAMES):
        cost, colour = found.costs[task, name], LINES[look]["color"]
        axes.plot([cost.compiled, cost.interpreted], [look, look], color=colour, linewidth=0.8)
        axes.plot(cost.compiled, look, "o", color=colour, markersize=5)
        axes.plot(cost.interpreted, look, "o", color=colour, markersize=5, markerfacecolor="white")
        axes.annotate(
            f"{cost.operations:,}",
            (1.0, look),
            xycoords=axes.get_yaxis_transform(),
            ha="right",
            va="center",
            fontsize=8,
            color=GREY,
        )
    axes.set_yticks(range(len(NAMES)), [typeset(name) for name in NAMES])
    axes.set(xscale="log", xlabel="ns an evaluation", ylim=(len(NAMES) - 0.4, -0.6))
    axes.set_xlim(200, 3e5)
    without_box(axes)


def typeset(name: str) -> str:
    """Return the name of a model with its letter as the paper writes it."""
    return name.replace("L_E", "$L_E$").replace("L_I", "$L_I$")
