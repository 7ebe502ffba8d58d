"""Distances of a spherical tool from keep-out bodies, from the scene's own words.

Nothing is shared with the package: no sum of body and tool, no surface of triangles. Boxes and
cylinders are clamped, half-spaces are planes, and the faces of a hull are those planes through
three of its points that have all others on one side.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from deltaopt.robot.tool import Box, Sphere
from deltaopt.scene.bodies import Body, Cylinder, HalfSpace, Hull
from deltaopt.scene.scene import Scene

Array = NDArray[np.float64]

_FLAT = 1e-12
"""m², and m: three points on a line, and a point in a plane, but for rounding."""


def tool_distances(scene: Scene, x: Array) -> Array:
    """Distances of the tool, with its point at places (N, 3), m, from each body, (N, bodies), m;
    negative where they overlap. The tool is a point or a sphere about it."""
    tool = scene.robot.tool
    assert tool is None or tool.shapes is None
    radius = 0.0 if tool is None else tool.radius or 0.0
    return np.stack([point_distances(body, x) - radius for body in scene.keep_out or ()], axis=1)


def point_distances(body: Body, x: Array) -> Array:
    """Distances of places (N, 3), m, from a body, (N,), m; inside they are negative, and those from
    the nearest face."""
    shape = body.shape
    if isinstance(shape, Sphere):
        return np.asarray(np.linalg.norm(x - np.array(shape.centre), axis=1) - shape.radius)
    if isinstance(shape, HalfSpace):
        normal = np.array(shape.normal) / np.linalg.norm(shape.normal)
        return np.asarray((np.array(shape.point) - x) @ normal)
    if isinstance(shape, Box):
        low, high = np.array(shape.centre) - shape.half, np.array(shape.centre) + shape.half
        outside = np.linalg.norm(x - np.clip(x, low, high), axis=1)
        inside = np.minimum(x - low, high - x).min(axis=1)
        return np.asarray(np.where(outside > 0, outside, -inside))
    if isinstance(shape, Cylinder):
        return _from_cylinder(shape, x)
    assert isinstance(shape, Hull)
    return _from_hull(np.array(shape.points), x)


def _from_cylinder(shape: Cylinder, x: Array) -> Array:
    one, other = (np.array(end) for end in shape.ends)
    length = np.linalg.norm(other - one)
    along = (x - one) @ (other - one) / length
    away = x - one - along[:, None] * (other - one) / length
    aside = np.linalg.norm(away, axis=1) - shape.radius
    beyond = np.maximum(-along, along - length)
    outside = np.hypot(np.maximum(aside, 0), np.maximum(beyond, 0))
    return np.asarray(np.where(outside > 0, outside, np.maximum(aside, beyond)))


def _from_hull(points: Array, x: Array) -> Array:
    """From all triangles of three points that lie in a face: together they are the surface."""
    outside, inside = np.full(len(x), np.inf), np.full(len(x), -np.inf)
    for triple in combinations(range(len(points)), 3):
        corners = points[list(triple)]
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        if np.linalg.norm(normal) < _FLAT:
            continue
        normal /= np.linalg.norm(normal)
        heights = (points - corners[0]) @ normal
        if heights.max() > _FLAT and heights.min() < -_FLAT:
            continue
        outwards = normal if heights.max() <= _FLAT else -normal
        inside = np.maximum(inside, (x - corners[0]) @ outwards)
        outside = np.minimum(outside, _from_triangle(corners, normal, x))
    return np.asarray(np.where(inside > 0, outside, inside))


def _from_triangle(corners: Array, normal: Array, x: Array) -> Array:
    """By barycentric coordinates of the foot, and from the three sides where it is not inside."""
    a, b, c = corners
    height = (x - a) @ normal
    shares = np.linalg.lstsq(np.stack([b - a, c - a], axis=1), (x - a).T, rcond=None)[0]
    is_over = (shares >= 0).all(axis=0) & (shares.sum(axis=0) <= 1)
    sides = [_from_side(one, other, x) for one, other in ((a, b), (b, c), (c, a))]
    return np.asarray(np.where(is_over, np.abs(height), np.min(sides, axis=0)))


def _from_side(one: Array, other: Array, x: Array) -> Array:
    share = np.clip((x - one) @ (other - one) / ((other - one) @ (other - one)), 0, 1)
    return np.asarray(np.linalg.norm(x - one - share[:, None] * (other - one), axis=1))
