"""Constraint tightening: lower limits where a motion would exceed them between its mesh points.

Where a torque of the best motion jumps inside an interval so does its acceleration, which a
polynomial cannot follow: between the points where limits are imposed the other torques exceed them,
by an amount proportional to the length of the interval. Shorter intervals reduce that slowly, and
slowing the motion makes all intervals pay for one. A limit lowered by the excess in that interval
alone costs the excess times the limit's multiplier there, which is small if the interval is short.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from deltaopt.curves.piecewise import Array, Index, Truths, with_neighbours
from deltaopt.motion.sure_bounds import signed_distances
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.mesh.error_estimate import FRACTIONS
from deltaopt.planning.nlp.scaling import UNTIGHTENED, Scaling
from deltaopt.problem.problem import Problem

_OVERSHOOT_FACTOR = 1.25
"""Tightening over the overshoot that was seen. The next motion overshoots about as much; a larger
factor costs time, a smaller one further solves."""
_KEPT_SHARE = 0.9
"""Share of the last tightening that is kept at least on an interval that was not split. Without
it, a limit that is just kept would be released and exceeded again."""
_NEAR_LIMIT = 0.99
"""Rows whose largest value in an interval exceeds this share of the bound are tightened: the next
motion may bring them to their bound."""
_SMALLEST_SHARE = 0.2
"""Smallest share of a limit that tightening leaves, so that one interval cannot slow the motion
much. Beside a reversal with Coulomb friction a rate of torques changes by several times its limit
within an interval, and motions on coarse meshes cut off bodies and cylinders of approach deeply."""
_SHARPEST = 2e-5
"""Least distance in m that motions are planned at from bodies whose edges neither tool nor
clearance rounds: edges then have this radius. Less is slower to solve; it costs this distance times
what a metre of clearance costs, which is told as part of the gap."""
_FROM_FACES = 1e-9
"""Least distance in m from faces of bodies: what a solver may leave costs a solve otherwise."""
_SHARE_OF_ROOM, _LOOKED_AT = 0.9, 4
"""Of the distance from a body that the motion before had in an interval, what it is to have at
most, and places that are looked at there: a motion may have to begin beside a body."""
_ROUNDING_OF_CORNERS, _POINTS_OF_INTERVAL = 1.2, 3
"""Radius of an edge as a share of the distance between points, of which an interval, or its thirds
together, has so many beside those of the next. A larger one keeps coarse meshes farther from
bodies, which more meshes must make up for; with a smaller one solutions depend on where the points
happen to lie, and with half of it they lead through thin bodies between them."""


def tightened_where_exceeded(
    scaling: Scaling,
    before: Array,
    mesh: Array,
    points: Array,
    size: Array,
    tightened: Truths,
    anywhere: Truths,
    is_short: Truths,
) -> Scaling:
    """The scaling with limits tightened, for a next ``mesh``, by as much as rows between the points
    of an interval exceed the same rows at its points.

    ``scaling``: the one that a motion was found with on the mesh ``before``, which the next one
    divides. ``points``: fractions of an interval where the bounds are imposed. ``size``: of the
    rows at ``FRACTIONS`` of the intervals, 1 at a bound, (N, len(FRACTIONS), rows). ``tightened``:
    which rows may be tightened, (rows,). ``anywhere``: rows that are tightened in intervals of any
    length, (rows,); they may exceed their bounds at the points too, where a formulation's
    coordinates close loops at nodes alone, as rows of jerk may, which are imposed on one side of
    some points alone. ``is_short``: intervals of the next mesh in which all of these are, (M,).
    """
    constraints, shares = scaling.constraints, scaling.shares(len(before))
    highest = size.max(axis=1)
    over = highest - size[:, samples_at(points)].max(axis=1)
    at_points_too = anywhere | (constraints.orders == 3)
    over = np.maximum(over, np.where(at_points_too, highest - shares, 0.0))
    over = np.where((highest > _NEAR_LIMIT) & tightened, over, 0.0)
    density = with_neighbours(over / before[:, None])  # where the jump may come to lie
    inside = _places_in(before, mesh)
    over = _OVERSHOOT_FACTOR * density[inside] * mesh[:, None]
    is_whole = mesh > 0.99 * before[inside]
    over = np.maximum(over, _KEPT_SHARE * (1 - shares[inside]) * is_whole[:, None])
    share = np.maximum(1 - over, _SMALLEST_SHARE)
    untouched = np.logical_not(is_short[:, None] | anywhere)
    return replace(scaling, share=np.where(untouched, UNTIGHTENED, share))


def bulge(points: Array, size: Array, highest: Array) -> Array:
    """By how much a motion bulges over convex limits of its position between the points of an
    interval, as a share of the bound, (N, rows): over a body's side, which a motion between two
    points at it cuts off. ``size``: as of ``tightened_where_exceeded``, of these rows.
    ``highest``: of all instants of an interval, (N, rows)."""
    over = np.maximum(highest - size[:, samples_at(points)].max(axis=1), 0.0)
    return np.where(highest > _NEAR_LIMIT, over, 0.0)


def bulge_shares(
    before: Array, mesh: Array, points: Array, size: Array, highest: Array, shares: Array
) -> Array:
    """Shares of the bounds of these limits for a next ``mesh``, (M, rows), which divides the one
    ``before``: less by what a motion bulges over them, which falls with the square of an interval's
    length, and by what it exceeds at the points the ``shares`` that it was found with, (N, rows),
    which the solver left."""
    at_points = size[:, samples_at(points)].max(axis=1)
    left = np.where(highest > _NEAR_LIMIT, np.maximum(at_points - shares, 0.0), 0.0)
    inside = _places_in(before, mesh)
    part = (mesh / before[inside])[:, None]
    over, left = (with_neighbours(e)[inside] for e in (bulge(points, size, highest), left))
    tightening = _OVERSHOOT_FACTOR * (over * part**2 + left)
    return np.maximum(1 - tightening, _SMALLEST_SHARE)


def _places_in(before: Array, mesh: Array) -> Index:
    """The interval of a mesh that each interval of one that divides it is in, (M,)."""
    return np.searchsorted(np.cumsum(before)[:-1], np.cumsum(mesh) - mesh / 2)


def corner_shares(scaling: Scaling, motion: Trajectory, mesh: Array) -> Array:
    """Shares of limits that are convex in the position, for a mesh, (M, rows), with which points on
    both sides of a sharp edge find their way around it.

    ``motion``: a guess or the solution before. Around an edge of a smaller radius than the points
    are apart, a solver is caught in minima that are the mesh's alone, each with other points on
    either side of the edge. Farther from the body its edges are rounder: the distance kept is a
    share of that between points, though no more than the motion has.
    """
    limits, apart = scaling.limits, points_apart(scaling.problem, motion, mesh)
    convex = limits.constraints.convex
    wanted = np.maximum(_ROUNDING_OF_CORNERS * apart, _SHARPEST)[:, None] - limits.edge_radii
    if scaling.faces is not None:  # there phases meet instead
        wanted = np.where(scaling.faces.rows, _FROM_FACES, wanted)
    room = _least_distances(scaling, motion, mesh) - limits.least_distances
    over = np.clip(wanted, 0.0, np.maximum(_SHARE_OF_ROOM * room, 0.0)) / limits.scales[convex]
    return np.maximum(1 - over, _SMALLEST_SHARE)


def _least_distances(scaling: Scaling, motion: Trajectory, mesh: Array) -> Array:
    """The least measures of limits that are convex in the position in each interval of a mesh, by
    samples of a motion, (M, rows)."""
    begin, fractions = np.cumsum(mesh) - mesh, np.linspace(0.0, 1.0, _LOOKED_AT)
    shares = (begin[:, None] + mesh[:, None] * fractions).ravel()
    x = motion.position.at(motion.knots[0] + motion.duration * np.minimum(shares, 1.0))
    distances, _ = signed_distances(scaling.problem, x)
    return np.asarray(distances.reshape(len(mesh), _LOOKED_AT, -1).min(axis=1))


def points_apart(problem: Problem, motion: Trajectory, mesh: Array) -> Array:
    """How far the points of each interval of a mesh are apart on a motion, (M,), m."""
    knots = np.append(0.0, np.cumsum(mesh))
    x = motion.position.at(motion.knots[0] + motion.duration * knots)
    points = _POINTS_OF_INTERVAL / problem.together
    return np.asarray(np.linalg.norm(np.diff(x, axis=0), axis=1) / points)


def first_tightening(scaling: Scaling, guess: Trajectory, mesh: Array) -> Scaling:
    """A scaling for the first mesh: limits at sharp edges tightened, all others as they are."""
    constraints = scaling.constraints
    if not constraints.has_convex:
        return scaling
    share = scaling.shares(len(mesh)).copy()
    share[:, constraints.convex] = corner_shares(scaling, guess, mesh)
    return replace(scaling, share=share)


def samples_at(points: Array) -> Index:
    """Which of ``FRACTIONS`` are the points where bounds are imposed."""
    return np.asarray(np.abs(FRACTIONS[:, None] - points).argmin(axis=0))
