"""States that obey the constraints: f(q, t) = 0 and J q̇ + μ = 0.

A state that does not is moved by the least Δ, as a metric W measures it:

    min Δᵀ W Δ / 2  subject to  J Δ = -residual     ⇔     [W Jᵀ; J 0] [Δ; ·] = [0; -residual]

once for velocities, where the constraints are linear; repeatedly (Gauss-Newton) for
positions, where only the holonomic ones count. W may be singular where J is not: the
matrix is that of model L_I. Constraints may be redundant: residuals in a direction whose
singular value is below ``NEGLIGIBLE`` are left alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.dynamics.formulation import state, symbols
from deltaopt.dynamics.linear import LeastNorm
from deltaopt.dynamics.mechanism import SX, Mechanism
from deltaopt.errors import Inconsistent

Array = NDArray[np.float64]

SLIGHT_POSITION = 1e-3
"""Largest |f| that is projected away, m (rad where a constraint is an angle)."""
SLIGHT_VELOCITY = 1e-2
"""Largest |J q̇ + μ| that is projected away, m/s (rad/s)."""
NEGLIGIBLE = 1e-8
"""Singular values below this part of the largest count as zero."""
MOST_STEPS = 20
"""Gauss-Newton steps; two or three are the rule."""


@dataclass(frozen=True)
class InertiaMetric:
    """W = M: no unit is mixed with another; Δq̇ is what an impulse of the constraints makes."""

    def matrix(self, mechanism: Mechanism) -> SX:
        return mechanism.M


@dataclass(frozen=True)
class EuclideanMetric:
    """W = 1: the minimum norm, metres and radians alike."""

    def matrix(self, mechanism: Mechanism) -> SX:
        return SX.eye(mechanism.q.numel())


Metric = InertiaMetric | EuclideanMetric
"""How far apart two neighbouring states are: ``matrix`` is W, n × n, a function of t, q and
parameters."""


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
    """Moves states onto the constraints of ``mechanism``, nearest in ``metric``."""

    mechanism: Mechanism
    metric: Metric = field(default_factory=InertiaMetric)

    @cached_property
    def residuals(self) -> Residuals:
        return Residuals(self.mechanism)

    @cached_property
    def position_step(self) -> ca.Function:
        """(t, q, q̇, p) -> Δq."""
        m = self.mechanism
        return _least(m, self.metric, m.J[: m.holonomic.numel(), :], m.holonomic)

    @cached_property
    def velocity_step(self) -> ca.Function:
        """(t, q, q̇, p) -> Δq̇."""
        m = self.mechanism
        return _least(m, self.metric, m.J, m.constraint_rate)

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


def consistent_state(
    projector: Projector, t: float, q: Array, dq: Array, p: Array
) -> tuple[Array, Array]:
    """The state projected onto the constraints, if it is only slightly off them.

    Slightly: |f| ≤ 1e-3 m (rad) and |J q̇ + μ| ≤ 1e-2 m/s (rad/s) in every row.
    """
    name = projector.mechanism.name
    f, rate = projector.residuals(t, q, dq, p)
    _refuse(f, SLIGHT_POSITION, f"positions given for the {name} violate constraint", "m (or rad)")
    q, _ = projector(t, q, dq, p)
    f, rate = projector.residuals(t, q, dq, p)
    _refuse(f, 1e-9, f"no positions near those given for the {name} obey constraint", "m (or rad)")
    _refuse(
        rate,
        SLIGHT_VELOCITY,
        f"velocities given for the {name} violate constraint",
        "m/s (or rad/s)",
    )
    return projector(t, q, dq, p)


def _least(m: Mechanism, metric: Metric, J: SX, residual: SX) -> ca.Function:
    """(t, q, q̇, p) -> the least Δ with J Δ = -residual, n."""
    n, rows = m.q.numel(), residual.numel()
    A = ca.densify(ca.blockcat([[metric.matrix(m), J.T], [J, SX(rows, rows)]]))
    b = ca.densify(ca.vertcat(SX(n, 1), -residual))
    system = ca.Function("system", [*state(m), m.parameters], [A, b])
    x = symbols(*state(m), m.parameters)
    return ca.Function("least", x, [LeastNorm(NEGLIGIBLE)(*system(*x))[:n]])


def _refuse(residual: Array, most: float, what: str, unit: str) -> None:
    """Raise if a row is more than ``most`` away from zero, or is no number."""
    if residual.size == 0 or np.all(np.abs(residual) <= most):
        return
    row = int(np.argmax(np.where(np.isnan(residual), np.inf, np.abs(residual))))
    raise Inconsistent(
        f"{what} {row + 1} by {abs(residual[row]):.3g} {unit}; at most {most:g} can be mended"
    )


def _largest(residual: Array) -> float:
    return float(np.max(np.abs(residual), initial=0.0))


def _column(x: ca.DM) -> Array:
    return np.asarray(x, dtype=float).ravel()
