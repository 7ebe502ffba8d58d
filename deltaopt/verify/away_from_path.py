"""The largest distance of a motion from places of a path that go with it, at all instants.

A rule says which place of the path goes with an instant: the nearest, or the one to which the
motion has come on its way along the path. Between two instants the place moves evenly. What the
motion is away from it is a polynomial of time, whose square lies below the largest of its control
points: of degree n on an interval it is Σ Bᵢ(u) pᵢ with Bernstein's polynomials Bᵢ, which are
positive and add up to 1 where u is from 0 to 1. Parts of the motion are halved until that says
enough: what is reported holds at all instants.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import comb
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from deltaopt.motion.trajectory import Array, PiecewisePolynomial
from deltaopt.scene.path import Path

Index = NDArray[np.intp]

_ENOUGH = 5e-10
"""Share beyond what is asked for at which a part is not halved any more: half of what verification
allows."""
_KNOWN = 1e-3
"""Share of an excess to which it is known."""
_HALVINGS, _MOST = 40, 400_000
"""Of a piece, and parts that are looked at in all: what is not known then is told as bad as it may
be."""
_FEWEST = 1000
"""Parts that are looked at in any case, so that a distance within the bound is told too."""
_BISECTIONS = 60
"""Of an interval in search of the largest value: doubles have no more between its ends."""


class Places(Protocol):
    """Which places of a path go with a motion: their parameters s, in the path's own unit."""

    @property
    def path(self) -> Path: ...

    def at_knots(self) -> Array:
        """At the knots of the motion, (K + 1,)."""
        ...

    def inside(self, pieces: Index, fractions: Array, x: Array, s: Array) -> Array:
        """At fractions of pieces, (N,), where the motion is at x, (N, 3); ``s``: at the ends of the
        part about each, (N, 2)."""
        ...

    def bound(self, points: Array, s: Array) -> Array:
        """What parts of a motion with these control points, (N, d + 1, 3), are away from the path
        at most, (N,), m, if these places go with their ends, (N, 2)."""
        ...


@dataclass(frozen=True)
class _Parts:
    """Parts of a motion: piece (N,), begin and end as fractions of it (N, 2), control points
    (N, d + 1, 3), and the places at both ends (N, 2)."""

    pieces: Index
    ends: Array
    points: Array
    s: Array

    def halved(self, places: Places) -> _Parts:
        """All first halves, then all second ones."""
        first, second = halves(self.points)
        middle = self.ends.mean(axis=1)
        s = places.inside(self.pieces, middle, second[:, 0], self.s)
        ends, own = (
            np.concatenate([np.stack([a, m], axis=1), np.stack([m, b], axis=1)])
            for (a, b), m in ((self.ends.T, middle), (self.s.T, s))
        )
        return _Parts(np.tile(self.pieces, 2), ends, np.concatenate([first, second]), own)

    def __getitem__(self, which: NDArray[np.bool]) -> _Parts:
        return _Parts(self.pieces[which], self.ends[which], self.points[which], self.s[which])


def largest_distance(
    places: Places, position: PiecewisePolynomial, asked: float
) -> tuple[float, float]:
    """The largest distance (m) of a motion from the places of a path, and when (s).

    It is that of an instant where all of the motion is known to keep what is asked for (m), and
    otherwise a bound that no instant exceeds.
    """
    knots, number = position.knots, len(position.coefficients)
    s = places.at_knots()
    points = control_points(position.coefficients, np.diff(knots))
    ends = np.tile([0.0, 1.0], (number, 1))
    parts = _Parts(np.arange(number), ends, points, np.stack([s[:-1], s[1:]], axis=1))
    worst, when, seen = 0.0, float(knots[0]), 0
    for halving in range(_HALVINGS + 1):
        away = parts.points[:, [0, -1]] - places.path(parts.s.ravel()).reshape(-1, 2, 3)
        at_ends = np.linalg.norm(away, axis=2)
        distance, later = at_ends.max(axis=1), at_ends.argmax(axis=1)
        bound = places.bound(parts.points, parts.s)
        seen += len(bound)
        is_last = halving == _HALVINGS or seen > _MOST
        beyond = bound - asked
        is_open = ~((beyond <= _ENOUGH * asked) | (beyond <= (1 + _KNOWN) * (distance - asked)))
        told = np.where(is_open & is_last, bound, distance)
        farthest = int(told.argmax())
        if not told[farthest] <= worst:
            worst, k = float(told[farthest]), parts.pieces[farthest]
            share = parts.ends[farthest, later[farthest]]
            when = float(knots[k] * (1 - share) + knots[k + 1] * share)
        if seen < _FEWEST:
            is_open[:] = True
        if is_last or not is_open.any():
            return worst, when
        parts = parts[is_open].halved(places)
    raise AssertionError("unreachable")


def from_moving_place(path: Path, pieces: Index, points: Array, s: Array) -> Array:
    """The largest distances, m, of parts of a motion (N, d + 1, 3) from places that move evenly
    between two, (N, 2), of a piece of the path each, (N,)."""
    begin = s[:, 0] - path.knots[pieces]
    moving = parts_of(path.coefficients[pieces], begin, s[:, 1] - s[:, 0])
    degree = max(points.shape[1], moving.shape[1]) - 1
    return largest_norm(raised(points, degree) - raised(moving, degree))


def largest_norm(points: Array) -> Array:
    """The largest norms, (N,), that polynomials with these control points may have."""
    return np.asarray(np.sqrt(np.maximum(square(points).max(axis=1), 0.0)))


def control_points(coefficients: Array, lengths: Array) -> Array:
    """Of polynomials (N, d + 1, m) in the ascending powers of what is from 0 to ``lengths``, (N,);
    (N, d + 1, m)."""
    powers = np.arange(coefficients.shape[1])
    return np.asarray(
        _to_bernstein(len(powers) - 1) @ (coefficients * (lengths[:, None] ** powers)[:, :, None])
    )


def parts_of(coefficients: Array, begin: Array, length: Array) -> Array:
    """Control points, (N, d + 1, m), of polynomials, (N, d + 1, m), from ``begin`` on, (N,)."""
    n = coefficients.shape[1] - 1
    shifted = [
        sum(comb(j, k) * begin[:, None] ** (j - k) * coefficients[:, j] for j in range(k, n + 1))
        for k in range(n + 1)
    ]
    return control_points(np.stack(shifted, axis=1), length)


def halves(points: Array) -> tuple[Array, Array]:
    """Control points of the first and of the second halves, by de Casteljau's method."""
    first = _to_first_half(points.shape[1] - 1)
    return first @ points, first[::-1, ::-1] @ points


def raised(points: Array, degree: int) -> Array:
    """Control points of the same polynomials as ones of a higher degree."""
    return np.asarray(_to_degree(points.shape[1] - 1, degree) @ points)


def square(points: Array) -> Array:
    """Bernstein coefficients of ‖p‖², (N, 2 d + 1), of control points of p, (N, d + 1, m)."""
    n = points.shape[1] - 1
    found = np.zeros((len(points), 2 * n + 1))
    for i in range(n + 1):
        weights = [comb(n, i) * comb(n, j) / comb(2 * n, i + j) for j in range(n + 1)]
        products = np.einsum("nc,njc->nj", points[:, i], points)
        found[:, i : i + n + 1] += np.array(weights) * products
    return found


def highest(points: Array, known: float) -> float:
    """The largest value of polynomials with these control points, (N, d + 1), or a bound that is
    higher by ``known`` at most."""
    reached = -np.inf
    for _ in range(_BISECTIONS):
        reached = max(reached, float(points[:, [0, -1]].max()))
        points = points[points.max(axis=1) > reached + known]
        if not len(points):
            return reached + known
        points = np.concatenate(halves(points[..., None]))[..., 0]
    return float(points.max())


@lru_cache(maxsize=64)
def _to_bernstein(n: int) -> Array:
    """From coefficients of powers to control points, (n + 1, n + 1)."""
    return np.array([[comb(j, k) / comb(n, k) for k in range(n + 1)] for j in range(n + 1)])


@lru_cache(maxsize=64)
def _to_degree(n: int, m: int) -> Array:
    """From control points of degree n to those of degree m, (m + 1, n + 1)."""
    weights = [
        [comb(n, i) * comb(m - n, j - i) for i in range(min(n, j) + 1)] for j in range(m + 1)
    ]
    padded = [each + [0] * (n + 1 - len(each)) for each in weights]
    return np.array([[w / comb(m, j) for w in each] for j, each in enumerate(padded)])


@lru_cache(maxsize=64)
def _to_first_half(n: int) -> Array:
    """From control points to those of the first half, (n + 1, n + 1)."""
    return np.array([[comb(j, k) / 2**j for k in range(n + 1)] for j in range(n + 1)])
