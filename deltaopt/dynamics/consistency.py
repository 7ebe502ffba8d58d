"""States that obey the constraints: f(q, t) = 0 and J q̇ + μ = 0.

A state that does not is moved by the least Δ, as the inertia M measures it, so that no unit is
mixed with another and Δq̇ is what an impulse of the constraints makes:

    min Δᵀ M Δ / 2  subject to  J Δ = -residual     ⇔     [M Jᵀ; J 0] [Δ; ·] = [0; -residual]

once for velocities, where the constraints are linear; repeatedly (Gauss-Newton) for
positions, where only the holonomic ones count. M may be singular where J is not: the
matrix is that of model L_I. Constraints may be redundant: residuals in a direction whose
singular value is below ``NEGLIGIBLE`` are left alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from deltaopt.dynamics.formulation import state, symbols
from deltaopt.dynamics.linear import Array, LeastNorm
from deltaopt.dynamics.mechanism import SX, Mechanism

NEGLIGIBLE = 1e-8
"""Singular values below this part of the largest count as zero."""
MOST_STEPS = 20
"""Gauss-Newton steps; two or three are the rule."""


@dataclass(frozen=True)
class Residuals:
    """How far states are from the constraints of ``mechanism``."""

    mechanism: Mechanism

    @cached_property
    def function(self) -> ca.Function:
        """(t, q, q̇, p) -> f (h), J q̇ + μ (γ)."""
        m = self.mechanism
        x = [*state(m), m.parameters]
        return ca.Function("residuals", x, [ca.densify(m.holonomic), ca.densify(m.constraint_rate)])

    def __call__(self, t: float, q: Array, dq: Array, p: Array) -> tuple[Array, Array]:
        """f (h), J q̇ + μ (γ)."""
        f, rate = self.function(t, q, dq, p)
        return _column(f), _column(rate)


@dataclass(frozen=True)
class Projector:
    """Moves states onto the constraints of ``mechanism``."""

    mechanism: Mechanism

    @cached_property
    def residuals(self) -> Residuals:
        return Residuals(self.mechanism)

    @cached_property
    def position_step(self) -> ca.Function:
        """(t, q, q̇, p) -> Δq."""
        m = self.mechanism
        return _least(m, m.J[: m.holonomic.numel(), :], m.holonomic)

    @cached_property
    def velocity_step(self) -> ca.Function:
        """(t, q, q̇, p) -> Δq̇."""
        m = self.mechanism
        return _least(m, m.J, m.constraint_rate)

    def __call__(self, t: float, q: Array, dq: Array, p: Array) -> tuple[Array, Array]:
        """The state, n and n, on the constraints to rounding."""
        q = self._position(t, q, dq, p)
        return q, dq + _column(self.velocity_step(t, q, dq, p))

    def _position(self, t: float, q: Array, dq: Array, p: Array) -> Array:
        """Gauss-Newton steps for as long as each at least halves |f|."""
        distance = _largest(self.residuals(t, q, dq, p)[0])
        for _ in range(MOST_STEPS):
            moved = q + _column(self.position_step(t, q, dq, p))
            left = _largest(self.residuals(t, moved, dq, p)[0])
            if not left < distance:
                break
            converged, q, distance = left > distance / 2, moved, left
            if converged:
                break
        return q


def _least(m: Mechanism, J: SX, residual: SX) -> ca.Function:
    """(t, q, q̇, p) -> the least Δ with J Δ = -residual, n."""
    n, rows = m.q.numel(), residual.numel()
    A = ca.densify(ca.blockcat([[m.M, J.T], [J, SX(rows, rows)]]))
    b = ca.densify(ca.vertcat(SX(n, 1), -residual))
    system = ca.Function("system", [*state(m), m.parameters], [A, b])
    x = symbols(*state(m), m.parameters)
    return ca.Function("least", x, [LeastNorm(NEGLIGIBLE)(*system(*x))[:n]])


def _largest(residual: Array) -> float:
    return float(np.max(np.abs(residual), initial=0.0))


def _column(x: ca.DM) -> Array:
    return np.asarray(x, dtype=float).ravel()
