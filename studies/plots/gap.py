"""Gaps that plans tell against true ones, as a chart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from deltaopt.plots.colours import COLOURS, GREY
from deltaopt.plots.style import figure, logarithmic, without_box
from studies.gap import Held
from studies.gap_moves import INSIDE

LEAST, MOST = 1e-9, 3e-2
"""Between which gaps are drawn; smaller and larger ones at the edge of the chart."""


def draw(rows: Sequence[Held], file: Path) -> None:
    """Draw every plan as a point, and save the chart."""
    known = [row for row in rows if not np.isnan(row.true)]
    told = np.array([row.told for row in known])
    floor = max(LEAST, 10 ** np.floor(np.log10(told.min()) - 0.3)) if known else LEAST
    with figure(file, 5.0, 3.8, title(known)) as drawn:
        axes = drawn.subplots()
        ends = [100 * floor, 100 * MOST]
        axes.fill_between(ends, [100 * floor] * 2, ends, color=GREY, alpha=0.12, linewidth=0)
        axes.plot(ends, ends, color=GREY, linewidth=0.8)
        for inside, colour in ((False, COLOURS[1]), (True, COLOURS[0])):
            own = [row for row in known if (row.stratum == INSIDE) == inside]
            axes.plot(
                100 * np.clip([row.true for row in own], floor, MOST),
                100 * np.clip([row.told for row in own], floor, MOST),
                "o",
                markersize=2,
                markeredgewidth=0,
                alpha=0.45,
                color=colour,
            )
        axes.text(0.05, 0.93, "ends inside", color=COLOURS[0], transform=axes.transAxes)
        edge = "ends at the edge of the workspace"
        axes.text(0.05, 0.87, edge, color=COLOURS[1], transform=axes.transAxes)
        axes.text(0.6, 0.2, "told too small", color=GREY, transform=axes.transAxes)
        logarithmic(axes)
        axes.set(xlabel="true gap, %", ylabel="gap that is told, %")
        axes.set(xlim=(100 * floor / 1.3, 100 * MOST), ylim=(100 * floor / 1.3, 100 * MOST))
        without_box(axes)


def title(known: Sequence[Held]) -> str:
    """The message: how many plans tell less than their true gap."""
    small = sum(row.told < row.true for row in known)
    return f"{small} of {len(known)} plans tell too small a gap"
