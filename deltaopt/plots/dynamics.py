"""A chart of the comparison of dynamics: accuracy against time."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from deltaopt.compare.dynamics.study import Row, Study
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
from deltaopt.plots.style import figure, plain_numbers, without_box

COLOURS = {
    "K, virtual work": GREEN,
    "K, Kane": PURPLE,
    "L_E": BLUE,
    "L_E, printed": SKY_BLUE,
    "L_I": VERMILION,
    "L_I, printed": ORANGE,
}
MARKERS = {
    "closed form": "o",
    "partition": "s",
    "null space": "^",
    "written out": "D",
    "sparse QR": "v",
    "LAPACK LU": "P",
}
UNIT = 1e-16
"""Unit of the errors on the axis."""
TITLES = {"inverse": "Inverse dynamics, q, q̇, q̈ → τ", "forward": "Forward dynamics, q, q̇, τ → q̈"}


def draw(study: Study, path: Path) -> None:
    """Draw a study and save the chart as PNG."""
    with figure(path, 7.2, 4.6) as page:
        panels = page.subplots(1, len(study.floor), sharex=True, sharey=True)
        for axes, (task, floor) in zip(panels, study.floor.items(), strict=True):
            _panel(axes, [row for row in study.rows if row.task == task], floor)
            axes.set_title(TITLES[task])
        panels[0].set_ylabel(
            f"relative error against {study.digits} digits, 10⁻¹⁶\n(median; line up to the largest)"
        )
        page.legend(handles=_legend(), loc="outside lower center", ncols=4)


def _panel(axes: Axes, rows: list[Row], floor: float) -> None:
    axes.set(xscale="log", yscale="log", xlabel="time per evaluation, µs")
    for axis in (axes.xaxis, axes.yaxis):
        plain_numbers(axis)
    axes.grid(which="both")
    without_box(axes)
    axes.axhline(floor / UNIT, color=BLACK, linestyle=":", linewidth=1)
    for row in rows:
        _point(axes, row, row.interpreted.microseconds, "none")
        if row.compiled:
            _point(axes, row, row.compiled.microseconds, COLOURS[row.model])


def _point(axes: Axes, row: Row, x: float, face: str) -> None:
    """Draw a row's median error, and a line up to the largest, at its time ``x`` in µs.

    Kane's points are smaller, for they lie on those of virtual work.
    """
    colour, size = COLOURS[row.model], 4 if row.model == "K, Kane" else 7
    median, largest = row.median_error / UNIT, row.largest_error / UNIT
    axes.plot([x, x], [median, largest], color=colour, linewidth=0.8, alpha=0.5)
    axes.plot(x, median, MARKERS[row.variant], color=colour, mfc=face, markersize=size)


def _typeset(name: str) -> str:
    return name.replace("L_E", "$L_E$").replace("L_I", "$L_I$")


def _legend() -> list[Line2D]:
    models = [
        Line2D([], [], color=colour, marker="o", linestyle="none", label=_typeset(name))
        for name, colour in COLOURS.items()
    ]
    variants = [
        Line2D([], [], color=GREY, marker=marker, linestyle="none", label=name)
        for name, marker in MARKERS.items()
    ]
    fills = [
        Line2D([], [], color=GREY, marker="o", markerfacecolor=face, linestyle="none", label=name)
        for name, face in (("compiled", GREY), ("interpreted", "none"))
    ]
    floor = Line2D([], [], color=BLACK, linestyle=":", label="rounding of the state alone")
    return [*models, *variants, *fills, floor]
