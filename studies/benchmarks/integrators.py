"""Integrators where methods fail: error against counted work, motions that are fast or stiff.

One reference for all: elliptic functions (A01), Gauss's method of order 8 with steps of 0.05 ms
(A03) and 5 ms (A05), which halved move the result by 1e-11 and less. One metric: the
largest error of the reported coordinates at the end. Work: right-hand sides, where a factorization
of Newton's matrix counts as many as there are columns, 2 n.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from deltaopt.compare.dynamics.tasks import Array
from deltaopt.errors import IntegrationFailed
from studies.benchmarks.cases import Case, cases
from studies.simulation import (
    BDF,
    Adams,
    Gauss,
    Integrator,
    NoStabilisation,
    Projection,
    Stabilisation,
    StabilisedDAE,
    Work,
)
from studies.text_table import csv, paragraph, table

Progress = Callable[[float, str], None]
MOST = 0.3
"""An error beyond this counts as none of the motion: rad or m."""


@dataclass(frozen=True)
class Method:
    """An integrator as it is tried, from coarse to fine.

    ``variants``: integrator and tolerance. ``projected``: against drift.
    """

    name: str
    variants: tuple[tuple[Integrator, float], ...]
    stabilisation: Stabilisation


@dataclass(frozen=True)
class Run:
    """One motion: its ``error`` at the end, NaN and a ``failure`` in words if there is none."""

    case: str
    method: str
    setting: str
    error: float
    work: Work
    columns: int
    seconds: float
    failure: str

    @property
    def cost(self) -> int:
        """Right-hand sides, factorizations included."""
        return self.work.evaluations + self.columns * self.work.factorizations


TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)


def methods(step: float, settings: int) -> tuple[Method, ...]:
    """Return the methods; ``step``: the coarsest of Gauss, s; ``settings``: most of each."""
    tolerances = TOLERANCES[:settings]
    steps = [step / 2**i for i in range(min(settings, 5))]
    return (
        Method("Adams, projected", tuple((Adams(), t) for t in tolerances), Projection()),
        Method("BDF, projected", tuple((BDF(), t) for t in tolerances), Projection()),
        Method(
            "index-2 DAE (GGL, IDAS)",
            tuple((StabilisedDAE(), t) for t in tolerances),
            NoStabilisation(),
        ),
        Method("Gauss, order 6", tuple((Gauss(h), 1e-9) for h in steps), NoStabilisation()),
    )


COARSEST = {"A01": 0.2, "A03": 4e-4, "A05": 0.1}
"""Steps of Gauss, s."""


def measure(progress: Progress, share: float = 1.0, settings: int = 7) -> list[Run]:
    """Run all methods on A01, A03 and A05 for this share of their durations.

    ``settings``: tolerances of each method, from the coarsest.
    """
    chosen = [c for c in cases() if c.name in COARSEST]
    runs = []
    for i, case in enumerate(chosen):
        until = share * case.duration
        times = np.linspace(0, until, 3)
        truth = _truth(case, times)
        every = [(m, v) for m in methods(COARSEST[case.name], settings) for v in m.variants]
        for k, (method, (integrator, tolerance)) in enumerate(every):
            progress((i + k / len(every)) / len(chosen), f"{case.name}, {method.name}")
            runs.append(_run(case, method, integrator, tolerance, times, truth))
    progress(1.0, "done")
    return runs


def _truth(case: Case, times: Array) -> Array:
    """The coordinates that count, at the end."""
    if case.exact is not None:
        return np.asarray(case.exact(times)[-1])
    fine = replace(case, integrator=Gauss(0.005, stages=4), tolerance=1e-11).run(times)
    return np.asarray(case.own(fine)[-1])


def _run(
    case: Case, method: Method, integrator: Integrator, tolerance: float, times: Array, truth: Array
) -> Run:
    setting = f"step {integrator.step:g}" if isinstance(integrator, Gauss) else f"{tolerance:.0e}"
    columns = 2 * case.mechanism.q.numel()
    tried = replace(
        case, integrator=integrator, tolerance=tolerance, stabilisation=method.stabilisation
    )
    try:
        motion = tried.run(times)
    except IntegrationFailed as failure:
        nothing = (np.nan, Work(), columns, np.nan, str(failure).split("(")[1].split(")")[0])
        return Run(case.name, method.name, setting, *nothing)
    error = float(np.abs(case.own(motion)[-1] - truth).max())
    failure_ = "" if error < MOST else "another motion"
    return Run(
        case.name, method.name, setting, error, motion.work, columns, motion.seconds, failure_
    )


def to_reach(runs: list[Run], case: str, method: str, error: float) -> int | None:
    """Return the least cost at which a method's error is at most ``error``, None if never."""
    reached = [r.cost for r in runs if (r.case, r.method) == (case, method) and r.error <= error]
    return min(reached, default=None)


def table_of(runs: list[Run]) -> str:
    """Return one line a run."""
    rows = [
        ("case", "method", "setting", "error", "steps", "r.h.s.", "fact.", "cost", "seconds", "")
    ]
    rows += [
        (
            r.case,
            r.method,
            r.setting,
            "-" if np.isnan(r.error) else f"{r.error:.1e}",
            str(r.work.steps),
            str(r.work.evaluations),
            str(r.work.factorizations),
            str(r.cost),
            "-" if np.isnan(r.seconds) else f"{r.seconds:.2f}",
            r.failure,
        )
        for r in runs
    ]
    return table(rows)


def verdict(runs: list[Run]) -> str:
    """Say who reaches 1e-5 at the least cost in each case."""
    names = list(dict.fromkeys(r.method for r in runs))
    sentences = []
    for case in dict.fromkeys(r.case for r in runs):
        costs = {name: to_reach(runs, case, name, 1e-5) for name in names}
        found = sorted((cost, name) for name, cost in costs.items() if cost is not None)
        never = [name for name, cost in costs.items() if cost is None]
        told = ", ".join(f"{name} {cost}" for cost, name in found)
        sentences.append(
            f"{case}, an error of 1e-5 costs in right-hand sides: {told}"
            + (f"; never: {', '.join(never)}." if never else ".")
        )
    return paragraph(*sentences)


def csv_of(runs: list[Run]) -> str:
    """Return one line a run."""
    return csv(
        "case,method,setting,error,steps,evaluations,factorizations,cost,seconds,failure",
        (
            (
                r.case,
                r.method,
                r.setting,
                repr(r.error),
                r.work.steps,
                r.work.evaluations,
                r.work.factorizations,
                r.cost,
                r.seconds,
                r.failure,
            )
            for r in runs
        ),
    )
