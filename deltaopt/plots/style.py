"""The style of all charts: fonts, lines, files. Colours are in ``colours``."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from warnings import catch_warnings, filterwarnings

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from deltaopt.curves.piecewise import Array
from deltaopt.files.atomic_write import atomic_write
from deltaopt.plots.colours import COLOURS

STROKES = ("-", (0, (5, 1.5)), (0, (5, 1.5, 1, 1.5)))
"""Of the curves of the motors, which are told apart in print without colour too."""
LARGE, SMALL = 14, 7
"""Sizes of a picture's title and of remarks, points; all else has 9."""

_DOTS = 300
"""Per inch: of print."""
_STYLE: Any = {
    "font.family": ["STIXGeneral", "DejaVu Sans"],  # the latter for what the former lacks
    "mathtext.fontset": "stix",
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.unicode_minus": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.5,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    "legend.handlelength": 2.8,
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
}


_DRAWING = threading.RLock()
"""One thread draws at a time: Matplotlib's style and its text belong to the whole process."""


@contextmanager
def figure(file: Path, width: float, height: float) -> Iterator[Figure]:
    """A figure of this size (inches) to draw on, which is written to the file at the end.

    The format follows the file's suffix: png, pdf or svg. If an error is raised in between, the
    file stays as it was.
    """
    with _DRAWING, mpl.rc_context(_STYLE), atomic_write(file) as temporary:
        drawn = Figure(figsize=(width, height), dpi=_DOTS, layout="constrained")
        yield drawn
        with catch_warnings():
            filterwarnings("ignore", "Glyph")  # no font has all signs of all names
            drawn.savefig(temporary, dpi="figure")


def verbatim(text: str) -> str:
    """A text that Matplotlib writes as it stands: between two $ it would read formulas."""
    return text.replace("$", r"\$")


def motor_curves(axes: Axes, t: Array, values: Array) -> None:
    """Draw a curve for each motor, from values, (N, 3), at times t, (N,), s."""
    for k, (colour, stroke) in enumerate(zip(COLOURS, STROKES, strict=True)):
        axes.plot(t, values[:, k], color=colour, linestyle=stroke, label=f"motor {k + 1}")
    axes.set_xlim(t[0], t[-1])
    without_box(axes)


def plain_numbers(axis: Axis, within_decade: tuple[float, ...] = (1, 2, 5)) -> None:
    """Write the numbers of a logarithmic axis as 0.2 and 50, and these of each decade alone."""
    axis.set_major_locator(LogLocator(subs=within_decade))
    axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())


def without_box(axes: Axes) -> None:
    """Remove the frame but for the two axes with numbers."""
    axes.spines[["top", "right"]].set_visible(False)
