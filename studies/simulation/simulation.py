"""Forward simulation: the motion that forces and constraints make.

By default (q, q̇)˙ = (q̇, q̈) is integrated, with q̈ from the forward dynamics of a formulation, by
the variable-order Adams method of SUNDIALS' CVODES: most mechanisms are not stiff, and it asks for
no derivatives of q̈, so that any constraint matrix will do. ``studies.simulation.integrators`` has
others: for stiff motions, for differential-algebraic systems, and one that keeps invariants.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from deltaopt.dynamics.consistency import Array, Projector, Residuals, consistent_state
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.mechanism import SX, Mechanism
from studies.simulation.integrators import Adams, Equations, Flow, Integrator, Work
from studies.simulation.stabilisation import Projection, Stabilisation


@dataclass(frozen=True)
class Motion:
    """A simulated motion at N times.

    ``times``: N, s. ``q``, ``dq``: N × n. ``parameters``: those it was simulated with.
    ``seconds``: spent integrating and projecting, not deriving the equations.
    ``work``: steps, evaluations and factorizations of the integrator.
    """

    mechanism: Mechanism
    parameters: Array
    times: Array
    q: Array
    dq: Array
    seconds: float
    work: Work = field(default_factory=Work)

    @cached_property
    def position_drift(self) -> Array:
        """f(q, t), N × h, zero on the constraints."""
        return self._residuals[0]

    @cached_property
    def velocity_drift(self) -> Array:
        """J q̇ + μ, N × γ, zero on the constraints."""
        return self._residuals[1]

    @cached_property
    def energy(self) -> Array:
        """T + V, N, J; constant if no effort does work and no constraint moves."""
        m = self.mechanism
        total = ca.Function("energy", [m.time, m.q, m.dq, m.parameters], [m.T + m.V])
        return np.array([float(total(*row, self.parameters)) for row in self._rows])

    @cached_property
    def _residuals(self) -> tuple[Array, Array]:
        residuals = Residuals(self.mechanism)
        f, rate = zip(*(residuals(*row, self.parameters) for row in self._rows), strict=True)
        return np.array(f), np.array(rate)

    @property
    def _rows(self) -> zip[tuple[float, Array, Array]]:
        return zip(self.times, self.q, self.dq, strict=True)


def simulate(
    mechanism: Mechanism,
    formulation: Formulation,
    q0: ArrayLike,
    dq0: ArrayLike,
    times: ArrayLike,
    *,
    controls: SX | ArrayLike | None = None,
    parameters: ArrayLike = (),
    stabilisation: Stabilisation | None = None,
    integrator: Integrator | None = None,
    tolerance: float = 1e-10,
) -> Motion:
    """The motion from (q0, dq0) at ``times[0]``, reported at ``times`` (N, increasing, s).

    ``controls``: torques, m: constants, or an expression in the mechanism's ``time``, ``q``
    and ``dq``; None where nothing drives it. ``parameters``: values of the mechanism's.
    ``stabilisation``: ``Projection()`` unless told otherwise. ``integrator``: ``Adams()`` unless
    told otherwise. ``tolerance``: of its local error, relative and absolute.

    An initial state slightly off the constraints (1e-3 m, 1e-2 m/s; rad likewise) is
    projected onto them, ``Inconsistent`` is raised beyond; ``IntegrationFailed`` where the
    motion cannot be followed.
    """
    stabilisation = Projection() if stabilisation is None else stabilisation
    integrator = Adams() if integrator is None else integrator
    grid, p = np.asarray(times, dtype=float), np.asarray(parameters, dtype=float)
    if grid.ndim != 1 or grid.size < 2 or not np.all(np.diff(grid) > 0):
        raise ValueError("times must be at least two, increasing")
    q, dq = np.asarray(q0, dtype=float), np.asarray(dq0, dtype=float)
    q, dq = consistent_state(Projector(mechanism), grid[0], q, dq, p)

    equations = Equations(
        stabilisation.mechanism(mechanism), formulation, _law(mechanism, controls)
    )
    projector = stabilisation.projector(mechanism)
    state, n = np.concatenate([q, dq]), mechanism.q.numel()
    fractions = [1.0] if projector else list((grid[1:] - grid[0]) / (grid[-1] - grid[0]))
    flow = integrator.flow(equations, fractions, tolerance)
    start = time.perf_counter()
    if projector is None:
        found, work = flow(state, grid[0], grid[-1] - grid[0], p)
        states = np.vstack([state, found])
    else:
        states, work = _projected(flow, projector, grid, state, p)
    seconds = time.perf_counter() - start
    return Motion(mechanism, p, grid, states[:, :n], states[:, n:], seconds, work)


def _law(m: Mechanism, controls: SX | ArrayLike | None) -> ca.Function:
    """(t, q, q̇) -> τ, m."""
    torques = _column(m.controls.numel(), controls)
    return ca.Function("controls", [m.time, m.q, m.dq], [ca.densify(torques)])


def _column(m: int, controls: SX | ArrayLike | None) -> SX:
    """The controls as an expression, m."""
    if controls is None:
        return SX.zeros(m)
    column = controls if isinstance(controls, SX) else SX(np.asarray(controls, dtype=float).ravel())
    if column.numel() != m:
        raise ValueError(f"{column.numel()} controls given, the mechanism has {m}")
    return column


def _projected(
    flow: Flow, projector: Projector, grid: Array, state: Array, p: Array
) -> tuple[Array, Work]:
    """States at the grid's times, N × 2n, each projected before the next is integrated."""
    states, work = [state], Work()
    for start, end in pairwise(grid):
        (state,), spent = flow(states[-1], start, end - start, p)
        work += spent
        q, dq = np.split(state, 2)
        states.append(np.concatenate(projector(end, q, dq, p)))
    return np.array(states), work
