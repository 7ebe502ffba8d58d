"""Gaps that plans tell against true ones, as a chart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from deltaopt.plots.colours import COLOURS, GREY
from deltaopt.plots.style import figure, without_box
from studies.gap import Held
from studies.gap_moves import INSIDE

LEAST, MOST = 1e-9, 3e-2
"""Between which gaps are drawn; smaller and larger ones at the edge of the chart."""


def draw(rows: Sequence[Held], file: Path) -> None:
    """Draw every plan as a point, and save the chart."""
    known = [row for row in rows if not np.isnan(row.true)]
    told = np.array([row.told for row in known])
    floor = max(LEAST, 10 ** np.floor(np.log10(told.min()) - 0.3)) if known else LEAST
    with figure(file, 4.2, 3.8) as drawn:
        axes = drawn.subplots()
        ends = [floor, MOST]
        axes.fill_between(ends, [floor] * 2, ends, color=GREY, alpha=0.12, linewidth=0)
        axes.plot(ends, ends, color=GREY, linewidth=0.8)
        for inside, colour, label in (
            (False, COLOURS[1], "ends at the edge of the workspace"),
            (True, COLOURS[0], "ends inside"),
        ):
            own = [row for row in known if (row.stratum == INSIDE) == inside]
            axes.plot(
                np.clip([row.true for row in own], floor, MOST),
                np.clip([row.told for row in own], floor, MOST),
                "o",
                markersize=2,
                markeredgewidth=0,
                alpha=0.45,
                color=colour,
                label=label,
            )
        axes.text(0.6, 0.2, "told too small", color=GREY, transform=axes.transAxes)
        axes.set(xscale="log", yscale="log", xlim=(floor / 1.3, MOST), ylim=(floor / 1.3, MOST))
        axes.set(xlabel="true gap", ylabel="gap that the plan tells")
        legend = axes.legend(loc="upper left", markerscale=2.5)
        for handle in legend.legend_handles:
            if handle is not None:
                handle.set_alpha(1)
        without_box(axes)
