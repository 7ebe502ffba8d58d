"""Charts of the benchmarks: integrators, error against work; N four-bars, work against N."""

from __future__ import annotations

from pathlib import Path

from matplotlib.lines import Line2D

from deltaopt.plots.colours import GREY
from deltaopt.plots.style import figure
from studies.benchmarks.integrators import MOST, Run
from studies.benchmarks.windows import METHODS, Cost
from studies.plots.work_precision import Line, panel

TITLES = {
    "A01": "Pendulum, 10 s: not stiff",
    "A03": "Squeezer, 30 ms: 10,000 rpm",
    "A05": "Governor, 3 s: stiff dampers",
}


def draw_integrators(runs: list[Run], file: Path) -> None:
    """Draw error against right-hand sides, a panel a benchmark."""
    with figure(file, 7.4, 3.1) as drawn:
        names = list(dict.fromkeys(r.method for r in runs))
        cases = list(dict.fromkeys(r.case for r in runs))
        panels = drawn.subplots(1, len(cases), sharex=True, sharey=True, squeeze=False)[0]
        for axes, case in zip(panels, cases, strict=True):
            lines = [_line(runs, case, name, look) for look, name in enumerate(names)]
            panel(axes, lines, title=TITLES[case], x="right-hand sides")
            axes.set_ylim(1e-11, MOST)
        panels[0].set_ylabel("error at the end, rad or m")
        handles, _ = panels[0].get_legend_handles_labels()
        handles.append(Line2D([], [], color=GREY, marker="x", linestyle="none", label="no result"))
        drawn.legend(handles=handles, loc="outside lower center", ncols=5, columnspacing=1.2)


def _line(runs: list[Run], case: str, name: str, look: int) -> Line:
    own = [r for r in runs if (r.case, r.method) == (case, name)]
    good = [r for r in own if not r.failure]
    most = max((r.cost for r in good), default=1)
    failures = [2.0 * most for r in own if r.failure]
    return Line(name, [r.cost for r in good], [r.error for r in good], look, failures)


def draw_windows(costs: list[Cost], file: Path) -> None:
    """Draw operations of a right-hand side against the number of windows."""
    with figure(file, 4.6, 3.1) as drawn:
        axes = drawn.subplots()
        lines = [
            Line(
                method.replace("L_I", "L$_I$").replace("L_E", "L$_E$"),
                [c.windows for c in costs if c.method == method],
                [c.operations for c in costs if c.method == method],
                look,
            )
            for look, method in enumerate(METHODS)
        ]
        title = "N four-bars: only L$_I$ with a sparse solver grows as N"
        panel(axes, lines, title=title, x="windows N", y="operations of a right-hand side")
        numbers = sorted({c.windows for c in costs})
        axes.set_xticks(numbers, [str(n) for n in numbers])
        axes.set_xticks([], minor=True)
        axes.set_xlim(numbers[0] * 0.9, numbers[-1] * 1.1)
        axes.legend(loc="upper left")
