"""Polynomials on an interval in Bernstein's form, which says between which values they stay.

A polynomial of degree n on an interval is Σ Bᵢ(u) pᵢ with Bernstein's polynomials Bᵢ, which are
positive and add up to 1 where u is from 0 to 1. So it stays within the convex hull of its control
points pᵢ, which come close to it where the interval is short.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial, shifted

_BISECTIONS = 60
"""Of an interval in search of the largest value: doubles have no more between its ends."""


def control_points(coefficients: Array, lengths: Array) -> Array:
    """Of polynomials (N, d + 1, m) in the ascending powers of what is from 0 to ``lengths``, (N,);
    (N, d + 1, m)."""
    powers = np.vander(lengths, coefficients.shape[1], increasing=True)
    return np.asarray(to_bernstein(coefficients.shape[1] - 1) @ (coefficients * powers[:, :, None]))


def control_points_of(curve: PiecewisePolynomial) -> Array:
    """Of all pieces of a curve, (K, d + 1, m)."""
    return control_points(curve.coefficients, np.diff(curve.knots))


def parts_of(coefficients: Array, begin: Array, length: Array) -> Array:
    """Control points, (N, d + 1, m), of polynomials, (N, d + 1, m), from ``begin`` on, (N,), over a
    ``length``, (N,)."""
    moved = shifted(coefficients.swapaxes(0, 1), begin[:, None])
    return control_points(moved.swapaxes(0, 1), length)


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


def largest_norm(points: Array) -> Array:
    """The largest norms, (N,), that polynomials with these control points may have."""
    return np.asarray(np.sqrt(np.maximum(square(points).max(axis=1), 0.0)))


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
def to_bernstein(n: int) -> Array:
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
