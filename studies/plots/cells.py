"""Tables of numbers as pictures: a cell each, coloured by what it means."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

GOOD, POOR, BAD, NONE = "#BEE3D0", "#F0C987", "#D55E00", "#E4E4E4"
"""Colours of cells: in order, to be watched, fails, and of no account."""


@dataclass(frozen=True)
class Cell:
    """What stands in a cell, and its colour."""

    text: str
    colour: str


def draw_cells(
    axes: Axes, rows: Sequence[str], columns: Sequence[str], cells: Sequence[Sequence[Cell]]
) -> None:
    """Draw a table, its rows from the top; ``cells``: by row and column."""
    for i, k in product(range(len(rows)), range(len(columns))):
        cell = cells[i][k]
        axes.add_patch(Rectangle((k - 0.48, i - 0.47), 0.96, 0.94, color=cell.colour, linewidth=0))
        dark = cell.colour == BAD
        axes.text(k, i, cell.text, ha="center", va="center", color="white" if dark else "black")
    axes.set_xlim(-0.5, len(columns) - 0.5)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xticks(range(len(columns)), columns)
    axes.set_yticks(range(len(rows)), rows)
    axes.tick_params(length=0)
    axes.grid(False)
    axes.spines[:].set_visible(False)
