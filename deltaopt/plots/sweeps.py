"""Pictures of sweeps and maps: each title says what there is to be seen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from deltaopt.curves.piecewise import Array
from deltaopt.plots.colours import BLACK, BLUE, COLOURS, LIGHT_GREY, OF_LIMITS, VERMILION
from deltaopt.plots.style import LARGE, SMALL, figure, verbatim, without_box
from deltaopt.sweeps.table import Columns

UNITS = {
    "duration": "duration (s)",
    "parts_per_minute": "parts per minute",
    "rms_share": "RMS torque over rated",
    "torque_share": "largest torque over its limit",
    "singularity": "distance to singularities",
    "gap": "estimated gap",
    "seconds": "time of a processor (s)",
}
_WIDTH, _HEIGHT, _PANEL = 3.2, 2.7, 2.0
"""Of a chart, and of a place seen from above, inches."""
_LEVELS, _LETTERS = 7, 11
"""Lines of equal value, and letters of a title for an inch."""
_PALETTE = (*COLOURS, *OF_LIMITS)


def draw_sweep(
    file: Path, title: str, table: Columns, keys: Sequence[str], column: str, series: Sequence[str]
) -> None:
    """Draw a column over one key as lines, over two as a colour map, over more over each by itself.

    ``keys``: of the columns with numbers; ``series``: of those whose values tell lines apart.
    """
    values, names = np.array(table[column], dtype=float), _names(table, series)
    grid = _grid(table, keys, values) if len(keys) == 2 and len(set(names)) == 1 else None
    with figure(file, _WIDTH * max(1.6, len(keys)), 1.3 * _HEIGHT) as drawn:
        _say(drawn, title)
        if grid is not None:
            axes = drawn.subplots()
            _colour_map(drawn, axes, *grid, _label(column))
            axes.set(xlabel=_label(keys[0]), ylabel=_label(keys[1]))
            return
        for axes, key in zip(drawn.subplots(1, len(keys), squeeze=False)[0], keys, strict=True):
            for colour, name in zip(_PALETTE, dict.fromkeys(names), strict=False):
                own = np.array([each == name for each in names])
                line = "o-" if len(keys) == 1 else "."
                x, label = np.array(table[key], dtype=float)[own], verbatim(name) or None
                axes.plot(x, values[own], line, color=colour, markersize=4, label=label)
            axes.set(xlabel=_label(key), ylabel=_label(column))
            without_box(axes)
        if len(set(names)) > 1:
            axes.legend(fontsize=SMALL)


def draw_pareto(file: Path, title: str, table: Columns, pair: Sequence[str], best: Array) -> None:
    """Draw two columns against each other, and those that are ``best``, (N,) of truth, as a line:
    nothing is less in both."""
    x, y = (np.array(table[name], dtype=float) for name in pair)
    with figure(file, 1.6 * _WIDTH, 1.3 * _HEIGHT) as drawn:
        _say(drawn, title)
        axes = drawn.subplots()
        order = np.flatnonzero(best)[np.argsort(x[best])]
        axes.plot(x, y, ".", color=LIGHT_GREY, label="all plans")
        axes.step(
            x[order], y[order], "o-", where="post", color=VERMILION, markersize=3, label="best"
        )
        axes.set(xlabel=_label(pair[0]), ylabel=_label(pair[1]))
        axes.legend()
        without_box(axes)


def draw_map(file: Path, title: str, table: Columns, names: Sequence[str]) -> None:
    """Draw columns, in rows, over places from above, a panel for each depth.

    ``names``: of the columns. White is where the move cannot be.
    """
    x, y, z = (np.array(table[f"place.{axis}"], dtype=float) for axis in "xyz")
    depths = np.unique(x)
    tall = np.ptp(z) / max(float(np.ptp(y)), 1e-9)
    size = max(_PANEL * len(depths), 4.0) + 1.2, min(max(tall, 0.5), 2.0) * _PANEL * len(names) + 1
    with figure(file, *size) as drawn:
        _say(drawn, title)
        panels = drawn.subplots(len(names), len(depths), sharex=True, sharey=True, squeeze=False)
        for name, row in zip(names, panels, strict=True):
            values = np.array(table[name], dtype=float)
            finite = values[np.isfinite(values)]
            ends = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 1.0)
            for depth, axes in zip(depths, row, strict=True):
                here = x == depth
                points = {"y": y[here], "z": z[here]}
                grid = _grid(points, ("y", "z"), values[here])
                assert grid is not None
                shown = _pixels(axes, *grid, ends)
                axes.set_aspect("equal")
                if name == names[0]:
                    axes.set_title(f"{depth:.3g} m below the base")
                if name == "duration" and np.nanmin(finite, initial=np.inf) in values[here]:
                    best = int(np.nanargmin(np.where(here, values, np.nan)))
                    axes.plot(y[best], z[best], "*", color=VERMILION, markersize=11)
            drawn.colorbar(shown, ax=list(row), label=_label(name), pad=0.01)
            row[0].set_ylabel("z (m)")
        for axes in panels[-1]:
            axes.set_xlabel("y (m)")


def draw_moves(file: Path, title: str, table: Columns, lengths: Array) -> None:
    """Draw how long random moves take: how many, and over their ``lengths``, (N,), m."""
    durations = np.array(table["duration"], dtype=float)
    with figure(file, 2 * _WIDTH, 1.1 * _HEIGHT) as drawn:
        _say(drawn, title)
        left, right = drawn.subplots(1, 2)
        left.hist(durations[np.isfinite(durations)], bins="auto", color=BLUE)
        left.set(xlabel="duration (s)", ylabel="moves")
        right.plot(lengths, durations, ".", color=BLUE)
        right.set(xlabel="from start to goal (m)", ylabel="duration (s)")
        for axes in (left, right):
            without_box(axes)


def _say(drawn: Figure, title: str) -> None:
    """Write a title over a figure, in lines as long as it is wide."""
    text = fill(title, int(_LETTERS * drawn.get_figwidth()))
    drawn.suptitle(verbatim(text), fontsize=LARGE, x=0.01, ha="left")


def _label(name: str) -> str:
    return UNITS.get(name, verbatim(name if name.endswith(" times") else f"{name} (SI units)"))


def _names(table: Columns, series: Sequence[str]) -> list[str]:
    """What tells the line of each row apart."""
    rows = (
        zip(*(table[name] for name in series), strict=True)
        if series
        else [()] * len(table["point"])
    )
    return [", ".join(map(str, row)) for row in rows]


Grid = tuple[Array, Array, Array]


def _grid(table: Columns, keys: Sequence[str], values: Array) -> Grid | None:
    """Two columns and values over them as a grid, (X,), (Y,), (Y, X); None where they are none."""
    (x, column), (y, row) = (np.unique(table[key], return_inverse=True) for key in keys)
    if len(x) * len(y) != len(values):
        return None
    found = np.full((len(y), len(x)), np.nan)
    found[row, column] = values
    return x, y, found


def _pixels(axes: Axes, x: Array, y: Array, values: Array, ends: tuple[float, float]) -> Any:
    """Draw values over a grid in colours, the least bright."""
    axes.grid(False)
    masked = np.ma.masked_invalid(values)
    return axes.pcolormesh(x, y, masked, cmap="viridis_r", vmin=ends[0], vmax=ends[1])


def _colour_map(drawn: Figure, axes: Axes, x: Array, y: Array, values: Array, label: str) -> None:
    """Draw values over a grid in colours and as lines of equal value."""
    finite = values[np.isfinite(values)]
    shown = _pixels(axes, x, y, values, (float(finite.min()), float(finite.max())))
    drawn.colorbar(shown, ax=axes, label=label)
    if min(values.shape) > 1 and len(np.unique(finite)) > 1:
        lines = axes.contour(
            x, y, np.ma.masked_invalid(values), _LEVELS, colors=BLACK, linewidths=0.5
        )
        axes.clabel(lines, fontsize=SMALL)
