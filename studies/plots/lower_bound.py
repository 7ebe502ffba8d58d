"""How tight the lower bound is, as a chart: for each robot the ratios of random moves, sorted."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from deltaopt.plots.style import figure, without_box


def draw(ratios: Mapping[str, NDArray[np.float64]], file: Path) -> None:
    """Draw the share of moves whose ratio of bound to duration is at most so large, by robot."""
    with figure(file, 5.2, 2.8) as drawn:
        axes = drawn.subplots()
        for name, found in ratios.items():
            share = (np.arange(len(found)) + 1) / len(found)
            axes.step(np.sort(found), share, where="post", label=name)
        axes.set_xlim(0, 1)
        axes.set_ylim(0, 1)
        axes.set_xlabel("lower bound for every path / duration of the plan")
        axes.set_ylabel("share of random moves")
        axes.legend(loc="upper left", fontsize=7)
        without_box(axes)
