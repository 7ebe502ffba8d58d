"""d(x) ≥ clearance: the signed distance of the tool's point from each keep-out body, grown by the
tool.

A distance from a convex body is a convex function of the point, so that its tangent planes bound it
from below: that is how it is known between samples (``motion/sure_bounds.py``). Bodies are numbers;
their count is rounded up, and unused places are filled with bodies that are far away, so that few
functions serve all scenes.

Where neither tool nor clearance rounds a body's edges, the distance has kinks at them, at which no
derivative tells how a motion may slide around. So limits also say how round they are.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import chain
from math import dist, hypot, inf

import casadi as ca
import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.limits.limit import (
    SX,
    Bounds,
    ConvexLimit,
    Described,
    Instant,
    Limit,
    Numbers,
    OwnMeasure,
)
from deltaopt.limits.solid_distance import (
    AXES,
    CENTRE,
    HALF,
    IS_ROUND,
    OF_SOLID,
    RADIUS,
    TINY,
    distance_from_solid,
    larger,
    numbers_of_solid,
    positive,
    root,
    selected,
    where,
)
from deltaopt.robot.solids import ALONG_THE_BASE, MOST_TRIANGLES, Convex, Polytope, Solid

SCALE = 0.25
"""Natural size of distances, as a share of the way from start to goal. It decides how far from
bodies the first iterates of a solver are pushed."""
FAR = Solid(ALONG_THE_BASE, (1e4, 1e4, 1e4), (0.0, 1.0, 0.0), True, 0.0)
"""Fills unused places."""
USUAL_WAY = 0.3
"""How far a motion goes as a rule, m, where the goal is no given point."""
_HUGE = 100.0
"""Half the length of a side of a box, m, of which no motion meets an edge."""
_SIDE = 1e3
"""Half the length of a side of the box, or of the triangle, that stands for all beyond a face, m:
no motion comes near its edges, and its rounding error is 1e-13 m."""
_TRIANGLE = ((0.0, 2.0), (-2.0, -1.0), (2.0, -1.0))
"""Corners of a triangle about the origin, counter-clockwise."""
_SAME_PLANE = 1e-9
"""Of unit normals, and of distances in m: what two planes differ by that are the same."""
OF_LIMIT = 3
"""Numbers of every body beside its shape: the least distance, the scale, and the least distance
again, -inf for a place that is not used."""
_KEPT, _SCALE, _BOUND = -3, -2, -1
"""Where these are among a body's numbers, which end with them."""
PLACES = (1, 2, 4, 8, 16, 32, 64)
_TRIANGLES = (16, MOST_TRIANGLES)
MOST_SOLIDS = PLACES[-1]
"""In a scene, and of a hull: each size is compiled when it is first met."""


class Distances(Limit):
    """Least distances from some bodies: those of one have a part of the numbers each, which ends
    with the natural size and the least distance, m (``kept_from``)."""

    def _size(self, numbers: int) -> int:
        """How many of so many numbers each has."""
        raise NotImplementedError

    def _distance(self, motion: Instant, own: SX) -> SX:
        """One signed distance, by its numbers."""
        raise NotImplementedError

    def _split(self, numbers: SX) -> list[SX]:
        """The numbers of each."""
        return list(ca.vertsplit(numbers, self._size(numbers.numel())))

    def bounds(self, numbers: SX) -> Bounds:
        each = self._split(numbers)
        lower, scale = (ca.vertcat(*(own[i] for own in each)) for i in (_BOUND, _SCALE))
        return Bounds(lower, None, scale, out_of_reach=True)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return ca.vertcat(*(self._distance(motion, own) for own in self._split(numbers)))

    def rows(self, motion: Instant, numbers: SX) -> SX:
        each = self._split(numbers)
        return ca.vertcat(*(distance_row(self._distance(motion, own), own) for own in each))


class _KeepOut(Distances, ConvexLimit):
    """What both families of bodies share. Edges are those that the tool's point goes around."""

    name, unit, subject, order = "clearance", "m", "tool", 0
    own_measure = OwnMeasure.CLEARANCE


class KeepOut(_KeepOut):
    """Least distance of the tool's point from boxes, spheres, cylinders and half-spaces."""

    def items(self, scene: Described) -> Sequence[Numbers]:
        solids = [each for each in scene.kept_out if isinstance(each, Solid)]
        if not solids:
            return []
        places = next(n for n in PLACES if n >= len(solids))
        filled = [(solid, scene.least_clearance) for solid in solids]
        filled += [(FAR, -inf)] * (places - len(solids))
        each = ((*numbers_of_solid(solid), *kept_from(scene, least)) for solid, least in filled)
        return [tuple(chain.from_iterable(each))]

    def edge_radius(self, own: Array) -> float:
        first = own[HALF][0]
        return float(own[RADIUS] + (first if first > _HUGE else 0.0) + own[_KEPT])

    def _size(self, numbers: int) -> int:
        return OF_SOLID + OF_LIMIT

    def faces(self, own: Array) -> list[Array]:
        return [self._face(own, side) for side in _sides(own)]

    def _face(self, own: Array, side: _Side) -> Array:
        """All beyond one side of a solid, whose other sides are then far away."""
        face, (axis, sign) = own.copy(), side
        if sign:
            face[CENTRE] += sign * (own[HALF][axis] - _SIDE) * _axis(own, axis)
            face[HALF], face[IS_ROUND] = _SIDE, 0.0
        else:
            face[HALF][2] = _SIDE
        return face

    def opened(self, own: Array, faces: Collection[int]) -> Array | None:
        sides, wide = _sides(own), own.copy()
        for axis, sign in (sides[face] for face in faces):
            if not sign:
                return None
            wide[CENTRE] += sign * _SIDE * _axis(own, axis)
            wide[HALF][axis] += _SIDE
        return wide

    def _distance(self, motion: Instant, own: SX) -> SX:
        return distance_from_solid(motion.x, own)


_Side = tuple[int, int]
"""Of a solid: an axis and in which direction; a cylinder's curved side has no direction, 0."""


def _sides(own: Array) -> list[_Side]:
    """The sides of a solid that a motion may meet, by its numbers."""
    is_round, half = bool(own[IS_ROUND]), own[HALF]
    curved = [(0, 0)] if is_round and half[2] < _HUGE else []
    axes = (2,) if is_round else (0, 1, 2)
    return curved + [(i, sign) for i in axes if half[i] < _HUGE for sign in (1, -1)]


def _axis(own: Array, axis: int) -> Array:
    """A unit vector of a solid's axes, (3,), by its numbers."""
    return np.asarray(own[AXES].reshape(3, 3)[axis])


@dataclass(frozen=True)
class KeepOutHull(_KeepOut):
    """Least distance of the tool's point from the convex hulls of points.

    ``triangles``: of a hull at most. The nearest is found by its value, and that one alone is
    differentiated: the distance from a convex body changes smoothly from one to the next.
    """

    triangles: int

    def items(self, scene: Described) -> Sequence[Numbers]:
        fewer = max((n for n in _TRIANGLES if n < self.triangles), default=0)
        return [
            (*self._corners(hull), hull.radius, *kept_from(scene, scene.least_clearance))
            for hull in scene.kept_out
            if isinstance(hull, Polytope) and fewer < len(hull.triangles) <= self.triangles
        ]

    def _corners(self, hull: Polytope) -> Numbers:
        """Of its triangles, the first of them as often as is needed."""
        missing = self.triangles - len(hull.triangles)
        corners = np.array([*hull.triangles, *[hull.triangles[0]] * missing])
        return tuple(corners.ravel().tolist())

    def _size(self, numbers: int) -> int:
        return numbers

    def faces(self, own: Array) -> list[Array]:
        corners = own[: 9 * self.triangles].reshape(self.triangles, 3, 3)
        found, planes = list[Array](), list[Array]()
        for a, b, c in corners:
            normal = np.cross(b - a, c - a)
            normal /= hypot(*normal)
            plane = np.append(normal, (normal * a).sum())
            if any(np.abs(plane - other).max() < _SAME_PLANE for other in planes):
                continue
            planes.append(plane)
            first = (b - a) / dist(a, b)
            second = np.cross(normal, first)
            wide = [a + _SIDE * (x * first + y * second) for x, y in _TRIANGLE]
            face = own.copy()
            face[: 9 * self.triangles] = np.tile(np.ravel(wide), self.triangles)
            found.append(face)
        return found

    def edge_radius(self, own: Array) -> float:
        return float(own[9 * self.triangles] + own[_KEPT])

    def _distance(self, motion: Instant, own: SX) -> SX:
        x = motion.x
        triangles = ca.vertsplit(own[: 9 * self.triangles], 9)
        radius = own[9 * self.triangles]
        highest, plane = selected([_above_plane(x, each) for each in triangles], triangles, 1)
        _, nearest = selected([_squared_distance(x, each) for each in triangles], triangles, -1)
        outside = root(_squared_distance(x, nearest))
        is_inside = highest < 0
        inside = where(is_inside, _above_plane(x, plane))
        return inside + where(ca.logic_not(is_inside), outside) - radius


def hull_limits() -> tuple[KeepOutHull, ...]:
    """Limits for hulls of few triangles and of more: each size is a function of its own."""
    return tuple(KeepOutHull(n) for n in _TRIANGLES)


def place_among_rows(body: Convex) -> int:
    """What bodies are sorted by, so that they are in the order of the rows of these limits."""
    return len(body.triangles) > _TRIANGLES[0] if isinstance(body, Polytope) else -1


def kept_from(scene: Described, least: float) -> Numbers:
    """What follows the numbers of a body: the least distance (m), the scale, and the least distance
    again, -inf where there is none."""
    points = scene.placed_points
    way = dist(points[-1], points[0]) or USUAL_WAY
    return max(least, 0.0), SCALE * way, least


def distance_row(distance: SX, own: SX) -> SX:
    """A distance with its lower bound at -1, and below 0 however large it is: bodies that are far
    away hardly matter. The slope is 1 and the second derivative continuous at the bound."""
    over = (distance - own[_KEPT]) / own[_SCALE]
    near, beyond = positive(over), positive(-over)
    return -1 + near / (1 + near) - beyond - beyond**2


def _above_plane(x: SX, triangle: SX) -> SX:
    """Height of a point above the plane of a triangle."""
    a, b, c = ca.vertsplit(triangle, 3)
    normal = ca.cross(b - a, c - a)
    return ca.dot(normal, x - a) / root(ca.sumsqr(normal))


def _squared_distance(x: SX, triangle: SX) -> SX:
    """Squared distance of a point from a triangle: from its plane where the point is above it,
    otherwise from the nearest of its edges."""
    corners = ca.vertsplit(triangle, 3)
    normal = ca.cross(corners[1] - corners[0], corners[2] - corners[0])
    from_edges, is_beside = [], SX(0)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        edge, away = corners[b] - corners[a], x - corners[a]
        share = ca.dot(away, edge) / larger(ca.sumsqr(edge), SX(TINY))
        share = share - positive(share - 1) + positive(-share)
        from_edges.append(ca.sumsqr(away - share * edge))
        is_beside = is_beside + (ca.dot(ca.cross(edge, away), normal) < 0)
    height = ca.dot(normal, x - corners[0]) ** 2 / larger(ca.sumsqr(normal), SX(TINY))
    beside = is_beside > 0
    nearest = -larger(-from_edges[0], larger(-from_edges[1], -from_edges[2]))
    return where(beside, nearest) + where(ca.logic_not(beside), height)
