"""What accuracy costs in a fast motion past a singularity, by integrator."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from deltaopt.plots.style import figure
from studies.driven import DISTANCE, FAMILIES, Run, by_integrator
from studies.plots.work_precision import Line, panel


def draw(runs: list[Run], file: Path) -> None:
    """Draw a panel for each singularity; a cross for a motion that is another one."""
    own = by_integrator(runs)
    families = list(dict.fromkeys(r.family for r in own))
    with figure(file, max(5.2, 3.7 * len(families)), 3.5) as drawn:
        panels = drawn.subplots(1, len(families), sharey=True, squeeze=False)[0]
        for axes, family in zip(panels, families, strict=True):
            ways = dict.fromkeys(r.way for r in own)
            lines = [_line(own, family, way, look) for look, way in enumerate(ways)]
            title = f"fast past {FAMILIES[family]}, ε = {DISTANCE:g}"
            panel(axes, lines, title=title, x="right-hand sides")
            axes.set_ylim(1e-12, 2e-2)
        panels[0].set_ylabel("platform's largest error, m")
        handles, labels = panels[0].get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside lower center", ncols=3, columnspacing=1.5)


def _line(runs: list[Run], family: str, way: str, look: int) -> Line:
    there = [r for r in runs if (r.family, r.way) == (family, way)]
    good = [r for r in there if not r.failure]
    failed = [r.cost for r in there if r.failure and np.isfinite(r.error)]
    return Line(way, [r.cost for r in good], [r.error for r in good], look, failed)
