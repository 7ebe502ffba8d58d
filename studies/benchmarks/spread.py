"""Chance at change points: perturbed starts through singularities, by formulation and integrator.

Twenty seeded starts, speeds off by up to 1 %, of two four-bars and of the slider-crank of two equal
links. Solved is a motion that ends within 1e-3 m of the reference, which is one equation of an
angle; keeping energy is not enough, for another branch keeps it too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics import (
    Explicit,
    Formulation,
    LeastNorm,
    Multiplier,
    NullSpace,
)
from deltaopt.errors import IntegrationFailed
from studies.benchmarks import four_bars, slider_crank
from studies.benchmarks.cases import Case, cases
from studies.simulation import (
    Adams,
    Gauss,
    Integrator,
    NoStabilisation,
    Projection,
    Stabilisation,
    StabilisedDAE,
)
from studies.text_table import paragraph, table

Progress = Callable[[float, str], None]
OFF = 0.01
"""Largest relative change of the speed at the start."""
NEAR = 1e-3
"""Distance to the reference at the end that counts as solved, m."""
WAYS: dict[str, tuple[Formulation, Integrator, Stabilisation, float]] = {
    "L_I, Adams, projected": (Multiplier(), Adams(), Projection(), 1e-8),
    "L_I least norm, Adams, proj.": (Multiplier(LeastNorm(1e-8)), Adams(), Projection(), 1e-8),
    "L_E null space, Adams, proj.": (Explicit(NullSpace()), Adams(), Projection(), 1e-8),
    "L_I, Adams, free": (Multiplier(), Adams(), NoStabilisation(), 1e-8),
    "L_I, Gauss": (Multiplier(), Gauss(0.02), NoStabilisation(), 1e-9),
    "index-2 DAE (GGL, IDAS)": (Multiplier(), StabilisedDAE(), NoStabilisation(), 1e-8),
}


@dataclass(frozen=True)
class Outcome:
    """Of all starts: errors at the end (m, NaN where there is no motion), and how many kept their
    energy to 1e-2 J although they are not near the reference."""

    case: str
    way: str
    errors: Array
    other_branch: int

    @property
    def solved(self) -> int:
        return int(np.sum(self.errors <= NEAR))

    @property
    def stopped(self) -> int:
        return int(np.sum(np.isnan(self.errors)))


def measure(
    progress: Progress, starts: int = 20, share: float = 1.0, seed: int = 1
) -> list[Outcome]:
    """Start so often by each way, for this share of each duration."""
    factors = 1 + np.random.default_rng(seed).uniform(-OFF, OFF, starts)
    references: dict[str, Callable[[Array, float], Array]] = {
        "A02": lambda t, k: four_bars.as_pendulum(t, speed=k),
        "slider-crank": lambda t, k: slider_crank.on_its_branch(t, speed=k * slider_crank.SPEED),
    }
    chosen = [c for c in cases() if c.name in references]
    found = []
    for i, case in enumerate(chosen):
        until = 3.0 * share
        ends = np.array([0.0, until])
        truths = [references[case.name](ends, k)[-1] for k in factors]
        for j, (name, way) in enumerate(WAYS.items()):
            progress((i + j / len(WAYS)) / len(chosen), f"{case.name}: {name}")
            found.append(_outcome(case, name, way, factors, truths, until))
    progress(1.0, "done")
    return found


def _outcome(
    case: Case,
    name: str,
    way: tuple[Formulation, Integrator, Stabilisation, float],
    factors: Array,
    truths: list[Array],
    until: float,
) -> Outcome:
    formulation, integrator, stabilisation, tolerance = way
    errors, other = np.full(len(factors), np.nan), 0
    times = np.linspace(0, until, max(2, round(until / case.period) + 1))
    for k, (factor, truth) in enumerate(zip(factors, truths, strict=True)):
        q, dq = case.start
        tried = replace(
            case,
            start=(q, factor * dq),
            formulation=formulation,
            integrator=integrator,
            stabilisation=stabilisation,
            tolerance=tolerance,
        )
        try:
            motion = tried.run(times)
        except IntegrationFailed:
            continue
        errors[k] = np.abs(case.own(motion)[-1] - truth).max()
        other += bool(errors[k] > NEAR and np.ptp(motion.energy) < 1e-2)
    return Outcome(case.name, name, errors, other)


def table_of(found: list[Outcome]) -> str:
    """Return one line a way."""
    rows = [
        ("case", "way", "solved", "stops", "energy kept, elsewhere", "error: median", "largest")
    ]
    for o in found:
        good = o.errors[np.isfinite(o.errors)]
        middle, largest = (
            (f"{np.median(good):.1e}", f"{good.max():.1e}") if good.size else ("-", "-")
        )
        counts = (f"{o.solved} of {o.errors.size}", str(o.stopped), str(o.other_branch))
        rows.append((o.case, o.way, *counts, middle, largest))
    return table(rows)


def verdict(found: list[Outcome]) -> str:
    """Say who solves all starts of both, and who does not."""
    ways = list(dict.fromkeys(o.way for o in found))
    own = {way: [o for o in found if o.way == way] for way in ways}
    always = [w for w in ways if all(o.solved == o.errors.size for o in own[w])]
    not_always = [
        f"{w} ({', '.join(f'{o.solved} of {o.errors.size} {o.case}' for o in own[w])})"
        for w in ways
        if w not in always
    ]
    return paragraph(
        f"Solved from every start: {'; '.join(always) or 'none'}.",
        f"Not from every start: {'; '.join(not_always) or 'none'};"
        f" of these {sum(o.other_branch for o in found)} kept their energy and went elsewhere.",
    )
