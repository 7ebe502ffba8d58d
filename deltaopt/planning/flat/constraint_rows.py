"""Constraint rows at one instant of a motion, sorted by order, with first and second derivatives.

A row is a function c(X, V, A) of the scaled position, velocity and acceleration, normalised so that
its bounds are at -1 and 1. The order of a row says how an arc of a switched motion can hold it:

    order 2   a control: c depends on A and is held directly
    order 1   a velocity limit, c(X, V): held by dc/dt along an arc, by c where the arc begins
    order 0   a position limit, c(X): held by d²c/dt² along an arc, by c and dc/dt where it begins
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import Array, Index
from deltaopt.dynamics.linear import solve_affine
from deltaopt.limits.constraints import Constraints
from deltaopt.planning.flat.equations import PointEquations


class ByOrder(NamedTuple):
    """One number for each motor and limit, kept apart by the order of the limit: values of
    normalised rows, or their multipliers, which are positive at upper limits and negative at lower
    ones. ``states``: of positions (order 0) and velocities (1). All arrays have the same shape
    (..., m); None where there is no limit of that order."""

    control: Array
    states: tuple[Array | None, ...] = (None, None)

    @classmethod
    def of(cls, constraints: Constraints, rows: Array) -> ByOrder:
        """From all constraint rows, (..., rows)."""
        states = [constraints.of_order(order) for order in (0, 1)]
        return cls(
            rows[..., constraints.is_control],
            tuple(rows[..., own] if len(own) else None for own in states),
        )


@dataclass(frozen=True)
class StateRows:
    """Indices of the rows of the state limits of one order, one limit for each motor.

    ``derivatives``: of the limited quantity itself and of its derivatives by time, (m,) each, up to
    the first that depends on the acceleration.
    """

    order: int
    derivatives: tuple[Index, ...]

    @property
    def value(self) -> Index:
        """Rows of the limited quantity, (m,)."""
        return self.derivatives[0]

    @property
    def holding(self) -> Index:
        """Rows that are zero as long as the limit is active, (m,): they depend on acceleration."""
        return self.derivatives[-1]


@dataclass(frozen=True)
class ConstraintRows:
    """The rows of all limits of a mechanism, evaluated at many instants at once.

    An instant is y = (X, V, A), 3 m numbers, in the units of ``flat_problem`` with T = 1: the
    mechanism is fully actuated and has as many coordinates as motors. Controls are eliminated by
    the equations of motion: every row is a function of y and of the parameters p. The first rows
    are those of the limits, in their order; derivatives of state limits by time follow.
    """

    equations: PointEquations

    @property
    def constraints(self) -> Constraints:
        """The limits."""
        return self.equations.constraints

    @property
    def motors(self) -> int:
        """The number m of motors, and of coordinates."""
        return int(self.equations.force.numel())

    @property
    def number(self) -> int:
        """The number of rows, derivatives of state limits included."""
        return int(self._rows.numel())

    @property
    def control(self) -> Index:
        """Indices of the control rows, (m,)."""
        return np.asarray(np.flatnonzero(self.constraints.is_control))

    @cached_property
    def states(self) -> tuple[StateRows, ...]:
        """Indices of the rows of all state limits, those of the highest order first; none if arcs
        cannot hold the limits. Derivatives by time of positions come before those of velocities."""
        found, end, m = list[StateRows](), self.constraints.number, self.motors
        for order in (0, 1) if can_be_held(self.constraints) else ():
            own = self.constraints.of_order(order)
            if len(own):
                rates = [end + k * m + np.arange(m) for k in range(2 - order)]
                found.append(StateRows(order, (own, *rates)))
                end += len(rates) * m
        return tuple(found[::-1])

    def state(self, order: int) -> StateRows | None:
        """Those of the position limits (order 0) or of the velocity limits (1), if there are."""
        return next((rows for rows in self.states if rows.order == order), None)

    def values(self, y: Array, p: Array) -> Array:
        """All rows at instants y (N, 3 m), as (N, rows)."""
        return self._values(y, parameters=p)[0]

    def derivatives(self, y: Array, multipliers: Array, p: Array) -> tuple[Array, Array, Array]:
        """All rows at instants y (N, 3 m), as (N, rows), their Jacobian by y, (N, rows, 3 m), and
        the Hessian by y of the sum of rows times ``multipliers`` (N, rows), (N, 3 m, 3 m)."""
        r, J, H = self._derivatives(y, multipliers, parameters=p)
        N, width = y.shape
        return r, J.reshape(N, -1, width), H.reshape(N, width, width)

    def jacobian(self, y: Array, p: Array) -> Array:
        """The Jacobian of all rows by y at instants y (N, 3 m), (N, rows, 3 m)."""
        (J,) = self._jacobian(y, parameters=p)
        return J.reshape(len(y), -1, y.shape[1])

    @cached_property
    def _y(self) -> ca.SX:
        return ca.SX.sym("y", 3 * self.motors)

    @cached_property
    def _p(self) -> ca.SX:
        return self.equations.parameters.vector

    @cached_property
    def _rows(self) -> ca.SX:
        """In the order of the indices."""
        e, m = self.equations, self.motors
        X, V, A, control = (e.y[i * m : (i + 1) * m] for i in range(4))

        def rate(c: ca.SX) -> ca.SX:
            return ca.jtimes(c, X, V) + ca.jtimes(c, V, A)

        by_motion = ca.substitute(e.rows, control, solve_affine(e.force, control))
        rows = [by_motion]
        for state in self.states[::-1]:
            c = e.rows[state.value.tolist()]
            for _ in state.derivatives[1:]:
                c = rate(c)
                rows.append(c)
        function = ca.Function("rows", [e.y, self._p], [ca.vertcat(*rows)], {"cse": True})
        return function(ca.vertcat(self._y, ca.SX.zeros(m), 1), self._p)

    @cached_property
    def _values(self) -> RowFunction:
        return RowFunction.of("values", [self._y, self._p], [self._rows])

    @cached_property
    def _jacobian(self) -> RowFunction:
        J = ca.jacobian(self._rows, self._y)
        return RowFunction.of("jacobian", [self._y, self._p], [ca.vec(J.T)])

    @cached_property
    def _derivatives(self) -> RowFunction:
        y, r = self._y, self._rows
        multipliers = ca.SX.sym("multipliers", r.numel())
        J, H = ca.jacobian(r, y), ca.hessian(ca.dot(multipliers, r), y)[0]
        results = [r, ca.vec(J.T), ca.vec(H)]
        return RowFunction.of("derivatives", [y, multipliers, self._p], results)


def can_be_held(constraints: Constraints) -> bool:
    """Whether the arcs of a switching structure can hold these limits: bounds on each control, and
    for each motor at most one limit of its velocity and one of its position."""
    m = constraints.motors
    states = [len(constraints.of_order(order)) for order in (0, 1)]
    controls = int(constraints.is_control.sum())
    return controls == m == constraints.number - sum(states) and set(states) <= {0, m}


def holdable(constraints: Constraints) -> tuple[int, ...]:
    """Indices of items that arcs can hold together: each that can be held with those before it."""
    kept: tuple[int, ...] = ()
    for i in range(len(constraints.items)):
        items = tuple(constraints.items[j] for j in (*kept, i))
        if can_be_held(Constraints(items, constraints.motors)):
            kept = (*kept, i)
    return kept


constraint_rows = lru_cache(maxsize=16)(ConstraintRows)
"""Those of some equations, derived once in a process."""
