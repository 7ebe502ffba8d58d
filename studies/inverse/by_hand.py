"""Inverse dynamics of a Delta with slender bars as an engineer writes it in NumPy: the yardstick.

The method is the usual one: the forces that the chains pass to the platform, with a bar's mass as a
form of inertia at its ends (``deltaopt/mechanisms/delta/slender_bars.py`` has the equations). Each
line is a vector operation on all points and chains, (N, 3) or (N, 3, 3).
"""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS, DeltaParameters

_C, _S = np.cos(AZIMUTHS), np.sin(AZIMUTHS)
_TO_CHAINS = np.array([[[1, 0, 0], [0, c, s], [0, -s, c]] for c, s in zip(_C, _S, strict=True)])
"""Rotations from the base's frame to those of the chains, (3, 3, 3)."""


def inverse_dynamics(p: DeltaParameters, x: Array, v: Array, a: Array) -> Array:
    """Motor torques, (N, 3), N·m, of a motion x, v, a of the platform, (N, 3) each.

    ``p``: numbers; the robot has gravity and a payload, and its bars are slender.
    """
    arm, bar, g = 2 * float(p.a2), 2 * float(p.a3), float(p.g or 0.0)
    mass, m4 = float(p.m1) + float(p.m2 or 0.0), float(p.m4)
    across = float(p.I41) / bar**2
    alpha, beta = m4 / 4 + across, m4 / 4 - across
    inertia = float(p.I33) + float(p.a2) ** 2 * float(p.m3) + arm**2 * alpha
    tip, dtip, ddtip = (np.einsum("kij,nj->nki", _TO_CHAINS, rows) for rows in (x, v, a))
    tip[..., 1] -= float(p.a1) - float(p.a4)

    distance2 = tip[..., 0] ** 2 + tip[..., 1] ** 2
    dot = (distance2 + arm**2 - bar**2 + tip[..., 2] ** 2) / 2
    cross = np.sqrt(arm**2 * distance2 - dot**2)
    elbow = np.zeros_like(tip)
    elbow[..., 0] = (tip[..., 0] * dot - tip[..., 1] * cross) / distance2
    elbow[..., 1] = (tip[..., 1] * dot + tip[..., 0] * cross) / distance2
    u = np.zeros_like(tip)
    u[..., 0], u[..., 1] = -elbow[..., 1], elbow[..., 0]
    bars = tip - elbow
    along = _dot(bars, u)
    to_theta = bars / along[..., None]
    dtheta = _dot(to_theta, dtip)
    spread = dtip - u * dtheta[..., None]
    centripetal = elbow * (dtheta**2)[..., None]
    ddtheta = _dot(to_theta, ddtip + centripetal) + _dot(spread, spread) / along
    elbow_acceleration = u * ddtheta[..., None] - centripetal

    moment = g * (float(p.m3) + m4) / 2 * u[..., 0] - inertia * ddtheta - beta * _dot(u, ddtip)
    force = -alpha * ddtip - beta * elbow_acceleration + to_theta * moment[..., None]
    force[..., 0] += g * m4 / 2
    total = np.einsum("kij,nki->nj", _TO_CHAINS, force) - mass * a
    total[:, 0] += mass * g
    transfer = np.einsum("kij,nki->njk", _TO_CHAINS, to_theta)
    torques: Array = -np.linalg.solve(transfer, total[..., None])[..., 0]
    return torques


def _dot(a: Array, b: Array) -> Array:
    product: Array = (a * b).sum(axis=-1)
    return product
