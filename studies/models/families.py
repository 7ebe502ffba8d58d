"""Families of states that lead into a singularity, exact in many digits.

A state is fixed by as many conditions as the mechanism has freedoms, one of which is the
distance ε. Newton's method on constraints and conditions together works at ε = 0 too, where
the platform's position no longer determines the other coordinates. Velocities and
accelerations are random ones, moved onto the constraints by the least change; so are joint
rates bounded however small ε is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.many_digits import ManyDigits, Matrix
from deltaopt.compare.dynamics.printed import PAPER
from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.formulation import state
from deltaopt.dynamics.mechanism import SX, Mechanism
from deltaopt.mechanisms.delta.mechanism import delta
from deltaopt.mechanisms.delta.singularities import parallel_margin

NEWTON_STEPS = 50
"""In double precision, from the family's guess."""


@dataclass(frozen=True)
class Family:
    """States of ``mechanism`` at a distance ε from a singularity.

    ``conditions``: (q, ε) -> ν expressions, zero at the state sought. ``guess``: roughly
    the q at ε = 0.
    """

    name: str
    mechanism: Mechanism
    parameters: Array
    conditions: Callable[[SX, SX], SX]
    guess: Array


@dataclass(frozen=True)
class Motion:
    """q, q̇, q̈ on the constraints and torques τ, in many digits; q̈ does not belong to τ."""

    q: Matrix
    dq: Matrix
    ddq: Matrix
    tau: Matrix


@dataclass(frozen=True)
class Maker:
    """Makes the motions of a family in the arithmetic of ``exact``."""

    family: Family
    exact: ManyDigits

    def q(self, distance: float) -> Matrix:
        """Return the state (n,) at ε = ``distance``: Newton's method doubles the digits each
        time."""
        p = self.family.parameters
        q = self.exact.matrix(self._nearly(distance))
        for _ in range(2 + self.exact.digits // 32):
            r, slope = self.exact.evaluate(self._equations, q, [distance], p)
            q -= self.exact.solve(slope, r)
        return q

    def motion(self, q: Matrix, rng: np.random.Generator) -> Motion:
        """Draw speeds, accelerations and torques of order 1."""
        n, m = q.rows, self.family.mechanism.controls.numel()
        dq, ddq = (self.exact.matrix(rng.uniform(-1, 1, n)) for _ in range(2))
        rate, J, _ = self._rates(q, dq)
        dq -= self._least(J, rate)
        _, J, bias = self._rates(q, dq)
        ddq -= self._least(J, J * ddq + bias)
        return Motion(q, dq, ddq, self.exact.matrix(rng.uniform(-1, 1, m)))

    def _rates(self, q: Matrix, dq: Matrix) -> list[Matrix]:
        """J q̇ + μ, J, J̇ q̇ + μ̇."""
        return self.exact.evaluate(self._constraints, [0.0], q, dq, self.family.parameters)

    def _least(self, J: Matrix, residual: Matrix) -> Matrix:
        """The least x with J x = residual."""
        return J.T * self.exact.solve(J * J.T, residual)

    def _nearly(self, distance: float) -> Array:
        """The state to double precision."""
        q = self.family.guess
        for _ in range(NEWTON_STEPS):
            r, slope = (np.asarray(x) for x in self._equations(q, distance, self.family.parameters))
            q = q - np.linalg.solve(slope, r).ravel()
        return q

    @cached_property
    def _equations(self) -> ca.Function:
        """(q, ε, p) -> f and conditions (n), their slope (n × n)."""
        m, distance = self.family.mechanism, SX.sym("distance")
        f = ca.substitute(m.holonomic, m.time, 0)
        equations = ca.vertcat(f, self.family.conditions(m.q, distance))
        slope = ca.jacobian(equations, m.q)
        return ca.Function("equations", [m.q, distance, m.parameters], [equations, slope])

    @cached_property
    def _constraints(self) -> ca.Function:
        m = self.family.mechanism
        results = [m.constraint_rate, m.J, m.J_bias]
        return ca.Function("constraints", [*state(m), m.parameters], results)


def delta_families() -> list[Family]:
    """Return families towards serial singularities of one chain of the paper's Delta, then parallel
    ones of all."""
    mechanism, p = delta(PAPER), np.array(PAPER.values())

    def family(name: str, conditions: Callable[[SX, SX], SX], guess: list[float]) -> Family:
        return Family(name, mechanism, p, conditions, np.array(guess))

    return [
        family(  # arm and bars of chain 1 in line
            "stretched",
            lambda q, e: ca.vertcat(ca.sin(q[3] - q[4]) - e, q[3] + 2.0, q[5] - 0.1),
            [0.6, -0.2, 0.05, -2.0, -2.0, 0.1, -0.5, -2.2, 0.3, -0.5, -2.2, -0.3],
        ),
        family(  # bars of chain 1 sideways
            "sideways",
            lambda q, e: ca.vertcat(ca.cos(q[5]) - e, q[3] + 1.0, q[4] + 2.25),
            [0.17, 0.21, 0.5, -1.0, -2.25, 1.57, 0.42, -1.39, -1.04, -2.36, -3.08, -0.14],
        ),
        family(  # bars in one plane
            "coplanar",
            lambda q, e: ca.vertcat(parallel_margin(q) - e, q[0] - 0.17, q[2] - 0.01),
            [0.17, 0.50, 0.01, 1.29, -0.81, 0.02, -2.10, -3.15, -1.07, -2.10, -3.15, 1.03],
        ),
        family(  # all bars upright, elbows inside
            "upright",
            lambda q, e: ca.cos(q[4:12:3]) - e,
            [0.673, 0.0, 0.0, *3 * [-2.094, -1.571, 0.0]],
        ),
    ]
