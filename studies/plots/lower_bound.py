"""How tight the lower bound is, as a chart: for each robot the ratios of random moves, sorted."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from deltaopt.plots.colours import BLUE, GREEN, PURPLE, VERMILION
from deltaopt.plots.style import STROKES, figure, without_box

_STYLES: tuple[dict[str, Any], ...] = (
    {"color": BLUE, "linestyle": STROKES[0]},
    {"color": VERMILION, "linestyle": STROKES[1]},
    {"color": GREEN, "linestyle": STROKES[2]},
    {"color": PURPLE, "linestyle": ":"},
)
"""Of the robots, in turn."""


def draw(ratios: Mapping[str, NDArray[np.float64]], file: Path) -> None:
    """Draw the share of moves whose ratio of bound to duration is at most so large, by robot."""
    with figure(file, 5.2, 3.4) as drawn:
        axes = drawn.subplots()
        for (name, found), style in zip(ratios.items(), cycle(_STYLES)):
            share = (np.arange(len(found)) + 1) / len(found)
            axes.step(np.sort(found), share, where="post", label=name, **style)
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1)
        axes.set_xlabel("lower bound for every path / duration of the plan")
        axes.set_ylabel("share of random moves")
        drawn.legend(*axes.get_legend_handles_labels(), loc="outside lower center")
        without_box(axes)
