"""Work and precision of timing one given path, as a chart."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from deltaopt.plots.colours import COLOURS
from deltaopt.plots.style import figure, without_box

_LEAST = 1e-9
"""Relative error: smaller ones are drawn there, for the reference is not known better."""


class Outcome(Protocol):
    """One solution: its relative ``gap``, seconds of its ``solver`` and of the whole ``plan``, and
    how many intervals were ``swept``."""

    @property
    def gap(self) -> float: ...
    @property
    def solver(self) -> float: ...
    @property
    def plan(self) -> float: ...
    @property
    def swept(self) -> int: ...


class Found(Protocol):
    """Solutions of one path: ours by tolerance, TOPP-RA's by grid."""

    @property
    def own(self) -> dict[float, Any]: ...
    @property
    def slowed(self) -> Sequence[Any]: ...
    @property
    def standing(self) -> Sequence[Any]: ...


def draw(found: Found, file: Path) -> None:
    """Draw error over time and over counted work, and save the chart."""
    own = list(found.own.values())
    lines: list[tuple[str, Sequence[Outcome], str, str, Any, str]] = [
        ("ours, sweeps", own, "solver", COLOURS[0], "-", "o"),
        ("ours, whole plan", own, "plan", COLOURS[0], (0, (5, 1.5)), "s"),
        ("TOPP-RA as it stands", found.standing, "solver", COLOURS[1], "-", "^"),
        ("TOPP-RA, slowed to keep limits", found.slowed, "solver", COLOURS[2], "-", "v"),
    ]
    with figure(file, 6.3, 3.1) as drawn:
        over_time, over_work = drawn.subplots(1, 2, sharey=True)
        for label, outcomes, seconds, colour, stroke, marker in lines:
            style: dict[str, Any] = {"color": colour, "linestyle": stroke, "marker": marker}
            style |= {"markersize": 4, "markeredgewidth": 0, "label": label}
            errors = [max(abs(each.gap), _LEAST) for each in outcomes]
            times = [1e3 * getattr(each, seconds) for each in outcomes]
            over_time.plot(times, errors, **style)
            if seconds == "solver":
                over_work.plot([each.swept for each in outcomes], errors, **style)
        over_time.set(xscale="log", yscale="log", xlabel="processor time, ms")
        over_time.set(ylabel="relative error of the duration")
        over_work.set(xscale="log", xlabel="intervals swept, all meshes")
        highest = max(abs(each.gap) for _, outcomes, *_ in lines for each in outcomes)
        over_time.set_ylim(_LEAST / 1.5, 2 * highest)
        over_time.set_yticks(10.0 ** np.arange(-9, np.floor(np.log10(highest)) + 1))
        handles, labels = over_time.get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside upper center", ncols=2)
        for axes in (over_time, over_work):
            without_box(axes)
