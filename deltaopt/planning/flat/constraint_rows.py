"""What limits hold back, at one point of a motion, with first and second derivatives.

Rows are functions of y = (X, V, A), 9, in the units of ``flat`` with T = 1: torques, how far
the chains are from the margin of their fold and two derivatives of that by time, speeds and
their derivative. Torques are eliminated here: what an arc holds is a function of the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.dynamics.linear import solve_affine
from deltaopt.planning.flat.flat_problem import ScaledEquations

Array = NDArray[np.float64]

TORQUE, OPENING, OPENING_RATE, OPENING_BEND, SPEED, SPEED_RATE = range(0, 18, 3)
"""First of the three rows of each kind; the last two only where speed is limited."""


@dataclass(frozen=True)
class Stage:
    """The rows of some equations, evaluated at many points at once."""

    equations: ScaledEquations

    @property
    def rows(self) -> int:
        """12, or 18 where speed is limited."""
        return int(self._row.numel())

    def values(self, y: Array, p: Array) -> Array:
        """Rows at points (N, 9) -> (N, rows)."""
        return self._values(y, parameters=p)[0]

    def openings(self, X: Array, p: Array) -> Array:
        """How far chains are from the margin of their fold at positions (N, 3) -> (N, 3)."""
        y = np.hstack([X, np.zeros((len(X), 6))])
        return self.values(y, p)[:, OPENING : OPENING + 3]

    def derivatives(self, y: Array, multipliers: Array, p: Array) -> tuple[Array, Array, Array]:
        """Rows (N, rows), their Jacobian (N, rows, 9), and the Hessian of the rows times
        multipliers (N, rows): (N, 9, 9)."""
        r, J, H = self._derivatives(y, multipliers, parameters=p)
        return r, J.reshape(len(y), -1, 9), H.reshape(len(y), 9, 9)

    @cached_property
    def _y(self) -> ca.SX:
        return ca.SX.sym("y", 9)

    @cached_property
    def _row(self) -> ca.SX:
        e, y = self.equations, self._y
        X, V, A = ca.vertsplit(y, 3)
        rate = ca.jtimes(e.opening, e.y[:3], e.y[3:6])
        bend = ca.jtimes(rate, e.y[:3], e.y[3:6]) + ca.jtimes(rate, e.y[3:6], e.y[6:9])
        rows = [solve_affine(e.force, e.y[9:12]), e.opening, rate, bend]
        if e.speed is not None and e.acceleration is not None:
            rows += [e.speed, e.acceleration]
        function = ca.Function("rows", [e.y, e.p], [ca.vertcat(*rows)], {"cse": True})
        return function(ca.vertcat(X, V, A, 0, 0, 0, 1), e.p)

    @cached_property
    def _values(self) -> RowFunction:
        inputs = [self._y, self.equations.p]
        return RowFunction(ca.Function("values", inputs, [self._row], {"cse": True}))

    @cached_property
    def _derivatives(self) -> RowFunction:
        y, r = self._y, self._row
        multipliers = ca.SX.sym("multipliers", r.numel())
        J, H = ca.jacobian(r, y), ca.hessian(ca.dot(multipliers, r), y)[0]
        inputs = [y, multipliers, self.equations.p]
        results = [r, ca.densify(ca.vec(J.T)), ca.densify(ca.vec(H))]
        return RowFunction(ca.Function("derivatives", inputs, results, {"cse": True}))
