"""Four ways to pose minimum time for a closed chain, one problem that serves them all.

    flat         ξ polynomial in time; Cᵀ (Q* + Q) = 0 at ξ's q, q̇, q̈           eq. (39)
    forward      ξ and τ polynomial; ξ̈ = forward dynamics of (ξ, ξ̇, τ) at the nodes
    explicit     q polynomial; Cᵀ (Q* + Q) = 0, loops closed by constraints      eq. (39)
    multiplier   q polynomial; Q* + Q + Jᵀ λ = 0, loops closed by constraints    eq. (37)

Solving for the products with J⁽ᵏ⁾⁻¹ in the explicit form by further unknowns w_k, with
J⁽ᵏ⁾ᵀ w_k = (Q* + Q)⁽ᵏ⁾, gives the multiplier form again, w = -λ: lifted, they are one.
Virtual work and Kane's method lead to eq. (39) too.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.mechanism import SX
from deltaopt.planning.closure import LoopClosure, closed
from deltaopt.planning.cost import FASTEST, Cost
from deltaopt.planning.nlp import Layout, PointFunction, Points, Program, RunningCost, Solution
from deltaopt.planning.system import RestToRest, System
from deltaopt.planning.transcription import PiecewiseAcceleration
from deltaopt.planning.variables import Variables
from deltaopt.trajectory import PiecewisePolynomial

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Equations:
    """A pose's equations for a system, differentiated once.

    ``coordinates``: indices of q that are polynomials. ``multipliers``: λ's among the
    algebraic unknowns. ``dynamics``: (X, V, A, τ[, λ], T), p -> rows that vanish.
    ``at_nodes``: whether torques are polynomials, given at the nodes, or free at all points.
    ``acceleration``: (X, V, A, T), p -> rows that vanish. ``speed``: rows of at most 1.
    ``opening``: rows that are not negative.
    """

    system: System
    coordinates: tuple[int, ...]
    multipliers: int
    dynamics: PointFunction
    at_nodes: bool = False
    speed: PointFunction | None = None
    opening: PointFunction | None = None
    closure: LoopClosure | None = None
    acceleration: PointFunction | None = None
    at_knots: PointFunction | None = None

    def derive(self) -> None:
        """Differentiate and compile all point functions now rather than when first needed."""
        for f in fields(self):
            value = getattr(self, f.name)
            if isinstance(value, PointFunction):
                _ = value.hessian

    def on(
        self, mesh: Array, transcription: PiecewiseAcceleration, cost: Cost = FASTEST
    ) -> ChainProblem:
        return ChainProblem(self, transcription, mesh, cost)


def flat_equations(system: System) -> Equations:
    u = system.units
    y, X, V, A, tau, T = _symbols(len(system.independent), system.motors)
    motion = _physical(u.q[list(system.independent)], X, V, A, u.time * T)
    rows = _in_units(system.equations(*motion, u.torque * tau, system.p), system)
    return Equations(
        system,
        system.independent,
        0,
        _named("equation (39)", y, system, rows),
        speed=_speed(system, minimal=True),
        opening=_opening(system, minimal=True),
    )


def forward_equations(system: System) -> Equations:
    m, u, nu = system.mechanism, system.units, len(system.independent)
    units = u.q[list(system.independent)]
    y, X, V, A, tau, T = _symbols(nu, system.motors)
    rest = SX.zeros(nu)
    x, v, _ = _physical(units, X, V, A, u.time * T)
    q, dq, _ = system.motion(x, v, rest, system.p)
    ddq, _ = Explicit().forward_dynamics(m).expand()(0, q, dq, u.torque * tau, m.parameters)
    rows = A - (u.time * T) ** 2 * ddq[list(system.independent)] / units
    return Equations(
        system,
        system.independent,
        0,
        _named("forward dynamics", y, system, rows),
        at_nodes=True,
        speed=_speed(system, minimal=True),
        opening=_opening(system, minimal=True),
    )


def explicit_equations(system: System, closure: LoopClosure) -> Equations:
    m, u = system.mechanism, system.units
    y, X, V, A, tau, T = _symbols(system.n, system.motors)
    motion = _physical(u.q, X, V, A, u.time * T)
    residual = Explicit().residual(m).expand()(0, *motion, u.torque * tau, m.parameters)
    dynamics = _named("equation (39)", y, system, _in_units(residual, system))
    return _redundant(system, closure, 0, dynamics)


def multiplier_equations(system: System, closure: LoopClosure) -> Equations:
    m, u, gamma = system.mechanism, system.units, system.constraints
    y, X, V, A, w, T = _symbols(system.n, system.motors + gamma)
    tau, lam = u.torque * w[: system.motors], u.energy / u.closure * w[system.motors :]
    motion = _physical(u.q, X, V, A, u.time * T)
    residual = Multiplier().residual(m)(0, *motion, tau, lam, m.parameters)
    dynamics = _named("equation (37)", y, system, residual * u.q / u.energy)
    return _redundant(system, closure, gamma, dynamics)


def _redundant(
    system: System, closure: LoopClosure, multipliers: int, dynamics: PointFunction
) -> Equations:
    """With loops closed at acceleration level at the nodes, and at the knots as asked."""
    m, u = system.mechanism, system.units
    y, X, V, A, _, _ = _symbols(system.n, 0)
    f, df, _ = closed(system, X, V)
    second = ca.Function("second", [m.q, m.dq, m.ddq, m.parameters], [m.J @ m.ddq + m.J_bias])
    ddf = second(u.q * X, u.q * V, u.q * A, m.parameters) / u.closure  # the same in any time
    rows = ddf + closure.feedback(f, df)
    return Equations(
        system,
        tuple(range(system.n)),
        multipliers,
        dynamics,
        speed=_speed(system, minimal=False),
        opening=_opening(system, minimal=False),
        closure=closure,
        acceleration=_named("loop closure at acceleration level", y, system, rows),
        at_knots=closure.at_knots(system),
    )


def _speed(system: System, *, minimal: bool) -> PointFunction | None:
    """Motor speeds over their limits, if there are any."""
    m, u = system.mechanism, system.units
    if u.speed is None:
        return None
    y, q, dq, T = _state(system, minimal=minimal)
    rate = ca.Function("rate", [m.q, m.dq, m.parameters], [m.B.T @ m.dq])
    rows = rate(q, dq, m.parameters) / (u.time * T * u.speed)
    return _named("motor speed", y, system, rows)


def _opening(system: System, *, minimal: bool) -> PointFunction | None:
    """What keeps the motion inside its assembly mode, if it can be left."""
    if system.openings.numel() == 0:
        return None
    y, q, _, _ = _state(system, minimal=minimal)
    return _named("assembly mode", y, system, system.inside(q, system.p))


def _state(system: System, *, minimal: bool) -> tuple[SX, SX, SX, SX]:
    """y = (X, V, A, T), q, q̇ (with time in units of the duration), T."""
    if not minimal:
        y, X, V, _, _, T = _symbols(system.n, 0)
        return y, system.units.q * X, system.units.q * V, T
    y, X, V, _, _, T = _symbols(len(system.independent), 0)
    units = system.units.q[list(system.independent)]
    q, dq, _ = system.motion(units * X, units * V, SX.zeros(X.numel()), system.p)
    return y, q, dq, T


def _in_units(residual: SX, system: System) -> SX:
    """Eq. (39): forces on ξ."""
    return residual * system.units.q[list(system.independent)] / system.units.energy


def _symbols(m: int, unknowns: int) -> tuple[SX, SX, SX, SX, SX, SX]:
    """y and its parts X, V, A (m each), algebraic unknowns, T."""
    y = SX.sym("y", 3 * m + unknowns + 1)
    return y, y[:m], y[m : 2 * m], y[2 * m : 3 * m], y[3 * m : -1], y[-1]


def _physical(units: SX, X: SX, V: SX, A: SX, T: SX) -> tuple[SX, SX, SX]:
    return units * X, units * V / T, units * A / T**2


def _named(name: str, y: SX, system: System, rows: SX) -> PointFunction:
    return PointFunction(name, ca.Function("rows", [y, system.p], [ca.cse(ca.densify(rows))]))


@dataclass(frozen=True)
class ChainProblem:
    """A pose's equations on a mesh of interval fractions (N,)."""

    equations: Equations
    transcription: PiecewiseAcceleration
    mesh: Array
    cost: Cost = FASTEST

    @cached_property
    def variables(self) -> Variables:
        e = self.equations
        return Variables(
            self.transcription,
            self.mesh,
            len(e.coordinates),
            self.transcription.nodes if e.at_nodes else self.transcription.points,
            e.system.motors + e.multipliers,
            e.closure.unknowns(e.system) if e.closure else 0,
        )

    @cached_property
    def program(self) -> Program:
        """Of least cost, the running one ∫ τᵀτ dt by Lobatto's rule at the nodes."""
        cost = np.zeros(self.variables.number)
        cost[-1] = self.cost.time
        running = self._effort() if self.cost.running else None
        return Program(cost, self._continuity, self._rows(), running=running)

    def _effort(self) -> RunningCost:
        e, v, t = self.equations, self.variables, self.transcription
        y, _, _, _, w, T = _symbols(v.components, v.unknowns)
        m = e.system.motors
        rate = _named("effort", y, e.system, T * ca.sumsqr(e.system.units.torque * w[:m]))
        points = self._points(rate, v.points, algebraic=True)
        weights = np.zeros((v.intervals, len(v.points)))
        weights[:, np.searchsorted(v.points, t.nodes)] = self.mesh[:, None] * t.quadrature
        return RunningCost(points, self.cost.running * weights.ravel())

    def _rows(self) -> list[Points]:
        """Dynamics; then what the pose has of closures and openings, and speed last."""
        e, v, t = self.equations, self.variables, self.transcription
        rows = [self._points(e.dynamics, v.points, algebraic=True)]
        if e.acceleration is not None:
            rows.append(self._points(e.acceleration, t.nodes))
        if e.at_knots is not None:
            size = e.at_knots.function.size1_out(0)
            zero = np.zeros(size)
            rows.append(Points(e.at_knots, v.ends(), zero, zero, v.knots[1:]))
        if e.opening is not None:
            rows.append(self._points(e.opening, t.points, upper=np.inf))
        if e.speed is not None:
            rows.append(self._points(e.speed, t.points, lower=-1.0, upper=1.0))
        return rows

    def _points(
        self,
        function: PointFunction,
        c: Array,
        *,
        algebraic: bool = False,
        lower: float = 0.0,
        upper: float = 0.0,
    ) -> Points:
        one = np.ones(function.function.size1_out(0))
        layout = self.variables.at(c, algebraic=algebraic)
        return Points(function, layout, lower * one, upper * one, self.variables.fractions(c))

    @cached_property
    def _continuity(self) -> Layout:
        e = self.equations
        which = e.coordinates
        if e.closure is not None:
            which = e.closure.continuous(e.system)
        places = tuple(e.coordinates.index(i) for i in which)
        return self.variables.continuity(places)

    def pack(self, position: PiecewisePolynomial, task: RestToRest) -> Array:
        """The variables that describe a motion of ξ (m, rad and s) on this mesh, torques within
        their limits. Raises DependentConstraints."""
        self.equations.system.require_independent_constraints(task)
        v = self.variables
        motion = _Motion(self.equations.system, position, task.p)
        units, T = motion.units, motion.duration
        which = list(self.equations.coordinates)
        X, V, _ = (part[:, which] / units.q[which] for part in motion.at(v.knots))
        A = motion.at(_inside(v, self.transcription.nodes))[2][:, which] / units.q[which]
        tau, lam = motion.forces(_inside(v, v.points))
        w = np.clip(tau / units.torque, -1, 1)
        if self.equations.multipliers:
            w = np.hstack([w, lam * units.closure / units.energy])
        return v.pack(X, V * T, A * T**2, w, T / units.time)

    def unpack(self, z: Array, task: RestToRest) -> PiecewisePolynomial:
        """What is polynomial of q, (N, degree + 3, m or ν), in m, rad and s."""
        units = units_at(self.equations.system, task.p)
        T = z[-1] * units.time
        coefficients = self.variables.coefficients(z) * units.q[list(self.equations.coordinates)]
        coefficients /= T ** np.arange(coefficients.shape[1])[:, None]
        return PiecewisePolynomial(T * self.variables.knots, coefficients)

    def torques(self, z: Array, task: RestToRest) -> Array:
        """τ at the points that have them, (N, points, motors), N·m."""
        limits = units_at(self.equations.system, task.p).torque
        return self.variables.algebraic(z)[:, :, : self.equations.system.motors] * limits

    def bounds(self, task: RestToRest, share: Array | float = 1.0) -> tuple[Array, Array]:
        """All of q at rest at the start, ξ at rest at the goal: what follows is not fixed twice.
        Torques within a share of their limits, (N, 1, m), a positive or the given duration."""
        system, v = self.equations.system, self.variables
        which = list(self.equations.coordinates)
        q = units_at(system, task.p).q
        upper = np.full(v.number, np.inf)
        limits = np.full((v.intervals, 1, v.unknowns), np.inf)
        limits[:, :, : system.motors] = share
        v.set_algebraic(upper, limits)
        lower, m = -upper, v.components
        start = (system.coordinates(task.start, task.p) / q)[which]
        lower[: 2 * m] = upper[: 2 * m] = np.concatenate([start, np.zeros(m)])
        last = v.number - 2 * m - 1
        for i, goal in zip(system.independent, task.goal, strict=True):
            place = last + which.index(i)
            lower[place] = upper[place] = goal / q[i]
            lower[place + m] = upper[place + m] = 0.0
        lower[-1] = 1e-3
        if self.cost.duration_is_given:
            lower[-1] = upper[-1] = 1.0
        return lower, upper

    def prices(self, solution: Solution) -> Array:
        """Fraction of the duration per fraction of a limit, (N, points, m or 2 m): torques, then
        limited speeds; positive at the upper limit, negative at the lower."""
        v, N, points = self.variables, self.variables.intervals, self.transcription.points
        m = self.equations.system.motors
        torque = np.zeros((N, len(points), m))
        torque[:, np.searchsorted(points, v.points)] = v.algebraic(solution.bound_multipliers)[
            :, :, :m
        ]
        parts = [torque]
        if self.equations.speed is not None:
            speed = solution.row_multipliers[-N * len(points) * m :]
            parts.append(speed.reshape(N, len(points), m))
        return np.asarray(np.concatenate(parts, axis=2) / solution.z[-1])


@dataclass(frozen=True)
class UnitValues:
    """``Units`` as numbers."""

    q: Array
    closure: Array
    time: float
    energy: float
    torque: Array


def units_at(system: System, p: Array) -> UnitValues:
    q, closure, time, energy, torque = (
        np.asarray(r.full()).ravel() for r in system.magnitudes.call([ca.DM(p)])
    )
    return UnitValues(q, closure, float(time[0]), float(energy[0]), torque)


@dataclass(frozen=True)
class _Motion:
    """A motion of ξ, and all that follows from it."""

    system: System
    position: PiecewisePolynomial
    p: Array

    @property
    def duration(self) -> float:
        return float(self.position.knots[-1])

    @property
    def units(self) -> UnitValues:
        return units_at(self.system, self.p)

    def at(self, fractions: Array) -> tuple[Array, ...]:
        """q, q̇, q̈, (N, n) each, at fractions of the duration."""
        return self.system.rows(self.system.motion, *self._xi(fractions), p=self.p)

    def forces(self, fractions: Array) -> tuple[Array, ...]:
        """τ (N, m), λ (N, γ)."""
        return self.system.rows(self.system.inverse_dynamics, *self._xi(fractions), p=self.p)

    def _xi(self, fractions: Array) -> list[Array]:
        velocity = self.position.derivative()
        parts = (self.position, velocity, velocity.derivative())
        return [part.at(fractions * self.duration) for part in parts]


def _inside(v: Variables, c: Array) -> Array:
    """Fractions of the duration at fractions c of the intervals, ends from just inside."""
    return v.fractions(np.clip(c, 1e-9, 1 - 1e-9))
