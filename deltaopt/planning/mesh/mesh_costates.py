"""Pontryagin's condition on a mesh, from the prices of the limits at its points.

A motion of cubics is a function of positions and velocities at the knots. What a small shift
of these at a knot would cost, by the prices λ of the limits c afterwards, is the costate p: it
also is what the limits before would gain. On the way of duration T in units of it,

    p_i = Σ_j λ_j ∂c_j/∂(X, V)_i        H = p · (V, A) / T, which is -1 on an optimal motion

The sum may end at the next knot, were λ exact. But in intervals of 1e-4 a shift of one knot alone
is worth nothing, accelerations being what they are, and how λ is spread over neighbouring points
then is as good as unknown. So the shift fades out over a part of the motion, as one cubic, which
is a motion of the mesh too: what is unknown cancels, and nothing is smoothed but that.

On a mesh that is fit for its purpose H varies but little. As torques jump inside of intervals,
it is not as constant as where switches are resolved.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from deltaopt.motion.certificate import Certificate, spread
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.constraint_rows import OPENING, SPEED, TORQUE, Stage
from deltaopt.planning.mesh.mesh_solution import Attempt, mean_torques
from deltaopt.planning.nlp.problem import Solved
from deltaopt.planning.nlp.scaling import Scales

Array = NDArray[np.float64]

FADES = 0.05
"""Over this part of the motion a shift fades: many intervals where they are short."""


def certify_mesh(stage: Stage, attempt: Attempt) -> Certificate:
    """Of a motion of cubics that was found with prices of openings too, not yet slowed.

    ``hamiltonian_spread``: max |H - mean H| at both ends of all intervals, over |mean H|.
    ``sign_violation``: by how much other torques would lower H, at most, over the most that a
    torque does.
    """
    density = attempt.solution.prices[:, :, :3].sum(axis=1) / attempt.mesh[:, None]
    lowered = np.abs(density) - density * mean_torques(attempt)
    violation = float(lowered.max() / np.abs(density).max())
    return Certificate(spread(hamiltonian(stage, attempt)), violation)


def hamiltonian(stage: Stage, attempt: Attempt, over: float = FADES) -> Array:
    """At the beginnings and then at the ends of the intervals, (2 N,): -1 at best. ``over``: as
    of ``costates``."""
    motion, scales = attempt.trajectory, attempt.scales
    weights = _hermite(attempt.mesh, attempt.problem.points)
    states = scales.states(motion.position, motion.knots, motion.duration).reshape(-1, 2, 3)
    knots = np.concatenate([states[:-1], states[1:]], axis=1)  # of both ends, (N, 4, 3)
    y = np.einsum("danc,nak->ncdk", weights, knots)  # (N, points, 3, 3), by the duration
    J = _slopes(stage, y, motion.duration / scales.time, scales, motion)
    pulled = np.einsum("ncr,ncrdk->ncdk", _prices(attempt.solution), J)
    p = costates(np.einsum("ncdk,danc->nak", pulled, weights), attempt.mesh, over)
    A = np.einsum("anc,nak->nck", weights[2][:, :, [0, -1]], knots)
    first = (p[:-1] * np.stack([knots[:, 1], A[:, 0]], axis=1)).sum(axis=(1, 2))
    last = (p[1:] * np.stack([knots[:, 3], A[:, 1]], axis=1)).sum(axis=(1, 2))
    return np.concatenate([first, last])


def costates(pulled: Array, mesh: Array, over: float = FADES) -> Array:
    """At the knots, (N + 1, 2, 3), over the duration. ``pulled``: Σ λ ∂c/∂(X, V) at both ends of
    every interval, (N, 4, 3). ``over``: what part of the motion shifts fade over, one interval at
    least."""
    N, knots = len(mesh), np.concatenate([[0.0], np.cumsum(mesh)])
    number = np.arange(N + 1)
    onwards = np.maximum(np.searchsorted(knots, knots + over), number + 1)
    backwards = np.minimum(np.searchsorted(knots, knots - over, side="right"), number) - 1
    p = np.empty((N + 1, 2, 3))
    for i in range(N + 1):
        begins = onwards[i] <= N  # otherwise the goal, which must stay, is too near
        first, last = (i, onwards[i]) if begins else (backwards[i], i)
        shifts = _faded(knots[first : last + 1], begins)
        here = pulled[first:last]
        by = np.einsum("dan,ndk->ak", shifts[..., :-1], here[:, :2])
        by += np.einsum("dan,ndk->ak", shifts[..., 1:], here[:, 2:])
        p[i] = by if begins else -by
    return p


def _faded(knots: Array, begins: bool) -> Array:
    """(X, V) at knots by a shift of (X, V) at the first or else the last, where the other end
    stays, (2, 2, knots)."""
    length = knots[-1] - knots[0]
    weights = _hermite(np.array([length]), (knots - knots[0]) / length)[:2, :, 0]
    return weights[:, :2] if begins else weights[:, 2:]


def _hermite(mesh: Array, points: Array) -> Array:
    """Of both knots' (X, V) in X, V and A at the points, (3, 4, N, points)."""
    s, e = points, mesh[:, None]
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
