"""A chart of the comparison of plans: what accuracy costs in each formulation.

A line for the best method of each formulation: more would hide each other. The tables and the CSV
file have all.
"""

from __future__ import annotations

from math import isfinite
from pathlib import Path

from deltaopt.compare.plans.report import FORMULATIONS
from deltaopt.compare.plans.study import Method, PlanStudy, SolveRow
from deltaopt.plots.colours import BLACK, BLUE, ORANGE, VERMILION
from deltaopt.plots.style import figure, logarithmic, name_lines, without_box

COLOURS = {"flat": BLACK, "forward": ORANGE, "explicit": BLUE, "multiplier": VERMILION}
"""Colours of the formulations."""
KEPT = ("", "constraints at knots", "projection at knots")
"""Closures that keep the loops closed at the knots: others are refused by verification, whatever
their gap."""
FLOOR = 1e-16
"""Smallest gap drawn: those below are drawn there."""


def draw(study: PlanStudy, case: str, path: Path) -> None:
    """Draw one case and save the chart as PNG: gap against time of the best method of each
    formulation; failures as crosses at the upper edge."""
    rows = [row for row in study.rows if row.case == case]
    with figure(path, 5.6, 3.4) as page:
        axes = page.subplots()
        for method in best_of_each(rows):
            own = [row for row in rows if row.method == method]
            good = [row for row in own if not row.failure and isfinite(row.gap)]
            gaps, colour = [max(row.gap, FLOOR) for row in good], COLOURS[method.formulation]
            times = [row.seconds for row in good]
            axes.plot(times, gaps, "o-", color=colour, markersize=3.5, label=method.formulation)
            failed = [row.seconds for row in own if row.failure]
            top, edge = [0.97] * len(failed), axes.get_xaxis_transform()
            axes.plot(failed, top, "x", color=colour, label="_failed", transform=edge)
        logarithmic(axes)
        axes.set(xlabel="wall time of the solve (s)", ylabel="gap of the safe duration")
        axes.set_title(title(rows, case))
        name_lines(axes, room=0.2)
        without_box(axes)


def title(rows: list[SolveRow], case: str) -> str:
    """The message: which formulation is soonest at its best accuracy."""
    last = {
        method.formulation: [row for row in rows if row.method == method and not row.failure][-1]
        for method in best_of_each(rows)
    }
    soonest = min(last, key=lambda name: last[name].seconds)
    slowest = max(last, key=lambda name: last[name].seconds)
    ratio = last[slowest].seconds / last[soonest].seconds
    return f"{case.replace('_', ' ')}: {soonest} is {ratio:.1f} times quicker than {slowest}"


def best_of_each(rows: list[SolveRow]) -> list[Method]:
    """Of each formulation the method that comes nearest to the reference on any mesh without drift,
    in the order of ``FORMULATIONS``; of equals the quicker one."""
    found = []
    for formulation in FORMULATIONS:
        own = [row for row in rows if row.method.formulation == formulation and not row.failure]
        kept = [row for row in own if row.method.closure in KEPT]
        if kept:
            found.append(min(kept, key=lambda row: (row.gap, row.seconds)).method)
    return found
