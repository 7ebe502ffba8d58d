"""Time against gap, a line for the default and the best of each formulation by Ipopt."""

from __future__ import annotations

from pathlib import Path

from deltaopt.plots.style import figure
from studies.frontier import DEFAULT, Point, best_degree
from studies.plots.work_precision import Line, panel

LOOKS = {DEFAULT: 0, "flat": 1, "forward": 2, "explicit": 3, "multiplier": 4}


def draw(found: list[Point], file: Path) -> None:
    """Draw medians over the scenes; a cross where not every plan is good."""
    with figure(file, 5.6, 3.3) as drawn:
        axes = drawn.subplots()
        lines = [_line(found, method) for method in dict.fromkeys(p.method for p in found)]
        panel(
            axes,
            lines,
            title="The default plans in milliseconds what takes Ipopt tenths of a second",
            x="ms of one processor, median over the scenes",
            y="longer than the optimum, share",
        )
        axes.legend(loc="lower right")


def _line(found: list[Point], method: str) -> Line:
    degree = best_degree(found, method)
    own = [p for p in found if (p.method, p.degree) == (method, degree)]
    name = "default" if method == DEFAULT else f"{method}, Ipopt"
    failures = [1e3 * p.seconds for p in own if p.good < p.scenes]
    return Line(name, [1e3 * p.seconds for p in own], [p.gap for p in own], LOOKS[method], failures)
