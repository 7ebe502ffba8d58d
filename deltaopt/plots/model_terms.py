"""Chart of what leaving out each term of a model does to a scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from deltaopt.compare.model_terms import TermEffect
from deltaopt.plots.colours import COLOURS
from deltaopt.plots.style import SMALL, figure, verbatim, without_box

_SMALLEST = 0.01
"""Per cent or mm, of which less is written as nothing: plans are found to about as much."""

_MATTERS = 0.01
"""Share of a limit or of the duration from which a term is needed."""


def draw_terms(file: Path, title: str, effects: Sequence[TermEffect]) -> None:
    """Draw three bars for each term without which there is a plan, the first on top."""
    bars = [effect for effect in effects if not effect.problem]
    panels = (
        ("plan shorter by (%)", [100 * bar.shorter for bar in bars]),
        ("limit exceeded by (%)", [100 * bar.excess for bar in bars]),
        ("misses the goal by (mm)", [1e3 * (bar.miss or 0.0) for bar in bars]),
    )
    with figure(file, 7.2, 1.0 + 0.24 * len(bars), message(effects)) as page:
        page.supxlabel(verbatim(title), fontsize=SMALL)
        axes = page.subplots(1, 3, sharey=True)
        for panel, (label, values), colour in zip(axes, panels, COLOURS, strict=True):
            names = [bar.term.name for bar in bars]
            drawn = panel.barh(names, values, color=colour, height=0.6)
            told = [f"{value:.2g}" if abs(value) >= _SMALLEST else "0" for value in values]
            panel.bar_label(drawn, told, padding=3, fontsize=7)
            panel.set_xlabel(label)
            panel.axvline(0.0, color="0.2", linewidth=0.6)
            panel.margins(x=0.2)
            panel.tick_params(axis="y", length=0)
            panel.grid(False, axis="y")
            without_box(panel)
        axes[0].invert_yaxis()


def message(effects: Sequence[TermEffect]) -> str:
    """How many terms this scene needs, and which one most."""
    needed = [effect for effect in effects if effect.problem or effect.size >= _MATTERS]
    most = f", {effects[0].term.name} most" if needed else ""
    return f"{len(needed)} of {len(effects)} terms change the plan by 1 % or more{most}"
