"""Where models fail: the digits of each that are left near each singularity, as a table."""

from __future__ import annotations

from collections.abc import Sequence
from math import log10
from pathlib import Path

from deltaopt.plots.style import figure
from studies.models.measure import FAMILIES, ROUNDING, TASKS, Error, digits_of
from studies.plots.cells import BAD, GOOD, NONE, POOR, Cell, draw_cells

NEAR = 1e-6
"""Distance from the singularity at which digits are counted, or the next one that was measured."""
TRUSTED, LEAST = 9, 3
"""Digits from which a model is trusted, and below which it fails; what rounding of the state takes
is no fault of a model."""


def draw(errors: Sequence[Error], file: Path) -> None:
    """Draw a table for torques and one for accelerations."""
    models, found = list(dict.fromkeys(e.model for e in errors)), digits_left(errors)
    with figure(file, 7.2, 2.6, title(errors)) as page:
        for axes, (task, what) in zip(page.subplots(1, 2, sharey=True), TASKS.items(), strict=True):
            names = [what.replace(" ", "\n", 1) for what in FAMILIES.values()]
            cells = [[_cell(found, family, task, m) for family in FAMILIES] for m in models]
            draw_cells(axes, models, names, cells)
            axes.tick_params(axis="x", labelsize=6.5)
            axes.set_title(f"{what}: digits left a millionth before")


def digits_left(errors: Sequence[Error]) -> dict[tuple[str, str, str], int]:
    """Digits that are left, by singularity, task and model; none without a result."""
    near = min({e.distance for e in errors}, key=lambda distance: abs(log10(distance / NEAR)))
    return {(e.family, e.task, e.model): digits_of(e.error) for e in errors if e.distance == near}


def fails(found: dict[tuple[str, str, str], int], family: str, task: str, model: str) -> bool:
    """Whether fewer digits are left than ``LEAST``, though rounding leaves more."""
    return found[family, task, model] < min(LEAST, found[family, task, ROUNDING])


def title(errors: Sequence[Error]) -> str:
    """The message: which models fail somewhere, and how many keep what they can everywhere."""
    found = digits_left(errors)
    models = [m for m in dict.fromkeys(e.model for e in errors) if m != ROUNDING]
    colours = {m: {_cell(found, f, t, m).colour for f in FAMILIES for t in TASKS} for m in models}
    failed = " and ".join(m for m, of in colours.items() if BAD in of) or "none"
    sound = sum(of == {GOOD} for of in colours.values())
    told = f"{failed[0].upper()}{failed[1:]} fail near singularities"
    return f"{told}; {sound} of {len(models)} models keep all digits that can be kept"


def _cell(found: dict[tuple[str, str, str], int], family: str, task: str, model: str) -> Cell:
    digits = found[family, task, model]
    if model == ROUNDING:
        return Cell(str(digits), NONE)
    if fails(found, family, task, model):
        return Cell(str(digits), BAD)
    least = min(TRUSTED, found[family, task, ROUNDING] - 1)
    return Cell(str(digits), GOOD if digits >= least else POOR)
