"""Pictures of sweeps and maps: each title says what there is to be seen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from deltaopt.curves.piecewise import Array
from deltaopt.plots.colours import BLACK, BLUE, COLOURS, LIGHT_GREY, OF_LIMITS, VERMILION
from deltaopt.plots.style import SMALL, figure, verbatim, without_box
from deltaopt.sensitivity.keys import unit_of
from deltaopt.sweeps.points import FACTS

_WIDTH, _HEIGHT, _PANEL = 3.2, 2.7, 2.0
"""Of a chart, and of a place seen from above, inches."""
_LEVELS, _LETTERS = 7, 13
"""Lines of equal value, and letters of the label of a bar of colours, which may be an inch long."""
_PALETTE = (*COLOURS, *OF_LIMITS)


def draw_sweep(
    file: Path, title: str, table: Any, keys: Sequence[str], column: str, series: Sequence[str]
) -> None:
    """Draw a column over one key as lines, over two as a colour map, over more over each by itself.

    ``table``: a pandas DataFrame. ``keys``: of the columns with numbers; ``series``: of those whose
    values tell lines apart.
    """
    each, once = table[[*keys]].nunique(), table.drop_duplicates([*keys])
    is_grid = len(keys) == 2 and not series and each.prod() == len(once) == len(table)
    lines = table.groupby([*series]) if series else [((), table)]
    with figure(file, _WIDTH * max(1.6, len(keys)), 1.3 * _HEIGHT, title) as drawn:
        if is_grid:
            axes = drawn.subplots()
            grid = table.pivot(index=keys[1], columns=keys[0], values=column)
            drawn.colorbar(_pixels(axes, grid, table[column]), ax=axes, label=_label(column))
            if min(grid.shape) > 1:
                same = axes.contour(grid.columns, grid.index, grid, _LEVELS, colors=BLACK)
                axes.clabel(same, fontsize=SMALL)
            axes.set(xlabel=_label(keys[0]), ylabel=_label(keys[1]))
            return
        for axes, key in zip(drawn.subplots(1, len(keys), squeeze=False)[0], keys, strict=True):
            for colour, (name, own) in zip(_PALETTE, lines, strict=False):
                line = "o-" if len(keys) == 1 else "."
                label = verbatim(", ".join(map(str, name))) or None
                _plot(axes, own, key, column, line, color=colour, markersize=4, label=label)
        if series:
            axes.legend(fontsize=SMALL)


def draw_pareto(file: Path, title: str, table: Any, pair: Sequence[str], best: Any) -> None:
    """Draw two columns against each other, and as a line the rows that are the ``best``
    compromises."""
    first, second = pair
    with figure(file, 1.6 * _WIDTH, 1.3 * _HEIGHT, title) as drawn:
        axes = drawn.subplots()
        _plot(axes, table, first, second, ".", color=LIGHT_GREY, label="all plans")
        axes.step(best[first], best[second], ".-", where="post", color=VERMILION, label="best")
        axes.legend()


def draw_map(file: Path, title: str, table: Any, names: Sequence[str]) -> None:
    """Draw columns, in rows, over places from above, a panel for each depth.

    ``names``: of the columns. White is where the move cannot be.
    """
    depths, best = table.groupby("place.x"), table.loc[table["duration"].idxmin()]
    extent = table[["place.y", "place.z"]].agg(np.ptp)
    tall = min(max(extent["place.z"] / max(extent["place.y"], 1e-9), 0.5), 2.0)
    size = max(_PANEL * len(depths), 4.0) + 1.2, tall * _PANEL * len(names) + 1
    with figure(file, *size, title) as drawn:
        panels = drawn.subplots(len(names), len(depths), sharex=True, sharey=True, squeeze=False)
        for name, row in zip(names, panels, strict=True):
            for (depth, here), axes in zip(depths, row, strict=True):
                grid = here.pivot(index="place.z", columns="place.y", values=name)
                shown = _pixels(axes, grid, table[name])
                axes.set_aspect("equal")
                if name == names[0]:
                    axes.set_title(f"{depth:.3g} m below the base")
                if name == names[0] and depth == best["place.x"]:
                    axes.plot(best["place.y"], best["place.z"], "*", color=BLACK, markersize=11)
            drawn.colorbar(shown, ax=list(row), label=fill(_label(name), _LETTERS), pad=0.01)
            row[0].set_ylabel("z (m)")
        panels[0, 0].invert_yaxis()  # of all panels: from above z points down where y points right
        for axes in panels[-1]:
            axes.set_xlabel("y (m)")


def draw_moves(file: Path, title: str, durations: Any, lengths: Array) -> None:
    """Draw how long random moves take, s: how many, and over their ``lengths``, (N,), m."""
    with figure(file, 2 * _WIDTH, 1.1 * _HEIGHT, title) as drawn:
        left, right = drawn.subplots(1, 2)
        left.hist(durations.dropna(), bins="auto", color=BLUE)
        left.set(xlabel="duration (s)", ylabel="moves")
        right.plot(lengths, durations, ".", color=BLUE)
        right.set(xlabel="from start to goal (m)", ylabel="duration (s)")
        for axes in (left, right):
            without_box(axes)


def _plot(axes: Axes, table: Any, x: str, y: str, line: str, **how: Any) -> None:
    """Draw a column over another one."""
    axes.plot(table[x], table[y], line, **how)
    axes.set(xlabel=_label(x), ylabel=_label(y))
    without_box(axes)


def _pixels(axes: Axes, grid: Any, all_values: Any) -> Any:
    """Draw values over a grid in colours, the least of all bright."""
    axes.grid(False)
    x, y = (_edges(np.asarray(each, float)) for each in (grid.columns, grid.index))
    return axes.pcolormesh(
        x, y, grid, cmap="viridis_r", vmin=all_values.min(), vmax=all_values.max()
    )


def _edges(places: Array) -> Array:
    """Where the cells about places begin and end, (N + 1,); one alone has a cell of 0.1 units."""
    widths = np.diff(places) if len(places) > 1 else np.array([0.1])
    begins = places - np.concatenate([widths[:1], widths])[: len(places)] / 2
    return np.append(begins, places[-1] + widths[-1] / 2)


def _label(name: str) -> str:
    unit = unit_of(name)
    return FACTS.get(name, verbatim(f"{name} ({unit})" if unit else name))
