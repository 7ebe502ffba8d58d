"""Near singular configurations: is L_I more subject to numerical errors than L_E?

Random motions at states on the way into each singularity of the Delta; in how many of them L_I errs
more than L_E, by what factor, and how sure that is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deltaopt.compare.dynamics.many_digits import ManyDigits
from deltaopt.compare.dynamics.tasks import Array
from studies.shares import wilson
from studies.stability import singularities as s
from studies.stability.families import delta_families
from studies.text_table import paragraph, table

Progress = Callable[[float, str], None]
DISTANCES = (1e-2, 1e-4, 1e-6, 1e-8)
PAIRS = tuple(
    (solver, variant)
    for variant in ("closed form", "null space")
    for solver in ("LAPACK LU", "sparse QR")
)
"""Solver of L_I against C of L_E."""


@dataclass(frozen=True)
class Contest:
    """L_I by a solver against L_E by a C: in ``worse`` of ``trials`` motions L_I errs more.

    ``factor``: median of its error over L_E's; infinite without a result of L_I.
    """

    family: str
    problem: str
    solver: str
    variant: str
    worse: int
    trials: int
    factor: float


FAMILIES = ("stretched", "sideways", "coplanar", "upright")


def measure(
    progress: Progress, motions: int, digits: int, names: tuple[str, ...] = FAMILIES
) -> list[Contest]:
    """Hold each solver of L_I against each C of L_E at random ``motions`` of every state."""
    exact, families = ManyDigits(digits), [f for f in delta_families() if f.name in names]
    functions = s.Functions(families[0].mechanism)
    found = []
    for i, family in enumerate(families):
        progress(i / len(families), family.title)
        states = s.States.make(family, functions, exact, motions, DISTANCES)
        for problem in s.PROBLEMS[1:]:
            truth = s.Truth.of(states, problem, exact)
            errors = {
                (m.model, m.variant): truth.each(states, problem, m)
                for m in s.METHODS
                if m.model in ("L_I", "L_E")
            }
            for solver, variant in PAIRS:
                ours, theirs = errors["L_I", solver], errors["L_E", variant]
                found.append(_contest(family.name, problem.title, solver, variant, ours, theirs))
    progress(1.0, "done")
    return found


def _contest(
    family: str, problem: str, solver: str, variant: str, multiplier: Array, explicit: Array
) -> Contest:
    ours = np.where(np.isfinite(multiplier), multiplier, np.inf)
    theirs = np.where(np.isfinite(explicit), explicit, np.inf)
    ratio = np.maximum(ours, 1e-17) / np.maximum(theirs, 1e-17)
    worse = int(np.sum(ours > theirs))
    return Contest(family, problem, solver, variant, worse, ours.size, float(np.nanmedian(ratio)))


def report(found: list[Contest]) -> str:
    """Return all contests and what they say together."""
    rows = [("towards", "of", "L_I by", "L_E, C by", "L_I worse in", "error L_I / L_E, median")]
    rows += [
        (
            c.family,
            c.problem,
            c.solver,
            c.variant,
            f"{c.worse} of {c.trials}",
            f"{c.factor:.1e}",
        )
        for c in found
    ]
    told = []
    for solver, variant in PAIRS:
        own = [c for c in found if (c.solver, c.variant) == (solver, variant)]
        worse, trials = sum(c.worse for c in own), sum(c.trials for c in own)
        low, high = wilson(worse, trials)
        verdict = "worse" if low > 0.5 else "better" if high < 0.5 else "neither worse nor better"
        told.append(
            f"L_I by {solver} against L_E with C by {variant}: worse in {worse} of {trials}"
            f" ({low:.0%} to {high:.0%}): {verdict}."
        )
    distances = ", ".join(f"{e:g}" for e in DISTANCES)
    return f"{table(rows)}\n\n" + paragraph(
        f"States at ε = {distances}; in brackets the 95 % interval of the share (Wilson).", *told
    )
