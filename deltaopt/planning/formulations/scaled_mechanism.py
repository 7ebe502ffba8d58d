"""Scaled mechanisms: a mechanism with closed-form kinematics, its limits and its units.

Every formulation is written for such a mechanism and its independent coordinates ξ, so that the
Delta and the five-bar share the code of all formulations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeVar

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import evaluate_rows
from deltaopt.curves.piecewise import Array, Index, Truths
from deltaopt.dynamics.constraint_matrix import ClosedForm
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.mechanism import SX, Mechanism

Quantity = TypeVar("Quantity")


@dataclass(frozen=True)
class ScaledUnits(Generic[Quantity]):
    """The units that bring variables and equations to the order of one: expressions, or numbers.

    ``q``: of the coordinates, n. ``closure``: of the constraints f, γ. ``time``: s. ``energy``: J;
    the unit of a generalized force is that of energy over that of its coordinate. ``torque``: of
    the motors, m, N·m. ``motors``: their weights in a weighted effort, 1/(N²m²); none elsewhere.
    """

    q: Quantity
    closure: Quantity
    time: Quantity
    energy: Quantity
    torque: Quantity
    motors: Quantity


@dataclass(frozen=True)
class LimitRows:
    """Normalised constraint rows of a mechanism: lower bounds at -1, upper bounds at 1.

    ``function``: (q, q̇, q̈, τ, p) -> rows, p as of ``ScaledMechanism``. ``of_independent``: (ξ, ξ̇,
    ξ̈, τ, p) -> rows, if there is a simpler form than through q. ``orders``: of each row, 0 for
    positions to 2 for torques. ``sides``: whether it has a lower and an upper bound, (rows, 2).
    ``is_control``: rows that are a torque in its unit, in the order of the motors.
    """

    function: ca.Function
    orders: Index
    sides: Truths
    is_control: Truths
    of_independent: ca.Function | None = None

    @property
    def number(self) -> int:
        """How many rows."""
        return len(self.orders)

    def of_order(self, order: int) -> list[int]:
        """Indices of the rows of an order that are no bounds on one torque."""
        return [int(i) for i in np.flatnonzero((self.orders == order) & ~self.is_control)]


@dataclass(frozen=True)
class BoundaryValues:
    """The boundary values of a motion.

    ``p``: values of the parameters of the scaled mechanism. ``start``, ``goal``: ξ there, (ν,), the
    goal at the time 0 where it moves. ``rates``: ξ̇ there, (2, ν). ``drift``: the rate at which the
    goal itself moves, (ν,). ``free``: components of the goal that are not given, (ν,).
    """

    p: Array
    start: Array
    goal: Array
    rates: Array | float = 0.0
    drift: Array | float = 0.0
    free: Truths | bool = False


@dataclass(frozen=True)
class ScaledMechanism:
    """A fully actuated mechanism with closed-form kinematics, with its limits and units.

    ``independent``: indices of ξ among q; the mechanism's ``closed_form`` is for δξ.
    ``kinematics``: (ξ, mechanism's parameters) -> q, n. ``scales``: symbols on which the ``units``
    depend beside the mechanism's parameters. ``limits``: its constraint rows. ``explicit``: eq.
    (39) as (ξ, ξ̇, ξ̈, τ, mechanism's parameters) -> ν, if there is a simpler form than through q.
    """

    mechanism: Mechanism
    independent: tuple[int, ...]
    kinematics: ca.Function
    scales: SX
    units: ScaledUnits[SX]
    limits: LimitRows
    explicit: ca.Function | None = None

    @cached_property
    def p(self) -> SX:
        """The parameters of a program: ``scales``, then the mechanism's."""
        return ca.vertcat(self.scales, self.mechanism.parameters)

    @property
    def n(self) -> int:
        """The number of coordinates q."""
        return int(self.mechanism.q.numel())

    @property
    def motors(self) -> int:
        """The number m of motors."""
        return int(self.mechanism.controls.numel())

    @property
    def constraints(self) -> int:
        """The number γ of constraints."""
        return int(self.mechanism.mu.numel())

    @cached_property
    def motion(self) -> ca.Function:
        """(ξ, ξ̇, ξ̈, p) -> q, q̇, q̈ (n each): q̇ = C ξ̇, q̈ = C ξ̈ - P (J̇ q̇ + μ̇)."""
        m, x = self.mechanism, [SX.sym(name, len(self.independent)) for name in ("x", "v", "a")]
        q = self.kinematics(x[0], m.parameters)
        C, P = ClosedForm().function(m)(0, q, m.parameters)
        dq = C @ x[1]
        bias = ca.Function("bias", [m.q, m.dq, m.parameters], [m.J_bias])(q, dq, m.parameters)
        return ca.Function("motion", [*x, self.p], [q, dq, C @ x[2] - P @ bias])

    @cached_property
    def equations(self) -> ca.Function:
        """(ξ, ξ̇, ξ̈, τ, p) -> Cᵀ (Q* + Q), ν, zero where the motion obeys eq. (39)."""
        m, nu = self.mechanism, len(self.independent)
        x, tau = [SX.sym(name, nu) for name in ("x", "v", "a")], SX.sym("tau", self.motors)
        if self.explicit is not None:
            rows = self.explicit(*x, tau, m.parameters)
        else:
            motion = self.motion(*x, self.p)
            rows = Explicit().residual(m).expand()(0, *motion, tau, m.parameters)
        return ca.Function("equations", [*x, tau, self.p], [rows])

    @cached_property
    def inverse_dynamics(self) -> ca.Function:
        """(ξ, ξ̇, ξ̈, p) -> τ (m), λ (γ)."""
        m, x = self.mechanism, [SX.sym(name, len(self.independent)) for name in ("x", "v", "a")]
        inverse = Explicit().inverse_dynamics(m).expand()
        results = inverse(0, *self.motion(*x, self.p), m.parameters)
        return ca.Function("inverse_dynamics", [*x, self.p], list(results))

    def units_at(self, p: Array) -> ScaledUnits[Array]:
        """The units for values p of the parameters."""
        return ScaledUnits(*(np.squeeze(unit.full()) for unit in self._units_of_p(p)))

    @cached_property
    def _units_of_p(self) -> ca.Function:
        return ca.Function("units", [self.p], list(vars(self.units).values()))

    def rows(self, function: ca.Function, *columns: Array, p: Array) -> tuple[Array, ...]:
        """Evaluate a function of (column …, p) for N rows of each: (N, i) each -> (N, o) each."""
        return evaluate_rows(function, *columns, parameters=p)

    def coordinates(self, xi: Array, p: Array) -> Array:
        """The coordinates q, (n,), for the independent ones ξ, (ν,)."""
        q = self.kinematics(xi, p[self.scales.numel() :])
        return np.asarray(q.full()).ravel()
