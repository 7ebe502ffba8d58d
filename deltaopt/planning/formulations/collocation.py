"""Direct collocation of a closed-loop mechanism: one problem on a mesh for every formulation.

    minimise T + ε Σ_i η_i ∫ (dτ/dc)² dc   over the interval i, c from 0 to 1, τ over its limits

subject to a formulation's equations (see ``choice``), limits and boundary values. The sum is a
regularisation: in an interval where a torque switches, its values at the points can be exchanged
for one another at less than 1e-6 of the duration, along directions where the cost is flat or
slightly concave, and Ipopt needs tens of iterations to follow them. With ε the cost has a minimum
along them. It costs nothing where torques jump at knots only, and a motion without such ramps
exceeds its limits less between points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.dynamics.mechanism import SX
from deltaopt.planning.formulations.loop_closure import LoopClosure
from deltaopt.planning.formulations.scaled_mechanism import (
    BoundaryValues,
    ScaledMechanism,
)
from deltaopt.planning.nlp.points import Layout, PointFunction, Points
from deltaopt.planning.nlp.problem import FASTEST, Cost, effort_of
from deltaopt.planning.nlp.program import (
    OF_EFFORT,
    IpoptProgram,
    IpoptSolution,
    Options,
    RunningCost,
)
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.planning.nlp.variables import Variables

REGULARISATION = 1e-3
"""ε above, relative to the duration. A larger one saves iterations; this one changes durations by
less than 3e-5 once knots lie at the switches."""

FAR: Options = {"ipopt.mumps_pivtol": 1e-3}
"""Options of Ipopt for a guess that is not a solution. With Ipopt's pivot tolerance of 1e-6 MUMPS
miscounts the signs of the eigenvalues in redundant coordinates on fine meshes, and Ipopt then
regularises a matrix that needs no regularisation."""
NEAR: Options = {
    **FAR,
    "ipopt.mu_strategy": "monotone",
    "ipopt.mu_init": 1e-6,
    "ipopt.bound_mult_init_method": "mu-based",
    "ipopt.bound_push": 1e-5,
    "ipopt.bound_frac": 1e-5,
    "ipopt.slack_bound_push": 1e-5,
    "ipopt.slack_bound_frac": 1e-5,
}
"""Options of Ipopt for a guess that solves the mesh before. With this barrier parameter the
barrier adds some 1e-3 of the duration (the parameter times the number of bounds), about the error
of a coarse mesh. Ipopt's own initial point moves torques so far from their limits that the duration
grows tenfold before it falls again."""


@dataclass(frozen=True)
class RowsOfOrder:
    """The constraint rows of one order, such as all velocity limits.

    ``rows``: their indices among the rows of the limits. ``function``: (X, V, A[, τ …], T), p ->
    rows. ``with_torque``: whether torques are among its arguments.
    """

    order: int
    rows: tuple[int, ...]
    function: PointFunction
    with_torque: bool


@dataclass(frozen=True)
class Equations:
    """A formulation's equations for a mechanism, differentiated once.

    ``coordinates``: indices of those coordinates of q that are polynomials. ``multipliers``: number
    of the λ among the algebraic unknowns. ``dynamics``: (X, V, A, τ[, λ], T), p -> rows that must
    vanish. ``at_nodes``: whether dynamics and limits are imposed at the nodes only, where the
    torques are polynomials of the same degree and the loops close, or at all points of an interval,
    where the torque follows from the path. ``limits``: rows within their bounds. ``closure``: of
    the loops, if q is redundant. ``acceleration``: (X, V, A, T), p -> rows that must vanish, loop
    closure at acceleration level. ``at_knots``: rows of the closure that must vanish at the knots.
    """

    system: ScaledMechanism
    coordinates: tuple[int, ...]
    multipliers: int
    dynamics: PointFunction
    at_nodes: bool = False
    limits: tuple[RowsOfOrder, ...] = ()
    closure: LoopClosure | None = None
    acceleration: PointFunction | None = None
    at_knots: PointFunction | None = None


def symbols(m: int, unknowns: int) -> tuple[SX, SX, SX, SX, SX, SX]:
    """Symbols for y and its parts X, V, A (m each), the algebraic unknowns and T."""
    y = SX.sym("y", 3 * m + unknowns + 1)
    return y, y[:m], y[m : 2 * m], y[2 * m : 3 * m], y[3 * m : -1], y[-1]


def named(name: str, y: SX, system: ScaledMechanism, rows: SX) -> PointFunction:
    """The point function (y, parameters of the mechanism) -> rows, which errors call ``name``."""
    return PointFunction(name, ca.Function("rows", [y, system.p], [ca.cse(ca.densify(rows))]))


@dataclass(frozen=True)
class CollocationProblem:
    """A formulation's equations on a mesh of interval lengths, (N,), fractions of the duration.

    ``regularisation``: the ε of this module's problem.
    """

    equations: Equations
    transcription: PiecewiseAcceleration
    mesh: Array
    cost: Cost = FASTEST
    regularisation: float = REGULARISATION

    @cached_property
    def variables(self) -> Variables:
        """The variables of the problem."""
        e = self.equations
        return Variables(
            self.transcription,
            self.mesh,
            len(e.coordinates),
            self.transcription.nodes if e.at_nodes else self.transcription.points,
            e.system.motors + e.multipliers,
            e.closure.unknowns(e.system) if e.closure else 0,
        )

    def program(self, options: Options, ends: BoundaryValues | None = None) -> IpoptProgram:
        """The nonlinear program with these options of Ipopt, for ``ends`` that may move.

        A cost that contains effort is strictly convex in the torques and needs no regularisation.
        """
        cost = np.zeros(self.variables.number)
        cost[-1] = self.cost.time
        running = self._effort() if self.cost.running else self._torque_variation()
        options = {**OF_EFFORT, **options} if self.cost.running else options
        rows = self._rows() if ends is None else [*self._moving_ends(ends), *self._rows()]
        return IpoptProgram(cost, self._continuity, rows, options, running)

    def _moving_ends(self, ends: BoundaryValues) -> list[Points]:
        """The rows of velocities and places that are not fixed as variables, for they change with
        the duration: V - T · rate = 0 and, of a goal that drifts, X - T · drift = goal."""
        system, v = self.equations.system, self.variables
        units, m, nu = system.units_at(ends.p), v.components, len(system.independent)
        which, last = self.equations.coordinates, v.number - 2 * m - 1
        at_goal = [which.index(i) for i in system.independent]
        rates, drift = np.broadcast_to(ends.rates, (2, nu)), np.broadcast_to(ends.drift, nu)
        motion = system.rows(
            system.motion, ends.start[None], rates[:1], np.zeros((1, nu)), p=ends.p
        )
        leaving = motion[1][0, list(which)]
        asked = [
            (np.arange(m), m, leaving, np.zeros(m)),
            (np.array(at_goal), last + m, rates[1], np.zeros(nu)),
            (np.array(at_goal), last, drift, ends.goal),
        ]
        found = []
        for coordinates, first, rate, value in asked:
            if rate.any():
                own = units.q[list(which)][coordinates]
                columns = np.column_stack([first + coordinates, np.full(len(own), v.number - 1)])
                weights = np.column_stack([np.ones(len(own)), -rate * units.time / own])
                y = SX.sym("y", len(own))
                same = named("end that moves, coordinate", y, system, y)
                found.append(Points(same, Layout(columns, weights), value / own, value / own))
        return found

    def _torque_variation(self) -> RunningCost | None:
        """The regularisation ε Σ_i η_i ∫ (dτ/dc)² dc, with torques linear between their points."""
        if self.regularisation == 0:
            return None
        system, v = self.equations.system, self.variables
        y = SX.sym("y", 2 * system.motors)
        before, after = ca.vertsplit(y, system.motors)
        change = named("change of torque", y, system, ca.sumsqr(after - before))
        weights = self.regularisation * v.mesh[:, None] / np.diff(v.points)
        bound = np.zeros(1)
        points = Points(change, v.changes(system.motors), bound, bound)
        return RunningCost(points, weights.ravel())

    def _effort(self) -> RunningCost:
        """The effort ∫ τᵀτ dt by Lobatto's rule at the nodes."""
        e, v, t = self.equations, self.variables, self.transcription
        y, _, _, _, w, T = symbols(v.components, v.unknowns)
        units = e.system.units
        tau = units.torque * w[: e.system.motors]
        rate = named("effort", y, e.system, T * effort_of(tau, units.motors))
        points = self._points(rate, v.points, algebraic=True)
        weights = np.zeros((v.intervals, len(v.points)))
        weights[:, np.searchsorted(v.points, t.nodes)] = self.mesh[:, None] * t.quadrature
        return RunningCost(points, self.cost.running * weights.ravel())

    def _rows(self) -> list[Points]:
        """All nonlinear rows: dynamics, then those of loop closure, then the limits by order."""
        e, v, t = self.equations, self.variables, self.transcription
        rows = [self._points(e.dynamics, v.points, algebraic=True)]
        if e.acceleration is not None:
            rows.append(self._points(e.acceleration, t.nodes))
        if e.at_knots is not None:
            size = e.at_knots.function.size1_out(0)
            zero = np.zeros(size)
            rows.append(Points(e.at_knots, v.ends(), zero, zero, v.knots[1:]))
        for each in e.limits:
            sides = e.system.limits.sides[list(each.rows)]
            lower = np.where(sides[:, 0], -1.0, -np.inf)
            upper = np.where(sides[:, 1], 1.0, np.inf)
            c = self._fractions(each)
            layout = v.at(c, algebraic=each.with_torque)
            rows.append(Points(each.function, layout, lower, upper, v.fractions(c)))
        return rows

    def _fractions(self, limits: RowsOfOrder) -> Array:
        """Fractions of an interval where the rows of an order are imposed.

        Where dynamics hold at the nodes, those of velocities are fewer;
        ``PiecewiseAcceleration.velocity_points`` says why.
        """
        fewer = limits.order == 1 and self.equations.at_nodes
        return self.transcription.velocity_points if fewer else self.variables.points

    def _points(self, function: PointFunction, c: Array, *, algebraic: bool = False) -> Points:
        """Rows that must vanish at fractions c of every interval."""
        zero = np.zeros(function.function.size1_out(0))
        layout = self.variables.at(c, algebraic=algebraic)
        return Points(function, layout, zero, zero, self.variables.fractions(c))

    @cached_property
    def _continuity(self) -> Layout:
        e = self.equations
        which = e.coordinates
        if e.closure is not None:
            which = e.closure.continuous(e.system)
        places = tuple(e.coordinates.index(i) for i in which)
        return self.variables.continuity(places)

    def pack(self, position: PiecewisePolynomial, ends: BoundaryValues) -> Array:
        """The variables that approximate a motion of ξ (m, rad and s) on this mesh; torques are
        clipped to their limits."""
        system, v = self.equations.system, self.variables
        units, T = system.units_at(ends.p), float(position.knots[-1])

        def at(function: ca.Function, fractions: Array) -> tuple[Array, ...]:
            xi = [position.at(fractions * T, order) for order in range(3)]
            return system.rows(function, *xi, p=ends.p)

        which = list(self.equations.coordinates)
        X, V, _ = (part[:, which] / units.q[which] for part in at(system.motion, v.knots))
        nodes = _inside(v, self.transcription.nodes)
        A = at(system.motion, nodes)[2][:, which] / units.q[which]
        V, A = V * T, A * T**2
        if self.equations.closure is None:  # or it may leave the workspace shortly before a goal
            A = v.continuous(X, V, A)
        tau, lam = at(system.inverse_dynamics, _inside(v, v.points))
        w = np.clip(tau / units.torque, -1, 1)
        if self.equations.multipliers:
            w = np.hstack([w, lam * units.closure / units.energy])
        return v.pack(X, V, A, w, float(T / units.time))

    def unpack(self, z: Array, ends: BoundaryValues) -> PiecewisePolynomial:
        """The polynomials of the coordinates that the variables describe, in m, rad and s."""
        units = self.equations.system.units_at(ends.p)
        T = z[-1] * units.time
        coefficients = self.variables.coefficients(z) * units.q[list(self.equations.coordinates)]
        coefficients /= np.vander([T], coefficients.shape[1], increasing=True).T
        return PiecewisePolynomial(T * self.variables.knots, coefficients)

    def torques(self, z: Array, ends: BoundaryValues) -> Array:
        """Torques at the points that have them, (N, points, motors), N·m."""
        limits = self.equations.system.units_at(ends.p).torque
        return self.variables.algebraic(z)[:, :, : self.equations.system.motors] * limits

    def bounds(self, ends: BoundaryValues, shares: Array | None = None) -> tuple[Array, Array]:
        """Bounds of the variables: the boundary values, torques, and the duration.

        All of q is fixed at the start but ξ alone at the goal, where loop closure determines the
        rest: fixed twice, the constraints would be dependent. ``shares``: part of their limits that
        torques may use, (N, rows).
        """
        system, v = self.equations.system, self.variables
        which = list(self.equations.coordinates)
        q = system.units_at(ends.p).q
        upper = np.full(v.number, np.inf)
        limits = np.full((v.intervals, 1, v.unknowns), np.inf)
        share = 1.0 if shares is None else shares[:, None, system.limits.is_control]
        limits[:, :, : system.motors] = share
        v.set_algebraic(upper, limits)
        lower, m = -upper, v.components
        start = (system.coordinates(ends.start, ends.p) / q)[which]
        rates = np.broadcast_to(ends.rates, (2, len(ends.goal)))
        lower[:m] = upper[:m] = start
        if not rates[0].any():
            lower[m : 2 * m] = upper[m : 2 * m] = 0.0
        last = v.number - 2 * m - 1
        given = ~(np.broadcast_to(ends.free, len(ends.goal)) | np.any(ends.drift))
        for i, goal, is_given in zip(system.independent, ends.goal, given, strict=True):
            place = last + which.index(i)
            if is_given:
                lower[place] = upper[place] = goal / q[i]
            if not rates[1].any():
                lower[place + m] = upper[place + m] = 0.0
        lower[-1] = 1e-3
        if self.cost.duration_is_given:
            lower[-1] = upper[-1] = 1.0
        return lower, upper

    def row_shares(self, program: IpoptProgram, shares_at: Callable[[Array], Array]) -> Array:
        """The part of its bounds that each nonlinear row of a program may use.

        ``shares_at``: those of all limits at fractions (n,) of every interval, (N, n, rows).
        """
        parts, e = [], self.equations
        for points in program.points:
            limits = next((each for each in e.limits if each.function is points.function), None)
            if limits is None:
                parts.append(np.ones(points.number * points.rows))
            else:
                own = shares_at(self._fractions(limits))[:, :, list(limits.rows)]
                parts.append(own.ravel())
        return np.concatenate(parts)

    def multipliers(self, solution: IpoptSolution) -> Array:
        """Multipliers of the limits as of ``Solved``, (N, points, rows).

        The points are all those where some row is imposed, in order; where a row is not imposed its
        multiplier is zero.
        """
        e, v = self.equations, self.variables
        limits = e.system.limits
        points = v.points
        for each in e.limits:
            points = np.union1d(points, self._fractions(each))
        found = np.zeros((v.intervals, len(points), limits.number))
        torque = v.algebraic(solution.bound_multipliers)[:, :, : e.system.motors]
        at = np.searchsorted(points, v.points)
        found[:, at[:, None], np.flatnonzero(limits.is_control)] = torque
        end = len(solution.row_multipliers)
        for each in reversed(e.limits):
            places = self._fractions(each)
            begin = end - v.intervals * len(places) * len(each.rows)
            own = solution.row_multipliers[begin:end].reshape(v.intervals, len(places), -1)
            found[:, np.searchsorted(points, places)[:, None], list(each.rows)] = own
            end = begin
        return np.asarray(found / solution.z[-1])


def _inside(v: Variables, c: Array) -> Array:
    """Instants at fractions c of the intervals, at 0 and 1 just inside; in durations."""
    return v.fractions(np.clip(c, 1e-9, 1 - 1e-9))
