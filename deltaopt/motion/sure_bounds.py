"""How far a motion may be beyond limits that are convex functions of its position: a sure bound.

A distance d from a convex body is a convex function of the place, so that it lies above its tangent
planes: d(x) ≥ d(y) + ∇d(y)·(x − y). Along a polynomial the right side is a polynomial of time,
which lies above the least coefficient of its Bernstein form. That bounds d from below over a whole
piece of a motion, to the second order of the piece's duration; pieces are halved until the bound
says enough. So a limit that is kept is known to be kept at all instants, not at samples alone.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.limits.constraints import Constraints
from deltaopt.motion.trajectory import Array, PiecewisePolynomial
from deltaopt.scene.scene import Scene, limits_of

_HALVINGS = 24
"""At most: a ten-millionth of an interval is some nanoseconds. What is not known then is taken to
be as bad as the bound says."""
_KNOWN = 0.1
"""Share of an excess to which it is known: it is cured by tightening a limit a quarter more."""
_CELLS = 20000
"""Pieces that are looked at together at most: a motion that slides along a body for long is bound
by ever shorter ones."""


def sure_excess(scene: Scene, position: PiecewisePolynomial) -> Array:
    """By how much, at most, each row of ``Constraints.convex`` is beyond its bound in each
    interval, (K, rows), as shares of the rows' natural sizes; negative where it keeps its bound."""
    limits = limits_of(scene)
    constraints = limits.constraints
    rows = constraints.convex
    bound, scale = limits.bounds[0][rows], limits.scales[rows]
    excess = np.full((len(position.coefficients), len(bound)), -np.inf)
    intervals = np.arange(len(excess))
    points = _bernstein(position)
    for halving in range(_HALVINGS + 1):
        first, second = _halves(points)
        middle = second[:, 0]
        distance, slope = signed_distances(scene, middle)
        away = points - middle[:, None]
        least = distance + np.einsum("crk,cpk->crp", slope, away).min(axis=2)
        below = (bound - least) / scale
        beyond = (bound - distance) / scale
        is_known = (below <= 0) | ((beyond > 0) & (below <= (1 + _KNOWN) * beyond))
        if halving == _HALVINGS or len(points) > _CELLS:
            is_known[:] = True
        np.maximum.at(excess, intervals, np.where(is_known, below, beyond))
        left = ~is_known.all(axis=1)
        if not left.any():
            break
        points = np.concatenate([first[left], second[left]])
        intervals = np.tile(intervals[left], 2)
    return excess


def signed_distances(scene: Scene, x: Array) -> tuple[Array, Array]:
    """Measures of the rows of ``Constraints.convex`` at places (N, 3), m, (N, rows), and their
    derivatives by the place, (N, rows, 3)."""
    limits = limits_of(scene)
    measures, slopes = _tangents(limits.constraints)(x, parameters=limits.numbers)
    return measures, slopes.reshape(len(x), -1, 3)


def _bernstein(position: PiecewisePolynomial) -> Array:
    """Control points of all pieces, (K, d + 1, 3)."""
    coefficients, lengths = position.coefficients, np.diff(position.knots)
    degree = coefficients.shape[1] - 1
    powers = lengths[:, None] ** np.arange(degree + 1)
    return np.asarray(np.einsum("jp,kp,kpc->kjc", _to_bernstein(degree), powers, coefficients))


@lru_cache(maxsize=32)
def _to_bernstein(degree: int) -> Array:
    """From coefficients of powers to those of Bernstein's polynomials."""
    n = degree
    return np.array([[comb(j, p) / comb(n, p) for p in range(n + 1)] for j in range(n + 1)])


def _halves(points: Array) -> tuple[Array, Array]:
    """Control points of both halves of pieces, by de Casteljau's method."""
    first, second, row = [points[:, 0]], [points[:, -1]], points
    while row.shape[1] > 1:
        row = (row[:, 1:] + row[:, :-1]) / 2
        first.append(row[:, 0])
        second.append(row[:, -1])
    return np.stack(first, axis=1), np.stack(second[::-1], axis=1)


@lru_cache(maxsize=32)
def _tangents(constraints: Constraints) -> RowFunction:
    """(x, numbers of the limits) -> measures of the convex rows and their derivatives by x."""
    x, numbers = ca.SX.sym("x", 3), constraints.numbers()
    measures = constraints.convex_measures(x, numbers)
    slopes = ca.densify(ca.vec(ca.jacobian(measures, x).T))
    outputs = [ca.densify(measures), slopes]
    return RowFunction(ca.Function("tangents", [x, numbers], outputs, {"cse": True}))
