"""A01, the simple pendulum: a point of 1 kg on a massless bar of 1 m, let go at the horizontal."""

from __future__ import annotations

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics.mechanism import SX, Body, Mechanism

G = 9.81
"""m/s², along −y."""


def pendulum() -> Mechanism:
    """Return the pendulum in its point's x and y (m), one constraint."""
    q, dq = SX.sym("q", 2), SX.sym("dq", 2)
    return Mechanism(
        name="simple pendulum",
        q=q,
        dq=dq,
        bodies=(Body("point", 1.0, ca.vertcat(q, 0)),),
        holonomic=(ca.sumsqr(q) - 1) / 2,
        gravity=SX([0, -G, 0]),
    )


def start() -> tuple[Array, Array]:
    """Return q, q̇: horizontal at (−1, 0), at rest."""
    return np.array([-1.0, 0.0]), np.zeros(2)


def exact(times: Array, digits: int = 30) -> Array:
    """Return x and y at the times (N × 2, m) by Jacobi's elliptic functions.

    With φ from the downward vertical, sin(φ/2) = k sn(K − ω t, k²), k = sin(π/4), ω² = g/l.
    """
    import mpmath

    with mpmath.workdps(digits):
        m = mpmath.mpf(1) / 2
        quarter, omega = mpmath.ellipk(m), mpmath.sqrt(mpmath.mpf(G))
        rows = []
        for t in times:
            half = mpmath.sqrt(m) * mpmath.ellipfun("sn", quarter - omega * mpmath.mpf(t), m=m)
            phi = -2 * mpmath.asin(half)
            rows.append([float(mpmath.sin(phi)), float(-mpmath.cos(phi))])
    return np.array(rows)
