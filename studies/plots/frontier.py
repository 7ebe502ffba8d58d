"""Speed against accuracy: the default beside Ipopt in every formulation, and other programs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from deltaopt.plots.colours import BLUE, GREEN, GREY, VERMILION
from deltaopt.plots.style import figure, logarithmic, name_lines, without_box
from studies.frontier import DEFAULT, FORMULATIONS, Point, best_degrees, times_longer


def draw(found: list[Point], file: Path) -> None:
    """Draw medians over the scenes, free moves on the left and past bodies on the right where there
    are any; a point is hollow where not every motion is good."""
    kinds = list(dict.fromkeys(p.past_bodies for p in found))
    with figure(file, 1.0 + 3.2 * len(kinds), 3.4, title(found)) as page:
        every = page.subplots(1, len(kinds), sharey=True, squeeze=False)[0]
        for axes, kind in zip(every, kinds, strict=True):
            own = [p for p in best_degrees(found) if p.past_bodies == kind]
            _panel(axes, own)
            none = sorted({p.method for p in own} - {p.method for p in own if np.isfinite(p.gap)})
            failed = f" ({', '.join(none)}: no motion)" if none else ""
            axes.set_title(("past bodies" if kind else "free moves") + failed)
        every[0].set_ylabel("slower than the optimum, %")


def title(found: list[Point]) -> str:
    """The message: by how much sooner the default has the same accuracy than Ipopt, and what is
    sooner still, less accurately."""
    ratios = [
        ratio
        for kind in dict.fromkeys(p.past_bodies for p in found)
        for by_method in times_longer(found, past_bodies=kind).values()
        for ratio in by_method.values()
    ]
    told = f"As accurate as Ipopt {min(ratios):.0f} to {max(ratios):.0f} times sooner"
    quickest = min((p for p in found if np.isfinite(p.seconds)), key=lambda p: p.seconds)
    if quickest.method == DEFAULT:
        return told
    return f"{told}; {quickest.method} is soonest, {100 * quickest.gap:.0f} % too slow"


def _panel(axes: Axes, found: Sequence[Point]) -> None:
    for method, own in groupby(found, key=lambda p: p.method):
        reached = [p for p in own if np.isfinite(p.gap)]
        if not reached:
            continue
        x, y = [1e3 * p.seconds for p in reached], [100 * max(p.gap, 1e-8) for p in reached]
        colour = _colour(method)
        label = f"{method}, Ipopt" if method in FORMULATIONS else method
        name = "deltaopt" if method == DEFAULT else label
        if colour == GREEN:  # named where it begins: where it ends are others
            axes.annotate(name, (x[0], y[0]), (-2, 4), textcoords="offset points", color=colour)
            name = "_peer"
        axes.plot(x, y, color=colour, label=name, linewidth=1.8 if method == DEFAULT else 1.1)
        for p, across, up in zip(reached, x, y, strict=True):
            face = colour if p.good == p.scenes else "white"
            axes.plot(
                across, up, "o", color=colour, markerfacecolor=face, markersize=4, label="_point"
            )
    axes.margins(y=0.12)  # for names above the first points
    logarithmic(axes)
    axes.set_xlabel("time to plan, ms of one processor")
    name_lines(axes, room=0.3, apart=0.06)
    without_box(axes)


def _colour(method: str) -> str:
    if method == DEFAULT:
        return BLUE
    if method in FORMULATIONS:
        return GREY
    return VERMILION if method == "rockit" else GREEN
