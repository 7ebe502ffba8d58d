"""A Delta that swings on springs for 100 s: how far it drifts off its constraints.

The springs in the arms keep it away from singularities and its energy constant. The same
motion without stabilisation, with Baumgarte's over its frequency, with projection, and in
minimal coordinates (the platform's, from which all others follow in closed form).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.samples import PAPER
from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics.constraint_matrix import ClosedForm
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.mechanism import Mechanism
from deltaopt.errors import IntegrationFailed
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.mechanisms.delta.mechanism import delta
from studies.simulation.integrators import Work
from studies.simulation.simulation import Motion, simulate
from studies.simulation.stabilisation import (
    Baumgarte,
    NoStabilisation,
    Projection,
    Stabilisation,
)

Progress = Callable[[float, str], None]

DURATION = 100.0
"""s."""
INTERVAL = 0.1
"""Between reports, and projections if there are any, s."""
TOLERANCES = (1e-6, 1e-8, 1e-10)
"""Of the integrator's local error."""
FREQUENCIES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
"""Baumgarte's ω, rad/s, critically damped."""
STIFFNESS = 15.0
"""Of the springs, N·m/rad."""
RELAXED = 0.1
"""Motor angle at which the springs are relaxed, rad."""
START = (0.42, 0.03, 0.02)
"""Platform, at rest, m."""
DRIFTED = 1e-6
"""|f| that is waited for, m."""


@dataclass(frozen=True)
class Run:
    """A motion by one method at one tolerance.

    ``evaluations``: right-hand sides, counted. ``position``, ``velocity``, ``energy``: largest |f|
    (m), |J q̇| (m/s) and change of energy (J). ``drifted_after``: s until |f| exceeds
    ``DRIFTED``; nan if never. All nan if the integrator gave up.
    """

    method: str
    tolerance: float
    seconds: float
    evaluations: float
    position: float
    velocity: float
    energy: float
    drifted_after: float


@dataclass(frozen=True)
class Drift:
    """All runs, and the duration of the motion, s."""

    runs: list[Run]
    duration: float

    def run(self, method: str, tolerance: float) -> Run:
        return next(r for r in self.runs if (r.method, r.tolerance) == (method, tolerance))

    def by(self, method: str) -> list[Run]:
        return [r for r in self.runs if r.method == method]


def baumgarte(frequency: float) -> str:
    """Return the name of Baumgarte's method at a frequency, rad/s."""
    return f"Baumgarte {frequency:g}/s"


STABILISATIONS: dict[str, Stabilisation] = {
    "none": NoStabilisation(),
    **{baumgarte(w): Baumgarte(frequency=w) for w in FREQUENCIES},
    "projection": Projection(),
}
MINIMAL = "minimal coordinates"


def measure(progress: Progress = lambda done, what: None, duration: float = DURATION) -> Drift:
    """Let the Delta swing for ``duration`` (s) by all methods at all tolerances."""
    times = np.linspace(0, duration, round(duration / INTERVAL) + 1)
    cases = [(name, tolerance) for name in [*STABILISATIONS, MINIMAL] for tolerance in TOLERANCES]
    runs = []
    for i, (name, tolerance) in enumerate(cases):
        progress(i / len(cases), f"{name}, tolerance {tolerance:.0e}")
        runs.append(_run(name, tolerance, times))
    progress(1.0, "done")
    return Drift(runs, duration)


def _run(name: str, tolerance: float, times: Array) -> Run:
    try:
        motion = _minimal(times, tolerance) if name == MINIMAL else _swing(name, times, tolerance)
    except IntegrationFailed:
        return Run(name, tolerance, *6 * [np.nan])
    f = np.abs(motion.position_drift).max(axis=1)
    return Run(
        name,
        tolerance,
        motion.seconds,
        motion.work.evaluations,
        float(f.max()),
        float(np.abs(motion.velocity_drift).max()),
        float(np.abs(motion.energy - motion.energy[0]).max()),
        float(times[int(np.argmax(f > DRIFTED))]) if (f > DRIFTED).any() else np.nan,
    )


def delta_on_springs() -> Mechanism:
    """Return the paper's Delta without torques, a torsion spring at every motor."""
    m = delta(PAPER)
    return replace(m, potential=STIFFNESS / 2 * ca.sumsqr(m.q[3::3] - RELAXED))


def _swing(name: str, times: Array, tolerance: float) -> Motion:
    """In all twelve coordinates."""
    p = np.array(PAPER.values())
    q0 = DeltaFunctions(PAPER.terms(), Explicit()).inverse_kinematics(START, p).full().ravel()
    return simulate(
        delta_on_springs(),
        Explicit(ClosedForm()),
        q0,
        np.zeros(12),
        times,
        parameters=p,
        stabilisation=STABILISATIONS[name],
        tolerance=tolerance,
    )


def _minimal(times: Array, tolerance: float) -> Motion:
    """In the platform's coordinates; the others by inverse kinematics and eq. (55)."""
    m, p = delta_on_springs(), np.array(PAPER.values())
    z = ca.MX.sym("z", 6)
    velocity = DeltaFunctions(PAPER.terms(), Explicit()).velocity
    q, dq = velocity(z[:3], z[3:], p)
    ddq, _ = Explicit(ClosedForm()).forward_dynamics(m)(0.0, q, dq, np.zeros(3), p)
    span = times[-1] - times[0]
    flow = ca.integrator(
        "minimal",
        "cvodes",
        {"x": z, "ode": span * ca.vertcat(z[3:], ddq[:3])},
        0.0,
        list((times[1:] - times[0]) / span),
        {
            "linear_multistep_method": "adams",
            "nonlinear_solver_iteration": "functional",
            "reltol": tolerance,
            "abstol": tolerance,
            "max_num_steps": 1_000_000,
        },
    )
    z0 = np.concatenate([START, np.zeros(3)])
    start = time.perf_counter()
    states = np.vstack([z0, flow(x0=z0)["xf"].full().T])
    seconds = time.perf_counter() - start
    q_all, dq_all = velocity.map(len(states))(states[:, :3].T, states[:, 3:].T, p)
    told = flow.stats()
    work = Work(told["nsteps"], told["nfevals"])
    return Motion(m, p, times, q_all.full().T, dq_all.full().T, seconds, work)
