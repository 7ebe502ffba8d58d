"""How far a motion may be beyond limits that are convex functions of its position: a sure bound.

A distance d from a convex body is a convex function of the place, so that it lies above its tangent
planes: d(x) ≥ d(y) + ∇d(y)·(x − y). Along a polynomial the right side is a polynomial of time,
which lies above the least coefficient of its Bernstein form. That bounds d from below over a whole
piece of a motion, to the second order of the piece's duration; pieces are halved until the bound
says enough. So a limit that is kept is known to be kept at all instants, not at samples alone.
"""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction, dense_function
from deltaopt.curves.halving import Parts, halve_until_known
from deltaopt.curves.piecewise import Array, Index, PiecewisePolynomial, Truths
from deltaopt.limits.constraints import Constraints
from deltaopt.problem.problem import Problem

_HALVINGS = 24
"""At most: a ten-millionth of an interval is some nanoseconds. What is not known then is taken to
be as bad as the bound says."""
_KNOWN, _ANY = 0.1, 1e300
"""Share of an excess to which it is known, for it is cured by tightening a limit a quarter more;
and where no more is asked than whether there is one."""
_TOUCHED = 1e-6
"""Of a row's natural size, by which a line that slides along a body may seem to be inside of it."""
_CELLS = 100_000
"""Pieces that are looked at in all at most: a motion that slides along a body for long is bound by
ever shorter ones."""


def sure_excess(problem: Problem, position: PiecewisePolynomial) -> Array:
    """By how much, at most, each row of ``Constraints.convex`` is beyond its bound in each
    interval, (K, rows), as shares of the rows' natural sizes; negative where it keeps its bound."""
    return _excess(problem, position, np.arange(len(position.coefficients)), _KNOWN)


def rows_not_kept(problem: Problem, position: PiecewisePolynomial) -> Truths:
    """Which rows of ``Constraints.convex`` a motion is not known to keep at all instants, (rows,).
    By how much is of no account, so that this is known sooner."""
    everywhere = np.zeros(len(position.coefficients), dtype=np.intp)
    return np.asarray(_excess(problem, position, everywhere, _ANY)[0] > 0)


def are_crossed(problem: Problem, begin: Array, along: Array, row: Index) -> Truths:
    """Which straight lines are somewhere beyond the bound of one row of ``Constraints.convex``
    each, by more than a millionth of the row's natural size, (N,).

    ``begin``, ``along``: of the lines, (N, 3), m. ``row``: of each, (N,). A convex function lies
    above its tangents at both ends of a line. Where these cross beyond the bound, it is looked at,
    and that place is an end of the part in which the function is least.
    """
    limits, found = problem.limits, np.zeros(len(row), dtype=np.bool)
    bound = limits.least_distances - _TOUCHED * limits.scales[limits.constraints.convex]

    def at(share: Array, line: Index) -> Array:  # (3, n): it, the room there, and its derivative
        way, own = along[line], (np.arange(len(line)), row[line])
        distance, slope = signed_distances(problem, begin[line] + share[:, None] * way)
        return np.stack([share, distance[own] - bound[own[1]], (slope[own] * way).sum(axis=1)])

    line = np.arange(len(row))
    before, after = np.split(at(np.repeat([0.0, 1.0], len(row)), np.tile(line, 2)), 2, axis=1)
    for _ in range(_HALVINGS):
        (first, room, rise), (last, room_after, fall) = before, after
        found[line] = np.minimum(room, room_after) < 0
        bend = np.where((rise < 0) & (fall > 0), fall - rise, np.inf)
        ahead = (room + fall * (last - first) - room_after) / bend
        is_open = ~found[line] & (room + rise * ahead < 0)
        if not is_open.any():
            break
        line = line[is_open]
        there = at((first + ahead)[is_open], line)
        before = np.where(there[2] < 0, there, before[:, is_open])
        after = np.where(there[2] < 0, after[:, is_open], there)
    return found


def _excess(problem: Problem, position: PiecewisePolynomial, groups: Index, known: float) -> Array:
    """The largest excess in each of some groups of pieces, (groups, rows); ``groups``: to which
    each piece belongs. ``known``: share to which it is known where it is positive."""
    limits = problem.limits
    bound, scale = limits.least_distances, limits.scales[limits.constraints.convex]
    most = np.full((groups[-1] + 1, len(bound)), -np.inf)
    least = most.copy()

    def unknown(parts: Parts, is_last: bool) -> Truths:
        middle, own = parts.at(), groups[parts.piece]
        distance, slope = signed_distances(problem, middle)
        away = parts.control_points() - middle[:, None]
        lowest = distance + (slope @ away.swapaxes(1, 2)).min(axis=2)
        below, beyond = (bound - lowest) / scale, (bound - distance) / scale
        np.maximum.at(least, own, beyond)
        enough = (1 + known) * np.maximum(least[own], 0.0)
        is_known = (below <= enough) | is_last
        np.maximum.at(most, own, np.where(is_known, below, beyond))
        return np.asarray(~is_known.all(axis=1))

    halve_until_known(Parts.of(position, 1), unknown, _HALVINGS, _CELLS)
    return most


def signed_distances(problem: Problem, x: Array) -> tuple[Array, Array]:
    """Measures of the rows of ``Constraints.convex`` at places (N, 3), m, (N, rows), and their
    derivatives by the place, (N, rows, 3)."""
    numbers = problem.limits.numbers
    found = [
        function(x, parameters=numbers[own])
        for own, function in _functions(problem.limits.constraints)
    ]
    none = (np.empty((len(x), 0)),) * 2
    whole = found[0] if len(found) == 1 else map(np.hstack, zip(none, *found, strict=True))
    measures, slopes = whole
    return measures, slopes.reshape(*measures.shape, 3)


def distances_from_faces(problem: Problem, x: Array, row: int) -> Array:
    """Distances of places (N, 3), m, from the faces of the body of one of the rows of
    ``Constraints.convex``, (N, faces), m."""
    limits = problem.limits
    part = limits.part_of(row)
    faces = np.array([numbers[part] for numbers in limits.faces[row]])
    functions = _functions(limits.constraints)
    alike = next(each for own, each in functions if part.start in range(own.start, own.stop))
    numbers = np.resize(faces, (-(-len(faces) // alike.times), alike.times * faces.shape[1]))
    found = [alike(x, parameters=several)[0] for several in numbers]  # as if of several bodies
    return np.hstack(found)[:, : len(faces)]


@lru_cache(maxsize=32)
def _functions(constraints: Constraints) -> list[tuple[slice, RowFunction]]:
    """For the convex rows of each item: where their numbers are, and (x, these numbers) -> their
    measures and their derivatives by x."""
    x, functions = ca.SX.sym("x", 3), list[tuple[slice, RowFunction]]()
    for alike in constraints.alike(x):
        outputs = [alike.measure, ca.gradient(alike.measure, x)]
        function = dense_function("tangents", [x, alike.own], outputs)
        functions.append((alike.numbers, RowFunction(function, times=len(alike.rows))))
    return functions
