"""Charts of error against work: lines from coarse to fine, failures at the upper edge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from deltaopt.plots.style import without_box

LINES: tuple[dict[str, Any], ...] = (
    {"color": "#0072B2", "linestyle": "-", "marker": "o"},
    {"color": "#D55E00", "linestyle": (0, (5, 1.5)), "marker": "s"},
    {"color": "#009E73", "linestyle": (0, (5, 1.5, 1, 1.5)), "marker": "^"},
    {"color": "#000000", "linestyle": (0, (1, 1.2)), "marker": "D"},
    {"color": "#CC79A7", "linestyle": (0, (8, 2)), "marker": "v"},
)
"""Five lines, the most that a panel may have, in the palette of Okabe and Ito."""


@dataclass(frozen=True)
class Line:
    """A method over its settings: ``x`` and ``y`` (N each, NaN where there is no result).

    ``failures``: abscissas at which there is none. ``look``: which of ``LINES``, 0 to 4.
    """

    name: str
    x: Sequence[float]
    y: Sequence[float]
    look: int
    failures: Sequence[float] = ()


def panel(axes: Axes, lines: Sequence[Line], *, title: str, x: str, y: str = "") -> None:
    """Draw lines with logarithmic axes. Raises ValueError for more than five."""
    if len(lines) > len(LINES):
        raise ValueError(f"{len(lines)} lines in a panel; at most {len(LINES)} can be told apart")
    axes.set(xscale="log", yscale="log", xlabel=x, ylabel=y, title=title)
    for line in lines:
        style = LINES[line.look]
        axes.plot(line.x, line.y, markersize=3.2, label=line.name, **style)
        top = np.full(len(line.failures), 0.97)
        axes.plot(
            line.failures,
            top,
            "x",
            color=style["color"],
            markersize=6,
            transform=axes.get_xaxis_transform(),
        )
    without_box(axes)


def name_lines(axes: Axes, lines: Sequence[Line], at: Sequence[int]) -> None:
    """Write each line's name beside one of its points (index, from the coarsest)."""
    for line, index in zip(lines, at, strict=True):
        axes.annotate(
            line.name,
            (line.x[index], line.y[index]),
            xytext=(5, 3),
            textcoords="offset points",
            color=LINES[line.look]["color"],
            fontsize=8,
        )
