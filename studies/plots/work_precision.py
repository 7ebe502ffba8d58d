"""Charts of error against work: lines from coarse to fine, failures at the upper edge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter

from deltaopt.plots.colours import BLACK, BLUE, GREEN, PURPLE, VERMILION
from deltaopt.plots.style import plain_numbers, without_box

LINES: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "linestyle": "-", "marker": "o"},
    {"color": VERMILION, "linestyle": (0, (5, 1.5)), "marker": "s"},
    {"color": GREEN, "linestyle": (0, (5, 1.5, 1, 1.5)), "marker": "^"},
    {"color": BLACK, "linestyle": (0, (1, 1.2)), "marker": "D"},
    {"color": PURPLE, "linestyle": (0, (8, 2)), "marker": "v"},
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
    _few_ticks(axes)
    without_box(axes)


def _few_ticks(axes: Axes) -> None:
    """Number 1, 2 and 5 of each decade where there are few decades; else decades alone."""
    axes.xaxis.set_minor_formatter(NullFormatter())
    low, high = axes.get_xlim()
    if np.log10(high / low) < 1.7:
        plain_numbers(axes.xaxis)
