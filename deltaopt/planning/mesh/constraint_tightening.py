"""Constraint tightening: lower limits where a motion would exceed them between its mesh points.

Where a torque of the best motion jumps inside an interval so does its acceleration, which a
polynomial cannot follow: between the points where limits are imposed the other torques exceed them,
by an amount proportional to the length of the interval. Shorter intervals reduce that slowly, and
slowing the motion makes all intervals pay for one. A limit lowered by the excess in that interval
alone costs the excess times the limit's multiplier there, which is small if the interval is short.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deltaopt.motion.sure_bounds import signed_distances
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.mesh.error_estimate import FRACTIONS, TIGHTENED
from deltaopt.planning.nlp.phases import with_neighbours
from deltaopt.planning.nlp.scaling import UNTIGHTENED, Scaling
from deltaopt.problem.problem import Problem

Array = NDArray[np.float64]
Truths = NDArray[np.bool]

_OVERSHOOT_FACTOR = 1.25
"""Tightening over the overshoot that was seen. The next motion overshoots about as much; a larger
factor costs time, a smaller one further solves."""
_KEPT_SHARE = 0.9
"""Share of the last tightening that is kept at least on an interval that was not split. Without
it, a limit that is just kept would be released and exceeded again."""
_NEAR_LIMIT = 0.99
"""Rows whose largest value in an interval exceeds this share of the bound are tightened: the next
motion may bring them to their bound."""
_SMALLEST_SHARE = 0.9
"""Smallest share of a limit that tightening leaves, so that one interval cannot slow the motion
much."""
_SMALLEST_SHARE_OF_PLACES = 0.5
"""Smallest share for bulges over bodies and out of a tube, which motions on coarse meshes cut off
deeply."""
_SMALLEST_SHARE_OF_APPROACH = 0.2
"""Smallest share of an approach: in a cylinder of micrometres a cubic is as far beyond it between
points as these are from its axis, and hardly any time is to be gained there."""
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


@dataclass(frozen=True)
class Overshoot:
    """By how much rows between the points of an interval exceed the same rows at its points.

    ``mesh``: lengths of the intervals, fractions of the duration, (N,). ``each``: the overshoot as
    a share of the bound, (N, rows); zero for rows that are not to be tightened. ``anywhere``: rows
    that are tightened in intervals of any length, (rows,).
    """

    mesh: Array
    each: Array
    anywhere: Truths | bool = False

    @classmethod
    def of(
        cls,
        mesh: Array,
        points: Array,
        size: Array,
        tightened: Truths,
        anywhere: Truths | bool = False,
        shares: Array | float = 1.0,
        jumping: Truths | bool = False,
    ) -> Overshoot:
        """Measure the overshoot on a mesh.

        ``points``: fractions of an interval where the bounds are imposed. ``size``: of the rows at
        ``FRACTIONS`` of the intervals, 1 at a bound, (N, len(FRACTIONS), rows). ``tightened``:
        which rows may be tightened, (rows,). ``anywhere``: as of the class.
        ``shares``: of their bounds that rows were to use, (N, rows): those of ``anywhere`` may
        exceed them at the points too, where a formulation's coordinates close loops at nodes alone.
        ``jumping``: rows of jerk, (rows,), which are imposed on one side of some points alone.
        """
        at_points = samples_at(points)
        highest = size.max(axis=1)
        over = highest - size[:, at_points].max(axis=1)
        over = np.maximum(over, np.where(anywhere | jumping, highest - shares, 0.0))
        return cls(mesh, np.where((highest > _NEAR_LIMIT) & tightened, over, 0.0), anywhere)

    def tightened(self, scaling: Scaling, mesh: Array) -> Scaling:
        """The scaling with tightened limits for a next ``mesh``, which divides this one.

        ``scaling``: the one that the motion on this mesh was found with.
        """
        density = with_neighbours(self.each / self.mesh[:, None])  # where the jump may come to lie
        inside = np.searchsorted(np.cumsum(self.mesh)[:-1], np.cumsum(mesh) - mesh / 2)
        over = _OVERSHOOT_FACTOR * density[inside] * mesh[:, None]
        used = 1 - scaling.shares(len(self.mesh))[inside]
        is_whole = mesh > 0.99 * self.mesh[inside]
        over = np.maximum(over, _KEPT_SHARE * used * is_whole[:, None])
        smallest = np.where(
            scaling.constraints.slid_along, _SMALLEST_SHARE_OF_PLACES, _SMALLEST_SHARE
        )
        smallest[scaling.constraints.in_phases] = _SMALLEST_SHARE_OF_APPROACH
        share = np.maximum(1 - over, smallest)
        untouched = (mesh > TIGHTENED)[:, None] & np.logical_not(self.anywhere)
        share = np.where(untouched, UNTIGHTENED, share)
        return replace(scaling, share=share)


@dataclass(frozen=True)
class Bulge:
    """By how much a motion bulges over convex limits of its position between the points of an
    interval: over a body's side, which a motion between two points at it cuts off.

    ``mesh``: lengths of the intervals, fractions of the duration, (N,). ``over``: the bulge, as a
    share of the bound, (N, rows): it falls with the square of an interval's length. ``left``: by
    how much the bounds that were imposed at the points are exceeded there, (N, rows): what the
    solver left.
    """

    mesh: Array
    over: Array
    left: Array

    @classmethod
    def of(
        cls, mesh: Array, points: Array, size: Array, highest: Array, shares: Array | float
    ) -> Bulge:
        """Measure it on a mesh.

        ``points``: fractions of an interval where the bounds are imposed. ``size``: of the rows at
        ``FRACTIONS`` of the intervals, 1 at a bound, (N, len(FRACTIONS), rows). ``highest``: of
        all instants of an interval, (N, rows). ``shares``: of their bounds that rows were to use,
        (N, rows).
        """
        at_points = size[:, samples_at(points)].max(axis=1)
        near = highest > _NEAR_LIMIT
        over = np.where(near, np.maximum(highest - at_points, 0.0), 0.0)
        return cls(mesh, over, np.where(near, np.maximum(at_points - shares, 0.0), 0.0))

    def shares(self, mesh: Array) -> Array:
        """Shares of the bounds for a next ``mesh``, (M, rows)."""
        inside = np.searchsorted(np.cumsum(self.mesh)[:-1], np.cumsum(mesh) - mesh / 2)
        part = (mesh / self.mesh[inside])[:, None]
        over, left = (with_neighbours(each)[inside] for each in (self.over, self.left))
        tightening = _OVERSHOOT_FACTOR * (over * part**2 + left)
        return np.maximum(1 - tightening, _SMALLEST_SHARE_OF_PLACES)


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
    room = _least_distances(scaling, motion, mesh) - limits.bounds[0][convex]
    over = np.clip(wanted, 0.0, np.maximum(_SHARE_OF_ROOM * room, 0.0)) / limits.scales[convex]
    return np.maximum(1 - over, _SMALLEST_SHARE_OF_PLACES)


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


def samples_at(points: Array) -> NDArray[np.intp]:
    """Which of ``FRACTIONS`` are the points where bounds are imposed."""
    return np.asarray(np.abs(FRACTIONS[:, None] - points).argmin(axis=0))
