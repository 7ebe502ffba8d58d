"""Forward simulation: the motion that forces and constraints make.

Integrated is (q, q̇)˙ = (q̇, q̈) with q̈ from the forward dynamics of a formulation, by the
variable-order Adams method of SUNDIALS' CVODES: mechanisms are not stiff, and it asks for
no derivatives of q̈, so that any constraint matrix will do. The multipliers are solved for
inside q̈, hence no need for a solver of differential-algebraic equations.
"""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from deltaopt.dynamics.consistency import Array, Projector, Residuals, consistent_state
from deltaopt.dynamics.exclusive_use import Copies
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.mechanism import SX, Mechanism
from deltaopt.dynamics.stabilisation import Projection, Stabilisation
from deltaopt.errors import IntegrationFailed
from deltaopt.interrupts.requests import requests_held

MOST_STEPS = 50_000
"""Integration steps between two reported times before giving up."""

_PRECISE: dict[str, Any] = {
    "reltol": 1e-12,
    "abstol": 1e-13,
    "linear_multistep_method": "adams",
    "nonlinear_solver_iteration": "functional",
    "max_num_steps": 20_000,  # an interval of a mesh takes about 20
    "disable_internal_warnings": True,
    "show_eval_warnings": False,  # a failure is not a number, and told by the caller
}


@dataclass(frozen=True)
class Motion:
    """A simulated motion at N times.

    ``times``: N, s. ``q``, ``dq``: N × n. ``parameters``: those it was simulated with.
    ``seconds``: spent integrating and projecting, not deriving the equations.
    """

    mechanism: Mechanism
    parameters: Array
    times: Array
    q: Array
    dq: Array
    seconds: float

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
    tolerance: float = 1e-10,
) -> Motion:
    """The motion from (q0, dq0) at ``times[0]``, reported at ``times`` (N, increasing, s).

    ``controls``: torques, m: constants, or an expression in the mechanism's ``time``, ``q``
    and ``dq``; None where nothing drives it. ``parameters``: values of the mechanism's.
    ``stabilisation``: ``Projection()`` unless told otherwise. ``tolerance``: of the
    integrator's local error, relative and absolute.

    An initial state slightly off the constraints (1e-3 m, 1e-2 m/s; rad likewise) is
    projected onto them, ``Inconsistent`` is raised beyond; ``IntegrationFailed`` where the
    motion cannot be followed.
    """
    stabilisation = Projection() if stabilisation is None else stabilisation
    grid, p = np.asarray(times, dtype=float), np.asarray(parameters, dtype=float)
    if grid.ndim != 1 or grid.size < 2 or not np.all(np.diff(grid) > 0):
        raise ValueError("times must be at least two, increasing")
    q, dq = np.asarray(q0, dtype=float), np.asarray(dq0, dtype=float)
    q, dq = consistent_state(Projector(mechanism), grid[0], q, dq, p)

    rate = _state_rate(stabilisation.mechanism(mechanism), formulation, controls)
    projector = stabilisation.projector(mechanism)
    start = time.perf_counter()
    states = (
        _unbroken(rate, grid, np.concatenate([q, dq]), p, tolerance)
        if projector is None
        else _projected(rate, projector, grid, np.concatenate([q, dq]), p, tolerance)
    )
    seconds = time.perf_counter() - start
    n = mechanism.q.numel()
    return Motion(mechanism, p, grid, states[:, :n], states[:, n:], seconds)


def _state_rate(
    m: Mechanism, formulation: Formulation, controls: SX | ArrayLike | None
) -> ca.Function:
    """(t, (q, q̇), p) -> (q̇, q̈)."""
    torques = _column(m.controls.numel(), controls)
    law = ca.Function("controls", [m.time, m.q, m.dq], [ca.densify(torques)])
    t, p = ca.MX.sym("t"), ca.MX.sym("p", m.parameters.numel())
    x = ca.MX.sym("x", 2 * m.q.numel())
    q, dq = ca.vertsplit(x, m.q.numel())
    ddq, _ = formulation.forward_dynamics(m)(t, q, dq, law(t, q, dq), p)
    return ca.Function("state_rate", [t, x, p], [ca.vertcat(dq, ddq)])


def _column(m: int, controls: SX | ArrayLike | None) -> SX:
    """The controls as an expression, m."""
    if controls is None:
        return SX.zeros(m)
    column = controls if isinstance(controls, SX) else SX(np.asarray(controls, dtype=float).ravel())
    if column.numel() != m:
        raise ValueError(f"{column.numel()} controls given, the mechanism has {m}")
    return column


def _unbroken(rate: ca.Function, grid: Array, state: Array, p: Array, tolerance: float) -> Array:
    """States at the grid's times, N × 2n, integrated in one go."""
    span = grid[-1] - grid[0]
    flow = _flow(rate, (grid[1:] - grid[0]) / span, tolerance)
    return np.vstack([state, _advance(flow, state, grid[0], span, p)])


def _projected(
    rate: ca.Function, projector: Projector, grid: Array, state: Array, p: Array, tolerance: float
) -> Array:
    """States at the grid's times, N × 2n, each projected before the next is integrated."""
    flow = _flow(rate, np.ones(1), tolerance)
    states = [state]
    for start, end in pairwise(grid):
        state = _advance(flow, states[-1], start, end - start, p)[0]
        q, dq = np.split(state, 2)
        states.append(np.concatenate(projector(end, q, dq, p)))
    return np.array(states)


def _flow(rate: ca.Function, fractions: Array, tolerance: float) -> ca.Function:
    """The integrator over a span of time, reporting at fractions of it."""
    x, p = ca.MX.sym("x", rate.size1_in(1)), ca.MX.sym("p", rate.size1_in(2))
    fraction, start, span = ca.MX.sym("fraction"), ca.MX.sym("start"), ca.MX.sym("span")
    ode: dict[str, Any] = {
        "t": fraction,
        "x": x,
        "p": ca.vertcat(start, span, p),
        "ode": span * rate(start + fraction * span, x, p),
    }
    options: dict[str, Any] = {
        "linear_multistep_method": "adams",
        "nonlinear_solver_iteration": "functional",
        "reltol": tolerance,
        "abstol": tolerance,
        "max_num_steps": MOST_STEPS,
        "disable_internal_warnings": True,
    }
    return ca.integrator("flow", "cvodes", ode, 0.0, list(fractions), options)


def _advance(flow: ca.Function, state: Array, start: float, span: float, p: Array) -> Array:
    """States at the flow's fractions of the span, N × 2n."""
    try:
        with requests_held():
            result = flow(x0=state, p=np.concatenate([[start, span], p]))["xf"]
    except RuntimeError as error:
        reason = re.search(r"CV_[A-Z_]+", str(error))
        raise IntegrationFailed(
            f"the motion could not be followed between t = {start:g} s and {start + span:g} s"
            f" ({reason.group() if reason else 'CVODES failed'}): a singular configuration"
            " on the way, or a tolerance beyond double precision"
        ) from None
    return np.asarray(result, dtype=float).T


class PreciseIntegrator:
    """An integrator by CVODES to 12 digits, for motions that have to be followed exactly.

    It advances a state over a stretch of time of a ``length`` in which the state's derivative
    ``rate`` is smooth and not stiff; state and time are in units in which they are of the order of
    one. ``u``: the fraction of the stretch that has passed. Any number of threads may call it.
    """

    def __init__(
        self, u: ca.MX, state: ca.MX, rate: ca.MX, length: ca.MX, parameters: ca.MX
    ) -> None:
        problem = {"t": u, "x": state, "p": parameters, "ode": length * rate}
        self._copies = Copies(lambda: ca.integrator("stretch", "cvodes", problem, 0, 1, _PRECISE))

    def __call__(self, state: Array, parameters: Array) -> Array:
        """The state after a stretch of time; not a number where CVODES fails."""
        with requests_held(), self._copies.one() as integrator:
            try:
                after = integrator(x0=state, p=parameters)["xf"]
            except RuntimeError:  # CasADi's only word for it
                return np.full(len(state), np.nan)
        return np.asarray(after.full()).ravel()
