"""The formulations of the planning problem that a user chooses from, as values: the equations of
each at a point, for any closed-loop mechanism.

    flat         ξ polynomial in time; Cᵀ (Q* + Q) = 0 at ξ's q, q̇, q̈           eq. (39)
    forward      ξ and τ polynomial; ξ̈ = forward dynamics of (ξ, ξ̇, τ) at the nodes
    explicit     q polynomial; Cᵀ (Q* + Q) = 0, loops closed by constraints      eq. (39)
    multiplier   q polynomial; Q* + Q + Jᵀ λ = 0, loops closed by constraints    eq. (37)

If the products with J⁽ᵏ⁾⁻¹ in the explicit form become unknowns w_k of their own, with
J⁽ᵏ⁾ᵀ w_k = (Q* + Q)⁽ᵏ⁾, the multiplier form results, with w = -λ. Virtual work and Kane's method
lead to eq. (39) too.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import lru_cache
from typing import ClassVar

import casadi as ca

from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.mechanism import SX
from deltaopt.errors import Unusable
from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.functions import Functions
from deltaopt.planning.flat.equations import point_equations
from deltaopt.planning.flat.flat_problem import compiled_flat
from deltaopt.planning.formulations.collocation import (
    CollocationProblem,
    Equations,
    RowsOfOrder,
    named,
    symbols,
)
from deltaopt.planning.formulations.delta import DeltaProblem, scaled_delta
from deltaopt.planning.formulations.loop_closure import KnotConstraints, LoopClosure, closed
from deltaopt.planning.formulations.scaled_mechanism import ScaledMechanism
from deltaopt.planning.nlp.points import PointFunction
from deltaopt.planning.nlp.problem import FASTEST, Cost, Formulated, InteriorPoint, Ipopt, Solver
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration

_EXPLICIT = "dynamics, equation (39) for independent coordinate"


class ProblemFormulation(ABC):
    """A way to write the planning problem as a nonlinear program.

    Its differential equations hold at the nodes of every interval. It is a hashable value, so that
    equal formulations share their equations. ``solvers``: kinds of solver that can be asked for,
    the default first.
    """

    solvers: ClassVar[tuple[type[Solver], ...]] = (Ipopt,)

    @property
    @abstractmethod
    def name(self) -> str:
        """The name that a plan reports: "explicit, constraints at knots"."""

    def of(
        self,
        functions: Functions,
        transcription: PiecewiseAcceleration,
        constraints: Constraints,
        cost: Cost = FASTEST,
        solver: Solver | None = None,
    ) -> Formulated:
        """Its equations for a mechanism under limits, for one of its solvers, or for the default.

        ``cost``: what is minimised; the rate of its running part is τᵀτ, N²m². They are for Ipopt
        too without a C compiler, and for accelerations that are not linear in every interval.
        Raises Unusable for limits of order 3 then.
        """
        kind = self.solvers[0] if solver is None else type(solver)
        if kind is InteriorPoint and (constraints.order == 3 or transcription.degree == 1):
            own = compiled_flat(point_equations(functions, constraints), transcription, cost)
            if own is not None:
                return own
        if constraints.order == 3:
            raise Unusable(
                "limits and costs of jerk or torque rate are planned by deltaopt's own method "
                "alone: in the flat formulation, with a C compiler"
            )

        def on(mesh: Array) -> DeltaProblem:
            equations = _equations(self, functions, constraints)
            return DeltaProblem(CollocationProblem(equations, transcription, mesh, cost))

        return on

    @abstractmethod
    def equations(self, system: ScaledMechanism) -> Equations:
        """Its equations for any scaled mechanism."""


@dataclass(frozen=True)
class Flat(ProblemFormulation):
    """The formulation in the platform's coordinates alone, which is the default."""

    name: str = "flat"
    solvers: ClassVar[tuple[type[Solver], ...]] = (InteriorPoint, Ipopt)

    def equations(self, system: ScaledMechanism) -> Equations:
        """Eq. (39) for the motion of ξ at all points of an interval."""
        u = system.units
        y, X, V, A, tau, T = symbols(len(system.independent), system.motors)
        motion = _physical(u.q[list(system.independent)], X, V, A, u.time * T)
        rows = _in_units(system.equations(*motion, u.torque * tau, system.p), system)
        return _minimal(system, named(_EXPLICIT, y, system, rows), at_nodes=False)


@dataclass(frozen=True)
class Redundant(ProblemFormulation):
    """The formulation in all twelve coordinates, which are polynomials under loop closure.

    ``formulation``: of the dynamics. With ``Multiplier`` it is eq. (37), with any other eq. (39),
    for virtual work and Kane's method lead to the same three equations as the explicit form.
    ``closure``: how drift of the loops is prevented.

    Examples:
        >>> deltaopt.Redundant(deltaopt.multiplier).name
        'multiplier, constraints at knots'
    """

    formulation: Formulation
    closure: LoopClosure = field(default_factory=KnotConstraints)

    @property
    def name(self) -> str:
        kind = "multiplier" if isinstance(self.formulation, Multiplier) else "explicit"
        return f"{kind}, {self.closure.name}"

    def equations(self, system: ScaledMechanism) -> Equations:
        """Its equations for any scaled mechanism."""
        if isinstance(self.formulation, Multiplier):
            return _multiplier_equations(system, self.closure)
        return _explicit_equations(system, self.closure)


@dataclass(frozen=True)
class Forward(ProblemFormulation):
    """The formulation in the platform's coordinates with polynomial torques as controls.

    Collocation demands that the accelerations are those of forward dynamics at the nodes.
    """

    name: str = "forward"

    def equations(self, system: ScaledMechanism) -> Equations:
        """ξ̈ is that of forward dynamics at the nodes."""
        m, u, nu = system.mechanism, system.units, len(system.independent)
        units = u.q[list(system.independent)]
        y, X, V, A, tau, T = symbols(nu, system.motors)
        rest = SX.zeros(nu)
        x, v, _ = _physical(units, X, V, A, u.time * T)
        q, dq, _ = system.motion(x, v, rest, system.p)
        ddq, _ = Explicit().forward_dynamics(m).expand()(0, q, dq, u.torque * tau, m.parameters)
        rows = A - (u.time * T) ** 2 * ddq[list(system.independent)] / units
        dynamics = named("forward dynamics of independent coordinate", y, system, rows)
        return _minimal(system, dynamics, at_nodes=True)


@lru_cache(maxsize=16)
def _equations(
    formulation: ProblemFormulation, functions: Functions, constraints: Constraints
) -> Equations:
    return formulation.equations(scaled_delta(functions, constraints))


def _minimal(system: ScaledMechanism, dynamics: PointFunction, *, at_nodes: bool) -> Equations:
    """The equations in ξ alone."""
    limits = _limits(system, minimal=True)
    return Equations(system, system.independent, 0, dynamics, at_nodes, limits)


def _explicit_equations(system: ScaledMechanism, closure: LoopClosure) -> Equations:
    """The explicit formulation: eq. (39) for polynomials of all coordinates q."""
    m, u = system.mechanism, system.units
    y, X, V, A, tau, T = symbols(system.n, system.motors)
    motion = _physical(u.q, X, V, A, u.time * T)
    residual = Explicit().residual(m).expand()(0, *motion, u.torque * tau, m.parameters)
    dynamics = named(_EXPLICIT, y, system, _in_units(residual, system))
    return _redundant(system, closure, 0, dynamics)


def _multiplier_equations(system: ScaledMechanism, closure: LoopClosure) -> Equations:
    """The multiplier formulation: eq. (37) for polynomials of all coordinates q."""
    m, u, gamma = system.mechanism, system.units, system.constraints
    y, X, V, A, w, T = symbols(system.n, system.motors + gamma)
    tau, lam = u.torque * w[: system.motors], u.energy / u.closure * w[system.motors :]
    motion = _physical(u.q, X, V, A, u.time * T)
    residual = Multiplier().residual(m)(0, *motion, tau, lam, m.parameters)
    dynamics = named("dynamics, equation (37) for coordinate", y, system, residual * u.q / u.energy)
    return _redundant(system, closure, gamma, dynamics)


def _redundant(
    system: ScaledMechanism, closure: LoopClosure, multipliers: int, dynamics: PointFunction
) -> Equations:
    """The equations in redundant coordinates, which both forms of the dynamics share.

    Loops close at acceleration level at the nodes, and at the knots as ``closure`` says.
    """
    m, u = system.mechanism, system.units
    y, X, V, A, _, _ = symbols(system.n, 0)
    f, df, _ = closed(system, X, V)
    second = ca.Function("second", [m.q, m.dq, m.ddq, m.parameters], [m.J @ m.ddq + m.J_bias])
    # Whatever the unit of time is.
    ddf = second(u.q * X, u.q * V, u.q * A, m.parameters) / u.closure
    rows = ddf + closure.feedback(f, df)
    return Equations(
        system,
        tuple(range(system.n)),
        multipliers,
        dynamics,
        at_nodes=True,
        limits=_limits(system, minimal=False, multipliers=multipliers),
        closure=closure,
        acceleration=named("loop closure at acceleration level, constraint", y, system, rows),
        at_knots=closure.at_knots(system),
    )


def _limits(
    system: ScaledMechanism, *, minimal: bool, multipliers: int = 0
) -> tuple[RowsOfOrder, ...]:
    """The constraint rows that are not bounds on a single torque, by order.

    ``minimal``: whether ξ is the only motion among the unknowns; otherwise all of q is.
    ``multipliers``: number of the λ among the unknowns, after the torques.
    """
    which = list(system.independent) if minimal else list(range(system.n))
    y, X, V, A, w, T = symbols(len(which), system.motors + multipliers)
    tau = w[: system.motors]
    q, dq, ddq = _physical(system.units.q[which], X, V, A, system.units.time * T)
    function = system.limits.of_independent if minimal else system.limits.function
    if function is None:
        function = system.limits.function
        q, dq, ddq = system.motion(q, dq, ddq, system.p)
    rows = function(q, dq, ddq, system.units.torque * tau, system.p)
    found = []
    for order in (0, 1, 2):
        own = system.limits.of_order(order)
        if own:
            with_torque = bool(ca.jacobian(rows[own], tau).nnz())
            inputs = y if with_torque else ca.vertcat(X, V, A, T)
            name = f"limit of order {order}, row"
            function = ca.Function("rows", [inputs, system.p], [ca.cse(ca.densify(rows[own]))])
            found.append(RowsOfOrder(order, tuple(own), PointFunction(name, function), with_torque))
    return tuple(found)


def _in_units(residual: SX, system: ScaledMechanism) -> SX:
    """Eq. (39), generalized forces on ξ, in units of energy over those of ξ."""
    return residual * system.units.q[list(system.independent)] / system.units.energy


def _physical(units: SX, X: SX, V: SX, A: SX, T: SX) -> tuple[SX, SX, SX]:
    return units * X, units * V / T, units * A / T**2
