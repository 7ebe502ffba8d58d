"""How tight the lower bound is, as a chart: for each robot the ratios of random moves, sorted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from deltaopt.plots.colours import LINE_COLOURS
from deltaopt.plots.style import figure, name_lines, verbatim, without_box


def draw(ratios: Mapping[str, NDArray[np.float64]], file: Path) -> None:
    """Draw the ratios of bound to duration in their order, by robot."""
    with figure(file, 6.2, 3.2, title(ratios)) as drawn:
        axes = drawn.subplots()
        for (name, found), colour in zip(ratios.items(), LINE_COLOURS, strict=False):
            share = 100 * (np.arange(len(found)) + 1) / len(found)
            label = fill(verbatim(name), 24)
            axes.plot(share, 100 * np.sort(found), label=label, color=colour)
        axes.set(xlim=(0, 100), ylim=(0, 105))
        axes.set_ylabel("lower bound, % of the plan's duration")
        axes.set_xlabel("random moves in order, %")
        name_lines(axes, room=0.32, apart=0.17)
        without_box(axes)


def title(ratios: Mapping[str, NDArray[np.float64]]) -> str:
    """The message: how near the bound the middle one of the moves is."""
    medians = sorted(100 * float(np.median(found)) for found in ratios.values())
    told = " to ".join(f"{median:.0f}" for median in dict.fromkeys((medians[0], medians[-1])))
    return f"The lower bound is {told} % of the duration for half of the moves"
