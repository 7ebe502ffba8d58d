"""Published benchmarks where solvers fail, by every formulation and constraint matrix."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics.constraint_matrix import (
    ClosedForm,
    NullSpace,
    Partition,
    RankRevealing,
)
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.kane import Kane
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.linear import LeastNorm
from deltaopt.dynamics.mechanism import Mechanism
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.errors import DeltaOptError
from studies.benchmarks.bricard import bricard, bricard_start
from studies.benchmarks.four_bars import n_four_bar, n_four_bar_start
from studies.simulation.simulation import simulate
from studies.simulation.stabilisation import NoStabilisation, Projection, Stabilisation
from studies.stability.singularities import lapack_lu

Progress = Callable[[float, str], None]

DURATION = 10.0
"""s, as published."""


@dataclass(frozen=True)
class Benchmark:
    """A mechanism that is let go, and how much of its energy may be lost.

    ``bound``: J. ``interval``: between reports, and projections if there are any, s.
    ``freedoms``: degrees of freedom where it is regular.
    """

    name: str
    title: str
    mechanism: Mechanism
    q0: Array
    dq0: Array
    bound: float
    interval: float
    tolerance: float
    stabilisation: Stabilisation = field(default_factory=Projection)
    freedoms: int = 1


@dataclass(frozen=True)
class Way:
    """A formulation with a constraint matrix or a linear solver; it is chosen for the Jacobian at
    the start."""

    model: str
    variant: str
    formulation: Callable[[Benchmark, Array], Formulation]


@dataclass(frozen=True)
class Outcome:
    """The result of one attempt. ``times`` (s), ``energy_error`` (J): empty if there is no motion.

    ``failure``: in words, empty if the energy kept its bound all the time.
    """

    benchmark: str
    model: str
    variant: str
    times: Array
    energy_error: Array
    seconds: float
    failure: str

    @property
    def largest(self) -> float:
        """Return the largest change of energy, J; NaN if there is no motion."""
        return float(np.abs(self.energy_error).max(initial=-1)) if self.times.size else np.nan


@dataclass(frozen=True)
class Benchmarks:
    """Outcomes of every way at every benchmark."""

    benchmarks: list[Benchmark]
    outcomes: list[Outcome]

    def of(self, benchmark: str) -> list[Outcome]:
        return [o for o in self.outcomes if o.benchmark == benchmark]


def benchmarks() -> list[Benchmark]:
    """Return A02 with two windows, with and without projection, and A04."""
    four_bars = Benchmark(
        name="A02",
        title="A02, two four-bars, projected",
        mechanism=n_four_bar(),
        q0=n_four_bar_start()[0],
        dq0=n_four_bar_start()[1],
        bound=0.1,
        interval=0.02,
        tolerance=1e-10,
    )
    return [
        four_bars,
        replace(
            four_bars,
            name="A02 free",
            title="A02 without stabilisation",
            stabilisation=NoStabilisation(),
        ),
        Benchmark(
            name="A04",
            title="A04, Bricard, projected",
            mechanism=bricard(),
            q0=bricard_start()[0],
            dq0=bricard_start()[1],
            bound=1e-3,
            interval=0.05,
            tolerance=1e-9,
        ),
    ]


WAYS = (
    *(
        Way(model, variant, formulation)
        for model, kind in (("K, virtual work", VirtualWork), ("K, Kane", Kane), ("L_E", Explicit))
        for variant, formulation in (
            ("closed form", lambda b, J, kind=kind: kind(ClosedForm())),
            ("partition", lambda b, J, kind=kind: kind(Partition.pivoted(J))),
            ("null space", lambda b, J, kind=kind: kind(NullSpace())),
            ("rank revealing", lambda b, J, kind=kind: kind(RankRevealing(b.freedoms))),
        )
    ),
    Way("L_I", "sparse QR", lambda b, J: Multiplier()),
    Way("L_I", "LAPACK LU", lambda b, J: Multiplier(lapack_lu)),
    Way("L_I", "least norm", lambda b, J: Multiplier(LeastNorm(1e-8))),
)
"""Each formulation with each constraint matrix or linear solver."""


def measure(progress: Progress = lambda done, what: None, duration: float = DURATION) -> Benchmarks:
    """Attempt every benchmark in every way, for ``duration`` (s)."""
    cases = [(b, way) for b in benchmarks() for way in WAYS]
    outcomes = []
    for i, (benchmark, way) in enumerate(cases):
        progress(i / len(cases), f"{benchmark.name}: {way.model}, {way.variant}")
        outcomes.append(attempt(benchmark, way, duration))
    progress(1.0, "done")
    return Benchmarks(benchmarks(), outcomes)


def attempt(benchmark: Benchmark, way: Way, duration: float = DURATION) -> Outcome:
    """Simulate for ``duration`` (s), and put in words what goes wrong."""
    times = np.linspace(0, duration, round(duration / benchmark.interval) + 1)
    start, error, failure = time.perf_counter(), np.empty(0), ""
    try:
        energy = _energy(benchmark, way, times)
    except ValueError as problem:
        failure = f"cannot be built: {problem}"
    except DeltaOptError as problem:
        failure = f"stops: {problem}"
    else:
        error = energy - energy[0]
        failure = _verdict(times, error, benchmark.bound)
    seconds = time.perf_counter() - start
    return Outcome(
        benchmark.name,
        way.model,
        way.variant,
        times[: error.size],
        error,
        seconds,
        failure,
    )


def _energy(benchmark: Benchmark, way: Way, times: Array) -> Array:
    m = benchmark.mechanism
    J = ca.Function("J", [m.time, m.q], [ca.densify(m.J)])(0.0, benchmark.q0).full()
    return simulate(
        m,
        way.formulation(benchmark, J),
        benchmark.q0,
        benchmark.dq0,
        times,
        stabilisation=benchmark.stabilisation,
        tolerance=benchmark.tolerance,
    ).energy


def _verdict(times: Array, error: Array, bound: float) -> str:
    """Empty, or when the energy left its bound."""
    out = ~(np.abs(error) <= bound)
    if not out.any():
        return ""
    return f"energy off by more than {bound:g} J from t = {times[int(np.argmax(out))]:.2f} s"
