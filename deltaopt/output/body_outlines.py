"""What is about a path, for pictures: points of which a body is the convex hull, and its edges; the
tube and the cylinders that a motion stays in."""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.robot.tool import Box, Sphere
from deltaopt.scene.bodies import Body, Cylinder, HalfSpace, Hull, axes_with, corners_of
from deltaopt.scene.scene import Scene

_ROUND = 48
"""Points around a circle."""
_ALONG_TUBE = 150
"""Points of a tube's axis."""


def hulled_points(body: Body, far: float) -> Array:
    """Points of a body of which it is the convex hull, about, (N, 3), m. A half-space is drawn as
    far as ``far`` (m) about its point and behind it."""
    shape = body.shape
    if isinstance(shape, Box | Hull):
        return corners_of(shape)
    if isinstance(shape, Sphere):
        up, around = np.meshgrid(np.linspace(0, np.pi, _ROUND // 2), _angles())
        directions = [np.cos(up), np.sin(up) * np.cos(around), np.sin(up) * np.sin(around)]
        ball = np.stack(directions, axis=-1).reshape(-1, 3)
        return np.asarray(np.array(shape.centre) + shape.radius * ball)
    if isinstance(shape, Cylinder):
        return np.vstack(_rims(shape))
    plane, normal = _disc(shape, np.array(shape.point), far)
    return np.vstack([plane, plane + far * normal])


def edges_of(body: Body, about: Array, far: float) -> list[Array]:
    """Lines that show a body's shape, each (n, 3), m: the edges of a box, the rims of a cylinder,
    of a half-space a circle in its plane of radius ``far`` about the place nearest to ``about``, m.
    A sphere and a hull have none."""
    shape = body.shape
    if isinstance(shape, Box):
        corners = corners_of(shape)
        pairs = [(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit]
        return [corners[[i, j]] for i, j in pairs]
    if isinstance(shape, Cylinder):
        return _rims(shape)
    if isinstance(shape, HalfSpace):
        return [_disc(shape, about, far)[0]]
    return []


def columns_of(scene: Scene) -> list[Body]:
    """The cylinders of a scene's approach, about its start and its goal; none without."""
    ends = zip(scene.given_points, scene.columns, strict=False)
    shapes = [
        {"from": end, "to": (column.level, *end[1:]), "radius": column.radius}
        for end, column in ends
    ]
    return [Body.model_validate({"cylinder": shape}) for shape in shapes]


def axis_points(scene: Scene) -> Array:
    """Points along the axis of a scene's tube, (N, 3), m; none without."""
    if scene.tube is None or scene.path is None:
        return np.zeros((0, 3))
    axis = scene.path.between(*scene.given_points)
    return axis(np.linspace(axis.knots[0], axis.knots[-1], _ALONG_TUBE))


def _rims(shape: Cylinder) -> list[Array]:
    begin, end = (np.array(each) for each in shape.ends)
    ring = shape.radius * _ring((end - begin) / shape.length)
    return [begin + ring, end + ring]


def _disc(shape: HalfSpace, about: Array, radius: float) -> tuple[Array, Array]:
    """A circle in the plane of a half-space about the place nearest to another one, (N, 3), m, and
    the plane's normal, (3,)."""
    normal = np.array(shape.normal) / np.linalg.norm(shape.normal)
    middle = about - ((about - shape.point) @ normal) * normal
    return middle + radius * _ring(normal), normal


def _angles() -> Array:
    return np.linspace(0, 2 * np.pi, _ROUND)


def _ring(axis: Array) -> Array:
    """A circle of radius 1 about an axis, (N, 3)."""
    (second, first, _), angles = np.array(axes_with(axis)), _angles()[:, None]
    return np.asarray(np.cos(angles) * first - np.sin(angles) * second)
