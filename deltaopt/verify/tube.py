"""The largest distance of a motion from the path about which its tube is, with a bound of its own.

The nearest places of the path are found by Newton's method at both ends of a part of the motion. A
place that stays, or that moves evenly between them, is on the path, so that the distance from it is
no less than that from the path. Its square is a polynomial of time, which lies below the largest
coefficient of its Bernstein form. Parts are halved until that says enough: what is reported holds
at all instants.
"""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import NDArray

from deltaopt.limits.limit import OwnMeasure
from deltaopt.motion.trajectory import Array, PiecewisePolynomial, Trajectory
from deltaopt.scene.path import Path
from deltaopt.scene.scene import Scene, limits_of
from deltaopt.verify.measures import Excess
from deltaopt.verify.path_distance import nearest_places

_ENOUGH = 5e-10
"""Share of the tube beyond it at which a part is not halved any more: half of what verification
allows."""
_KNOWN = 1e-3
"""Share of an excess to which it is known."""
_HALVINGS, _MOST = 30, 400_000
"""Of a piece, and parts that are looked at in all: what is not known then is told as bad as it may
be."""
_FIRST = 8
"""Parts of each piece to begin with."""


def tube_excess(scene: Scene, trajectory: Trajectory) -> Excess | None:
    """By how much the motion leaves the tube of its scene, as a share of the tube; negative where
    it stays inside. None if there is no tube."""
    limits = limits_of(scene).constraints.limits
    limit = next((each for each in limits if each.own_measure is OwnMeasure.TUBE), None)
    if limit is None or scene.path is None or scene.tube is None:
        return None
    path = scene.path.between(*scene.given_points)
    farthest, t = largest_distance(path, trajectory.position, scene.tube)
    over = farthest - scene.tube
    return Excess(limit.name, limit.unit, limit.subject, t, over / scene.tube, over)


def largest_distance(
    path: Path, position: PiecewisePolynomial, asked: float
) -> tuple[float, float]:
    """The largest distance (m) of a motion from a path, and when (s).

    It is that of an instant where all of the motion is known to keep what is asked for (m), and
    otherwise a bound that no instant exceeds.
    """
    pieces = np.repeat(np.arange(len(position.knots) - 1), _FIRST)
    half = np.diff(position.knots)[pieces] / (2 * _FIRST)
    middle = half * (2 * np.tile(np.arange(_FIRST), len(position.knots) - 1) + 1)
    worst, when = 0.0, float(position.knots[0])
    seen = 0
    for halving in range(_HALVINGS + 1):
        distance, bound = _distance_and_bound(path, position, pieces, middle, half)
        instants = position.knots[pieces] + middle
        seen += len(bound)
        is_last = halving == _HALVINGS or seen > _MOST
        beyond = bound - asked
        is_open = (beyond > _ENOUGH * asked) & (beyond > (1 + _KNOWN) * (distance - asked))
        told = np.where(is_open & (not is_last), distance, np.where(is_open, bound, distance))
        farthest = int(told.argmax())
        if told[farthest] > worst:
            worst, when = float(told[farthest]), float(instants[farthest])
        if is_last or not is_open.any():
            return worst, when
        pieces, half = np.tile(pieces[is_open], 2), np.tile(half[is_open] / 2, 2)
        parts = len(pieces) // 2
        middle = np.tile(middle[is_open], 2) + np.repeat([-1.0, 1.0], parts) * half
    raise AssertionError("unreachable")


def _distance_and_bound(
    path: Path,
    position: PiecewisePolynomial,
    pieces: NDArray[np.intp],
    middle: Array,
    half: Array,
) -> tuple[Array, Array]:
    """The largest distance at the ends of parts of a motion, and what it is at most in each."""
    x = position.inside(np.tile(pieces, 2), np.concatenate([middle - half, middle + half]))
    s, distances = nearest_places(path, x)
    first, last = s[: len(pieces)], s[len(pieces) :]
    on = path.piece((first + last) / 2)
    first, last = (np.clip(each, path.knots[on], path.knots[on + 1]) for each in (first, last))
    motion = _bernstein(position.coefficients[pieces], middle - half, 2 * half)
    moving = _bernstein(path.coefficients[on], first - path.knots[on], last - first)
    degree = max(motion.shape[1], moving.shape[1]) - 1
    motion, bound = _raised(motion, degree), np.full(len(pieces), np.inf)
    # Where the nearest place leaps from one side of a bend to the other, one that stays is nearer.
    for places in (_raised(moving, degree), *(path(each)[:, None] for each in np.split(s, 2))):
        square = _square(motion - places).max(axis=1)
        bound = np.minimum(bound, np.sqrt(np.maximum(square, 0.0)))
    return np.maximum(*np.split(distances, 2)), bound


def _bernstein(coefficients: Array, begin: Array, length: Array) -> Array:
    """Control points, (N, d + 1, 3), of polynomials, (N, d + 1, 3), from ``begin`` on, (N,)."""
    n = coefficients.shape[1] - 1
    shifted = [
        sum(comb(j, k) * begin[:, None] ** (j - k) * coefficients[:, j] for j in range(k, n + 1))
        * length[:, None] ** k
        for k in range(n + 1)
    ]
    return np.stack(
        [sum(comb(j, k) / comb(n, k) * shifted[k] for k in range(j + 1)) for j in range(n + 1)],
        axis=1,
    )


def _raised(points: Array, degree: int) -> Array:
    """Control points of the same polynomials as ones of a higher degree."""
    while points.shape[1] <= degree:
        n = points.shape[1]
        share = (np.arange(n + 1) / n)[:, None]
        before = np.concatenate([points[:, :1], points], axis=1)
        after = np.concatenate([points, points[:, -1:]], axis=1)
        points = share * before + (1 - share) * after
    return points


def _square(points: Array) -> Array:
    """Bernstein coefficients of ‖p‖², (N, 2 d + 1), of control points of p, (N, d + 1, 3)."""
    n = points.shape[1] - 1
    found = np.zeros((len(points), 2 * n + 1))
    for i in range(n + 1):
        for j in range(n + 1):
            weight = comb(n, i) * comb(n, j) / comb(2 * n, i + j)
            found[:, i + j] += weight * (points[:, i] * points[:, j]).sum(axis=1)
    return found
