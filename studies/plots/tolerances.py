"""What a gap costs, as a chart: a panel a scene, a line a method."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes

from deltaopt.plots.colours import COLOURS, GREY
from deltaopt.plots.style import figure, plain_numbers, without_box
from studies.tolerances import MESHES, REFINED, SWITCHES, ToleranceStudy

MARKERS = {MESHES: "s", REFINED: "o", SWITCHES: "D"}
FLOOR = 1e-9
"""Smaller gaps are drawn here."""
KNOWN = 1e-8
"""The reference itself is known to this."""


def draw(studies: dict[str, ToleranceStudy], file: Path) -> None:
    """Draw the studies, by the name of their scene, and save the chart."""
    columns = min(len(studies), 2)
    rows = -(-len(studies) // columns)
    below = 0.3 if columns > 1 else 0.7  # height of the legend: a single panel is too narrow
    with figure(file, 3.4 * columns, 2.3 * rows + below) as drawn:
        panels = drawn.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for axes, (name, study) in zip(panels.flat, studies.items(), strict=False):
            _panel(axes, study)
            axes.set_title(name.replace("_", " "))
        for axes in panels.flat[len(studies) :]:
            axes.remove()
        for axes in panels[-1]:
            axes.set_xlabel("processor time, s")
        for axes in panels[:, 0]:
            axes.set_ylabel("gap to the shortest duration")
        handles, labels = panels[0, 0].get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside lower center", ncols=1 if columns == 1 else 3)


def _panel(axes: Axes, study: ToleranceStudy) -> None:
    for (method, marker), colour in zip(MARKERS.items(), COLOURS, strict=True):
        found = [c for c in study.costs if c.method == method]
        axes.plot(
            [c.seconds for c in found],
            [max(study.gap(c), FLOOR) for c in found],
            marker=marker,
            markersize=4,
            linewidth=1,
            color=colour,
            label=method,
        )
    axes.axhspan(FLOOR / 2, KNOWN, color=GREY, alpha=0.12, linewidth=0)
    axes.set(xscale="log", yscale="log", ylim=(FLOOR / 2, 3e-2))
    plain_numbers(axes.xaxis)
    without_box(axes)
