"""Pontryagin's condition on a mesh, from the prices of the limits at its points.

A motion of cubics is a function of positions and velocities at the knots. What a small shift
of these at one knot would cost, by the prices λ of the limits c in the interval that begins
there, is the costate p: it also is what the interval that ends there would gain. So at both
ends of every interval, on the way of duration T in units of it,

    p_i = Σ_j λ_ij ∂c_ij/∂(X, V)_i        H = p · (V, A) / T, which is -1 on an optimal motion

On a mesh that is fit for its purpose H varies but little. As torques jump inside of intervals,
it is not as constant as where switches are resolved.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.certificate import Certificate
from deltaopt.planning.problem import Solved
from deltaopt.planning.scales import Scales
from deltaopt.planning.stage import OPENING, SPEED, TORQUE, Stage
from deltaopt.planning.transcription import LINEAR
from deltaopt.trajectory import Trajectory

Array = NDArray[np.float64]


def certify_mesh(
    stage: Stage, solved: Solved, motion: Trajectory, scales: Scales, torque: Array
) -> Certificate:
    """Of a solution by cubics whose motion is not yet slowed. ``torque``: mean of each interval,
    fractions of the limits, (N, 3)."""
    mesh, T = np.diff(motion.knots) / motion.duration, motion.duration / scales.time
    weights, knots = _hermite(mesh), _at_knots(motion, scales)
    y = np.einsum("danc,nak->ncdk", weights, knots)  # (N, points, 3, 3), by T
    prices, J = _prices(solved), _slopes(stage, y, T, scales, motion)
    pulled = np.einsum("ncr,ncrdk->ncdk", prices, J)
    by_knot = np.einsum("ncdk,danc->nak", pulled, weights) * T  # prices are fractions of it
    A = np.einsum("anc,nak->nck", weights[2][:, :, [0, -1]], knots)
    first = (by_knot[:, :2] * np.stack([knots[:, 1], A[:, 0]], axis=1)).sum(axis=(1, 2))
    last = -(by_knot[:, 2:] * np.stack([knots[:, 3], A[:, 1]], axis=1)).sum(axis=(1, 2))
    H = np.concatenate([first, last]) / T
    return Certificate(
        float(np.abs(H - H.mean()).max() / abs(H.mean())), _wrong(solved, mesh, torque)
    )


def _wrong(solved: Solved, mesh: Array, torque: Array) -> float:
    """By how much other torques would lower H, at most, over the most that a torque does."""
    density = solved.prices[:, :, :3].sum(axis=1) / mesh[:, None]
    return float((np.abs(density) - density * torque).max() / np.abs(density).max())


def _at_knots(motion: Trajectory, scales: Scales) -> Array:
    """X and V, per duration, where intervals begin and end, (N, 4, 3)."""
    X = (motion.position.at(motion.knots) - scales.origin) / scales.length
    V = motion.position.derivative().at(motion.knots) * motion.duration / scales.length
    state = np.stack([X, V], axis=1)
    return np.concatenate([state[:-1], state[1:]], axis=1)


def _hermite(mesh: Array) -> Array:
    """Of both knots' (X, V) in X, V and A at the points, (3, 4, N, points)."""
    s, e = LINEAR.points, mesh[:, None]
    one = np.ones_like(e)
    return np.array(
        [
            [
                (1 - 3 * s**2 + 2 * s**3) * one,
                e * (s - 2 * s**2 + s**3),
                (3 * s**2 - 2 * s**3) * one,
                e * (s**3 - s**2),
            ],
            [
                6 * (s**2 - s) / e,
                (1 - 4 * s + 3 * s**2) * one,
                6 * (s - s**2) / e,
                (3 * s**2 - 2 * s) * one,
            ],
            [(12 * s - 6) / e**2, (6 * s - 4) / e, (6 - 12 * s) / e**2, (6 * s - 2) / e],
        ]
    )


def _prices(solved: Solved) -> Array:
    """Of torques, openings and speeds, (N, points, 6 or 9); an opening has to be large."""
    assert solved.opening_prices is not None
    return np.insert(solved.prices, [3, 3, 3], -solved.opening_prices, axis=2)


def _slopes(stage: Stage, y: Array, T: float, scales: Scales, motion: Trajectory) -> Array:
    """Of torques, openings and speeds by X, V and A, (N, points, 6 or 9, 3, 3)."""
    p = np.concatenate([scales.vector(), motion.model.parameters])
    per_time = np.array([1.0, T, T**2])[:, None]
    points = (y / per_time).reshape(-1, 9)
    _, J, _ = stage.derivatives(points, np.zeros((len(points), stage.rows)), p)
    kinds = [TORQUE, OPENING] + ([SPEED] if stage.rows > SPEED else [])
    rows = np.ravel([np.arange(kind, kind + 3) for kind in kinds])
    return np.asarray(J[:, rows].reshape(*y.shape[:2], len(rows), 3, 3) / per_time)
