"""What each scene needs to be modelled, as a table of what leaving a term out costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from deltaopt.plots.colours import GREY
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
    with figure(file, 7.2, 1.2 + 0.22 * len(terms), title(effects)) as page:
        axes = page.subplots()
        draw_cells(axes, terms, [scene.replace("/", "\n") for scene in scenes], cells)
        axes.set_title("% of a limit exceeded, or of time missed, if a term is left out")
        axes.set_xlabel("grey: the robot's file has no such term", color=GREY)


def title(effects: Sequence[Effect]) -> str:
    """The message: how many terms matter in some scene, and which in none."""
    terms = dict.fromkeys(effect.term for effect in effects)
    matter = {effect.term for effect in effects if effect.size >= MATTERS}
    told = f"{len(matter)} of {len(terms)} terms change a plan by {100 * MATTERS:.0f} % or more"
    none = [term for term in terms if term not in matter]
    return told + (f"; {' and '.join(none)} by less" if none else "")


def _cell(effect: Effect | None) -> Cell:
    if effect is None:
        return Cell("", NONE)
    if effect.size < MATTERS:
        return Cell(f"{100 * effect.size:.1f}", GOOD)
    percent = f"{100 * effect.size:.0f}"
    return Cell(percent, POOR if float(percent) < 1000 * MATTERS else BAD)
