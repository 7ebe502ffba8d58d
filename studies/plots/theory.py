"""The picture of docs/theory.md: what planning does to one motion, a panel for each difficulty."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from deltaopt.curves.piecewise import Array
from deltaopt.plots.colours import BLACK, BLUE, VERMILION
from deltaopt.plots.style import figure, motor_curves, without_box
from studies.theory import Facts


def draw(found: Facts, file: Path) -> None:
    """Draw torques of the best motion, of two meshes, before and after slowing; and gaps."""
    with figure(file, 7.2, 5.0) as page:
        (bang, mesh), (slowed, gap) = page.subplots(2, 2)
        motor_curves(bang, 1e3 * found.best[0], 100 * found.best[1])
        bang.legend(loc="center right")
        bang.set_title("1  Torques jump between limits, at instants unknown")
        for (t, shares, knots), colour, name in zip(
            (found.coarse, found.fine), (VERMILION, BLUE), ("coarse mesh", "refined"), strict=True
        ):
            mesh.plot(1e3 * t, 100 * shares[:, 0], color=colour, label=name)
            mesh.plot(1e3 * knots, np.full(len(knots), -112 if colour == BLUE else -119), "|",
                      color=colour, markersize=4)  # fmt: skip
        mesh.legend(loc="center left")
        mesh.set_title("2  A mesh blurs a jump: knots (|) gather there")
        before, after = found.excess
        _percent_of_limit(slowed, found.coarse[0], before, VERMILION, "as solved")
        _percent_of_limit(slowed, found.coarse[0], after, BLUE, "slowed")
        slowed.set_ylim(97, 101)
        slowed.legend(loc="lower left")
        slowed.set_title(f"3  Slowing by {found.slowing - 1:.2%} keeps limits between points")
        for axes in (bang, mesh, slowed):
            axes.axhline(100, color=BLACK, linewidth=0.7, linestyle=":")
            axes.set(xlabel="time (ms)", ylabel="torque (% of the limit)")
        for values, colour, name, mark in (
            (found.told, BLUE, "told", "o-"),
            (found.true, VERMILION, "true", "s--"),
        ):
            gap.plot(found.intervals, 100 * values, mark, color=colour, label=name, markersize=4)
        gap.set(xscale="log", yscale="log", xlabel="intervals", ylabel="gap (% of the duration)")
        gap.set_xticks(found.intervals[1:], [f"{n}" for n in found.intervals[1:]])
        gap.set_xticks([], minor=True)
        gap.legend()
        gap.set_title("4  The gap that is told covers the true one")
        for axes in (mesh, slowed, gap):
            without_box(axes)


def _percent_of_limit(axes: Axes, t: Array, share: Array, colour: str, name: str) -> None:
    axes.plot(1e3 * t, 100 * share, color=colour, label=name)
