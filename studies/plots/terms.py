"""What each scene needs to be modelled, as a table of what leaving a term out costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from deltaopt.plots.style import figure
from studies.plots.cells import BAD, GOOD, NONE, POOR, Cell, draw_cells
from studies.terms import MATTERS, Effect


def draw(effects: Sequence[Effect], file: Path) -> None:
    """Draw by how much a motion that is planned without a term exceeds limits with it."""
    scenes = list(dict.fromkeys(effect.scene for effect in effects))
    terms = sorted(
        dict.fromkeys(effect.term for effect in effects),
        key=lambda term: -max(effect.size for effect in effects if effect.term == term),
    )
    found = {(effect.term, effect.scene): effect for effect in effects}
    cells = [[_cell(found.get((term, scene))) for scene in scenes] for term in terms]
    with figure(file, 7.2, 1.2 + 0.22 * len(terms)) as page:
        page.suptitle(title(effects), x=0.01, ha="left")
        axes = page.subplots()
        draw_cells(axes, terms, [scene.replace("/", "\n") for scene in scenes], cells)
        axes.set_title("% by which a limit is exceeded, or time is missed, if it is left out")


def title(effects: Sequence[Effect]) -> str:
    """The message: how many of its terms each scene needs."""
    needs = [
        sum(effect.size >= MATTERS for effect in effects if effect.scene == scene)
        for scene in dict.fromkeys(effect.scene for effect in effects)
    ]
    every = len({effect.term for effect in effects})
    several = f"{min(needs)} to {max(needs)}" if min(needs) < max(needs) else f"{needs[0]}"
    return f"A scene needs {several} of {every} terms; leaving out others costs less than 1 %"


def _cell(effect: Effect | None) -> Cell:
    if effect is None:
        return Cell("", NONE)
    if effect.size < MATTERS:
        return Cell(f"{100 * effect.size:.1f}", GOOD)
    return Cell(f"{100 * effect.size:.0f}", POOR if effect.size < 10 * MATTERS else BAD)
