"""The style of all charts: fonts, lines, files. Colours are in ``colours``."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from textwrap import fill
from warnings import catch_warnings, filterwarnings

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator
from numpy.typing import ArrayLike
from PIL import Image

from deltaopt.curves.piecewise import Array
from deltaopt.files.atomic_write import atomic_write
from deltaopt.files.validated_record import Vector3
from deltaopt.plots.colours import COLOURS, GREY

STROKES = ("-", (0, (5, 1.5)), (0, (5, 1.5, 1, 1.5)))
"""Of the curves of the motors, which are told apart in print without colour too."""
LARGE, SMALL = 11, 6.5
"""Sizes of a picture's title and of remarks, points; all else has 8."""

_LETTERS = 11
"""Of a title in an inch."""
_UNIT = re.compile(r"(?<=\d) (?=(?:%|s|m|mm|kg)(?!\w))|(?<==) (?=\S)")
"""The space between a number and its unit, or between = and a number: no line ends there."""
_DOTS = 200
"""Per inch: a page as wide as a screen."""
_LEAD = 0.03
"""Of a panel's width, from the end of a line to a name that is moved away from it."""
_SHADES = 128
"""Colours of a PNG: enough for smooth edges, at a third of the size of all colours."""
_STYLE = mpl.rc_params_from_file(
    Path(__file__).with_name("charts.mplstyle"), use_default_template=False
)
_DRAWING = threading.RLock()
"""One thread draws at a time: Matplotlib's style and its text belong to the whole process."""


@contextmanager
def figure(file: Path, width: float, height: float, message: str = "") -> Iterator[Figure]:
    """A figure of this size (inches) to draw on, which is written to the file at the end.

    ``message``: its title, what a reader is to take from it.

    The format follows the file's suffix: png, pdf or svg. If an error is raised in between, the
    file stays as it was.
    """
    with _DRAWING, mpl.rc_context(_STYLE), atomic_write(file) as temporary:
        drawn = Figure(figsize=(width, height), dpi=_DOTS, layout="constrained")
        if message:
            title = fill(_UNIT.sub("\N{NO-BREAK SPACE}", verbatim(message)), int(_LETTERS * width))
            drawn.suptitle(title, x=0.01, ha="left", fontsize=LARGE)
        yield drawn
        pixels, is_png = BytesIO(), file.suffix == ".png"
        target, form = (pixels, "rgba") if is_png else (temporary, None)
        with catch_warnings():
            filterwarnings("ignore", "Glyph")  # no font has all signs of all names
            drawn.savefig(target, dpi="figure", format=form)
        if is_png:
            picture = Image.frombytes("RGBA", drawn.canvas.get_width_height(), pixels.getvalue())
            few = picture.convert("RGB").quantize(_SHADES, dither=Image.Dither.NONE)
            few.save(temporary, format="png", optimize=True)


def verbatim(text: str) -> str:
    """A text that Matplotlib writes as it stands: between two $ it would read formulas."""
    return text.replace("$", r"\$")


def motor_curves(axes: Axes, t: Array, values: Array) -> None:
    """Draw a curve for each motor, which names it, from values, (N, 3), at times t, (N,), s."""
    for k, (colour, stroke) in enumerate(zip(COLOURS, STROKES, strict=True)):
        axes.plot(t, values[:, k], color=colour, linestyle=stroke, label=f"motor {k + 1}")
    axes.set_xlim(t[0], t[-1])
    without_box(axes)


def name_rms(
    axes: Axes, rms: Sequence[float], rated: Vector3 | None, largest: ArrayLike
) -> list[float]:
    """Write each motor's RMS torque beside its name, in percent of its largest torque, and draw
    what it may be in the long run where that is known: the shares of the largest, returned. All
    torques are in N·m, (3,)."""
    for line, share in zip(axes.get_lines(), np.divide(rms, largest).tolist(), strict=True):
        line.set_label(f"{line.get_label()}, RMS {100 * share:.0f} %")
    shares = [] if rated is None else np.unique(np.divide(rated, largest)).tolist()
    for share in shares:
        name = f"rated RMS {100 * share:.0f} %"
        axes.plot(axes.get_xlim(), [100 * share] * 2, ":", color=GREY, linewidth=0.9, label=name)
    return shares


def logarithmic(axes: Axes) -> None:
    """Make both axes logarithmic. Where they span less than two decades, 2 and 4 of each have
    numbers too: Matplotlib's own choice, 2, 3, 4 and 6, leaves too little room for them."""
    axes.set(xscale="log", yscale="log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_locator(LogLocator(subs=(2, 4)))


def name_lines(axes: Axes, *, room: float, apart: float = 0.09) -> None:
    """Write the label of each line behind its last point, in its colour, instead of a legend.

    ``room``: the share of the panel's width that is left free for them on the right. ``apart``: of
    its height, how far names are from each other at least: those that would overlap move as little
    as they can, to the right of their lines' ends, to which thin lines lead.
    """
    named = [line for line in axes.get_lines() if not str(line.get_label()).startswith("_")]
    scale = axes.transScale
    left, right = (float(scale.transform((x, axes.get_ylim()[1]))[0]) for x in axes.get_xlim())
    wider = (left + (right - left) / (1 - room), scale.transform((1.0, axes.get_ylim()[1]))[1])
    if axes.get_xscale() == "linear":
        axes.set_xticks([tick for tick in axes.get_xticks() if left <= tick <= right])
    axes.set_xlim(right=float(scale.inverted().transform(wider)[0]))
    points = (np.asarray(line.get_xydata(), dtype=float) for line in named)
    last = [each[np.isfinite(each).all(axis=1)][-1] for each in points]  # that exists
    places = axes.transLimits.transform(scale.transform(last))
    order = np.argsort(places[:, 1], kind="stable")
    heights = places[order, 1].clip(apart / 2, 1 - apart / 2)
    steps = apart * np.arange(len(order))
    free = heights - steps  # which must not fall from one name to the next above it
    means = [
        max(min(free[a : b + 1].mean() for b in range(i, len(free))) for a in range(i + 1))
        for i in range(len(free))
    ]
    moved = np.clip(means, apart / 2, max(1 - apart / 2 - steps[-1], apart / 2)) + steps
    crowds = np.cumsum(np.diff(moved, prepend=-1.0) > 1.001 * apart)
    for k, i in enumerate(order):
        crowd = crowds == crowds[k]
        colour, (across, up) = named[i].get_color(), places[i]
        if np.abs(moved - heights)[crowd].max() > 0.6 * apart:
            end, across = across, places[order[crowd], 0].max() + _LEAD
            thin = {"color": colour, "linewidth": 0.5, "label": "_lead"}
            axes.plot([end, across], [up, moved[k]], transform=axes.transAxes, **thin)
        axes.annotate(
            str(named[i].get_label()),
            (across, moved[k]),
            (4, 0),
            xycoords="axes fraction",
            textcoords="offset points",
            va="center",
            color=colour,
        )


def without_box(axes: Axes) -> None:
    """Remove the frame but for the two axes with numbers."""
    axes.spines[["top", "right"]].set_visible(False)
