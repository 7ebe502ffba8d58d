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
from numpy.typing import NDArray

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.limits.constraints import Constraints
from deltaopt.motion.trajectory import Array, PiecewisePolynomial
from deltaopt.problem.problem import Problem

Integers = NDArray[np.intp]
Truths = NDArray[np.bool]

_HALVINGS = 24
"""At most: a ten-millionth of an interval is some nanoseconds. What is not known then is taken to
be as bad as the bound says."""
_KNOWN, _ANY = 0.1, 1e300
"""Share of an excess to which it is known, for it is cured by tightening a limit a quarter more;
and where no more is asked than whether there is one."""
_CELLS = 20000
"""Pieces that are looked at together at most: a motion that slides along a body for long is bound
by ever shorter ones."""


def sure_excess(problem: Problem, position: PiecewisePolynomial) -> Array:
    """By how much, at most, each row of ``Constraints.convex`` is beyond its bound in each
    interval, (K, rows), as shares of the rows' natural sizes; negative where it keeps its bound."""
    return _excess(problem, position, np.arange(len(position.coefficients)), _KNOWN)


def rows_not_kept(problem: Problem, position: PiecewisePolynomial) -> Truths:
    """Which rows of ``Constraints.convex`` a motion is not known to keep at all instants, (rows,).
    By how much is of no account, so that this is known sooner."""
    everywhere = np.zeros(len(position.coefficients), dtype=np.intp)
    return np.asarray(_excess(problem, position, everywhere, _ANY)[0] > 0)


def _excess(
    problem: Problem, position: PiecewisePolynomial, groups: Integers, known: float
) -> Array:
    """The largest excess in each of some groups of pieces, (groups, rows); ``groups``: to which
    each piece belongs. ``known``: share to which it is known where it is positive."""
    limits = problem.limits
    rows = limits.constraints.convex
    bound, scale = limits.bounds[0][rows], limits.scales[rows]
    most = np.full((groups[-1] + 1, len(bound)), -np.inf)
    least = most.copy()
    points = _bernstein(position)
    for halving in range(_HALVINGS + 1):
        middle = points @ _middle(points.shape[2] - 1)
        distance, slope = signed_distances(problem, middle)
        away = points - middle[:, :, None]
        lowest = distance + (slope @ away).min(axis=2)
        below, beyond = (bound - lowest) / scale, (bound - distance) / scale
        np.maximum.at(least, groups, beyond)
        reached = least[groups]
        enough = (1 + known) * np.maximum(reached, 0.0)
        is_known = below <= enough
        if halving == _HALVINGS or len(points) > _CELLS:
            is_known[:] = True
        np.maximum.at(most, groups, np.where(is_known, below, beyond))
        left = ~is_known.all(axis=1)
        if not left.any():
            break
        points, groups = _halved(points[left]), np.tile(groups[left], 2)
    return most


def signed_distances(problem: Problem, x: Array) -> tuple[Array, Array]:
    """Measures of the rows of ``Constraints.convex`` at places (N, 3), m, (N, rows), and their
    derivatives by the place, (N, rows, 3)."""
    limits = problem.limits
    measures, slopes = _tangents(limits.constraints)(x, parameters=limits.numbers)
    return measures, slopes.reshape(len(x), -1, 3)


def distances_from_faces(problem: Problem, x: Array, row: int) -> Array:
    """Distances of places (N, 3), m, from the faces of the body of one of the rows of
    ``Constraints.convex``, (N, faces), m."""
    limits = problem.limits
    measures = _tangents(limits.constraints)
    each = [measures(x, parameters=numbers)[0][:, row] for numbers in limits.faces[row]]
    return np.stack(each, axis=1)


def _bernstein(position: PiecewisePolynomial) -> Array:
    """Control points of all pieces, (K, 3, d + 1)."""
    coefficients, lengths = position.coefficients, np.diff(position.knots)
    degree = coefficients.shape[1] - 1
    powers = np.vander(lengths, degree + 1, increasing=True)
    scaled = (powers[:, :, None] * coefficients).transpose(0, 2, 1)
    return np.asarray(scaled @ _to_bernstein(degree).T)


@lru_cache(maxsize=32)
def _to_bernstein(degree: int) -> Array:
    """From coefficients of powers to those of Bernstein's polynomials."""
    n = degree
    return np.array([[comb(j, p) / comb(n, p) for p in range(n + 1)] for j in range(n + 1)])


@lru_cache(maxsize=32)
def _middle(degree: int) -> Array:
    """Weights of control points in the middle of a piece, (d + 1,)."""
    return np.array([comb(degree, j) for j in range(degree + 1)]) / 2.0**degree


@lru_cache(maxsize=32)
def _to_halves(degree: int) -> Array:
    """From control points of a piece to those of its first and of its second half, by de
    Casteljau's method, (2, d + 1, d + 1)."""
    first = np.zeros((degree + 1, degree + 1))
    for j in range(degree + 1):
        first[: j + 1, j] = _middle(j)
    return np.stack([first, first[::-1, ::-1]])


def _halved(points: Array) -> Array:
    """Control points of the first halves of all pieces, then of the second halves."""
    halves = points @ _to_halves(points.shape[2] - 1)[:, None]
    return halves.reshape(-1, *points.shape[1:])


@lru_cache(maxsize=32)
def _tangents(constraints: Constraints) -> RowFunction:
    """(x, numbers of the limits) -> measures of the convex rows and their derivatives by x."""
    x, numbers = ca.SX.sym("x", 3), constraints.numbers()
    measures = constraints.convex_measures(x, numbers)
    slopes = ca.densify(ca.vec(ca.jacobian(measures, x).T))
    outputs = [ca.densify(measures), slopes]
    return RowFunction(ca.Function("tangents", [x, numbers], outputs, {"cse": True}))
