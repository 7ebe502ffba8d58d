"""Gaps that plans tell against true ones, as a chart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from deltaopt.plots.style import COLOURS, GREY, figure, without_box
from studies.gap import Held
from studies.gap_moves import INSIDE

FLOOR, CEILING = 1e-9, 3e-2
"""Smaller gaps are drawn at the first; none is larger than the second."""


def draw(rows: Sequence[Held], file: Path) -> None:
    """Draw every plan as a point, and save the chart."""
    known = [row for row in rows if not np.isnan(row.true)]
    with figure(file, 4.6, 4.0) as drawn:
        axes = drawn.subplots()
        ends = [FLOOR, CEILING]
        axes.fill_between(ends, [FLOOR / 2] * 2, ends, color=GREY, alpha=0.12, linewidth=0)
        axes.plot(ends, ends, color=GREY, linewidth=0.8)
        for inside, colour, label in (
            (False, COLOURS[1], "ends at the edge of the workspace"),
            (True, COLOURS[0], "ends inside"),
        ):
            own = [row for row in known if (row.stratum == INSIDE) == inside]
            axes.plot(
                [max(row.true, FLOOR) for row in own],
                [max(row.told, FLOOR) for row in own],
                "o",
                markersize=2,
                markeredgewidth=0,
                alpha=0.45,
                color=colour,
                label=label,
            )
        axes.text(2e-5, 2e-8, "told too small", color=GREY)
        axes.set(xscale="log", yscale="log", xlim=(FLOOR / 2, CEILING), ylim=(FLOOR / 2, CEILING))
        axes.set(xlabel="true gap", ylabel="gap that the plan tells")
        legend = axes.legend(loc="upper left", markerscale=2.5)
        for handle in legend.legend_handles:
            if handle is not None:
                handle.set_alpha(1)
        without_box(axes)
