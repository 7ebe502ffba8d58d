"""A chart of the comparison of dynamics: what an evaluation by each model costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes

from deltaopt.compare.dynamics.study import ModelRow, Study
from deltaopt.plots.colours import BLUE, LIGHT_GREY
from deltaopt.plots.style import figure, without_box

TITLES = {"inverse": "inverse dynamics, q, q̇, q̈ → τ", "forward": "forward dynamics, q, q̇, τ → q̈"}


def draw(study: Study, path: Path) -> None:
    """Draw a study and save the chart as PNG: bars of time, compiled where a model can be."""
    most = max(sum(row.task == task for row in study.rows) for task in study.floor)
    with figure(path, 7.2, 1.2 + 0.17 * most, title(study)) as page:
        for axes, task in zip(page.subplots(1, len(study.floor)), study.floor, strict=True):
            _bars(axes, sorted((row for row in study.rows if row.task == task), key=_time))
            axes.set_title(TITLES[task])


def title(study: Study) -> str:
    """The message: how far costs lie apart, and errors."""
    apart = [
        max(times) / min(times)
        for task in study.floor
        for times in [[_time(row) for row in study.rows if row.task == task]]
    ]
    error = max(row.median_error for row in study.rows)
    return f"Models err by {error:.0e} at most, and differ {max(apart):.0f} times in cost"


def _time(row: ModelRow) -> float:
    """Of an evaluation, µs."""
    return 1e6 * row.seconds


def _bars(axes: Axes, rows: Sequence[ModelRow]) -> None:
    names = [f"{row.model}, {row.variant}" for row in rows]
    colours = [BLUE if row.compiled else LIGHT_GREY for row in rows]
    bars = axes.barh(names, [_time(row) for row in rows], color=colours, height=0.7)
    texts = [f"{_time(row):.{0 if _time(row) >= 10 else 1}f}" for row in rows]
    axes.bar_label(bars, texts, padding=2, fontsize=6.5)
    axes.set_xlabel("µs (grey: not compiled)")
    axes.margins(x=0.2)  # for the number of the longest bar
    axes.tick_params(axis="y", length=0, labelsize=6.5)
    axes.invert_yaxis()
    axes.grid(False, axis="y")
    without_box(axes)
