"""Limits as rows at one instant of a motion, sorted by order, with first and second derivatives.

A row is a function c(X, V, A) of the scaled position, velocity and acceleration, normalised so that
its limits are -1 <= c <= 1. The order of a row says how an arc of a switched motion can hold it:

    order 2   a control: c depends on A and is held directly
    order 1   a velocity limit, c(X, V): held by dc/dt along an arc, by c where the arc begins
    order 0   a position limit, c(X): held by d²c/dt² along an arc, by c and dc/dt where it begins

This is the only module of switch resolution that knows which limits there are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.dynamics.linear import solve_affine
from deltaopt.planning.flat.flat_problem import ScaledEquations
from deltaopt.planning.nlp.problem import Solved

Array = NDArray[np.float64]
Integers = NDArray[np.intp]


class ByOrder(NamedTuple):
    """One number for each motor and limit, kept apart by the order of the limit: values of
    normalised rows, or their multipliers, which are positive at upper limits and negative at lower
    ones. All arrays have the same shape (..., m); None where there is no limit of that order."""

    control: Array
    velocity: Array | None = None
    position: Array | None = None

    def of_state(self, order: int) -> Array | None:
        """The array of the state limits of order 0 (position) or 1 (velocity)."""
        return self.velocity if order else self.position

    def per_time(self, mesh: Array) -> ByOrder:
        """Multipliers of the intervals of a mesh per time, (N, m) each, from those at their points,
        (N, points, m). ``mesh``: lengths of the intervals, (N,)."""

        def of_intervals(each: Array | None) -> Array | None:
            return None if each is None else np.asarray(each.sum(axis=1) / mesh[:, None])

        control = self.control.sum(axis=1) / mesh[:, None]
        return ByOrder(control, of_intervals(self.velocity), of_intervals(self.position))


@dataclass(frozen=True)
class StateRows:
    """Indices of the rows of the state limits of one order, one limit for each motor.

    ``derivatives``: of the limited quantity itself and of its derivatives by time, (m,) each, up to
    the first that depends on the acceleration.
    """

    order: int
    derivatives: tuple[Integers, ...]

    @property
    def value(self) -> Integers:
        """Rows of the limited quantity, (m,)."""
        return self.derivatives[0]

    @property
    def holding(self) -> Integers:
        """Rows that are zero as long as the limit is active, (m,): they depend on acceleration."""
        return self.derivatives[-1]


@dataclass(frozen=True)
class ConstraintRows:
    """The rows of all limits of a mechanism, evaluated at many instants at once.

    An instant is y = (X, V, A), 3 m numbers, in the units of ``flat_problem`` with T = 1: the
    mechanism is fully actuated and has as many coordinates as motors. Controls are eliminated by
    the equations of motion: every row is a function of y and of the parameters p.
    """

    equations: ScaledEquations

    @property
    def motors(self) -> int:
        """The number m of motors, and of coordinates."""
        return int(self.equations.force.numel())

    @property
    def number(self) -> int:
        """The number of rows, derivatives of state limits included."""
        return int(self._rows.numel())

    @property
    def control(self) -> Integers:
        """Indices of the control rows, (m,)."""
        return np.arange(self.motors)

    @cached_property
    def position(self) -> StateRows:
        """Indices of the rows of position limits."""
        m = self.motors
        return StateRows(0, tuple(first + np.arange(m) for first in (m, 2 * m, 3 * m)))

    @cached_property
    def velocity(self) -> StateRows | None:
        """Indices of the rows of velocity limits; None if velocities are not limited."""
        if self.equations.speed is None:
            return None
        m = self.motors
        return StateRows(1, tuple(first + np.arange(m) for first in (4 * m, 5 * m)))

    @property
    def states(self) -> tuple[StateRows, ...]:
        """Indices of the rows of all state limits, those of the highest order first."""
        return tuple(rows for rows in (self.velocity, self.position) if rows is not None)

    def values(self, y: Array, p: Array) -> Array:
        """All rows at instants y (N, 3 m), as (N, rows)."""
        return self._values(y, parameters=p)[0]

    def positions(self, X: Array, p: Array) -> Array:
        """The rows of position limits at positions X (N, m), as (N, m)."""
        y = np.hstack([X, np.zeros((len(X), 2 * X.shape[1]))])
        return self.values(y, p)[:, self.position.value]

    def derivatives(self, y: Array, multipliers: Array, p: Array) -> tuple[Array, Array, Array]:
        """All rows at instants y (N, 3 m), as (N, rows), their Jacobian by y, (N, rows, 3 m), and
        the Hessian by y of the sum of rows times ``multipliers`` (N, rows), (N, 3 m, 3 m)."""
        r, J, H = self._derivatives(y, multipliers, parameters=p)
        N, width = y.shape
        return r, J.reshape(N, -1, width), H.reshape(N, width, width)

    @cached_property
    def _y(self) -> ca.SX:
        return ca.SX.sym("y", 3 * self.motors)

    @cached_property
    def _rows(self) -> ca.SX:
        """In the order of the indices. The distance to the serial singularity, which may not fall
        below its least value, becomes a position row that may not fall below -1."""
        e, m = self.equations, self.motors
        X, V, A, control = (e.y[i * m : (i + 1) * m] for i in range(4))
        rate = ca.jtimes(e.opening, X, V)
        acceleration = ca.jtimes(rate, X, V) + ca.jtimes(rate, V, A)
        rows = [solve_affine(e.force, control), e.opening - 1, rate, acceleration]
        if e.speed is not None and e.acceleration is not None:
            rows += [e.speed, e.acceleration]
        function = ca.Function("rows", [e.y, e.p], [ca.vertcat(*rows)], {"cse": True})
        return function(ca.vertcat(self._y, ca.SX.zeros(m), 1), e.p)

    @cached_property
    def _values(self) -> RowFunction:
        inputs = [self._y, self.equations.p]
        return RowFunction(ca.Function("values", inputs, [self._rows], {"cse": True}))

    @cached_property
    def _derivatives(self) -> RowFunction:
        y, r = self._y, self._rows
        multipliers = ca.SX.sym("multipliers", r.numel())
        J, H = ca.jacobian(r, y), ca.hessian(ca.dot(multipliers, r), y)[0]
        inputs = [y, multipliers, self.equations.p]
        results = [r, ca.densify(ca.vec(J.T)), ca.densify(ca.vec(H))]
        return RowFunction(ca.Function("derivatives", inputs, results, {"cse": True}))


def multipliers_by_order(solved: Solved) -> ByOrder | None:
    """Multipliers of all limits at the points of a mesh solution, (N, points, m) each, in fractions
    of the duration per unit of a normalised row; None if the solver did not report all of them."""
    if solved.opening_prices is None:
        return None
    control, velocity = np.split(solved.prices, [solved.opening_prices.shape[2]], axis=2)
    return ByOrder(control, velocity if velocity.size else None, -solved.opening_prices)
