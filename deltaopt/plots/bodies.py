"""Keep-out bodies as shadows in a picture of a path."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon

from deltaopt.motion.trajectory import Array
from deltaopt.plots.colours import LIGHT_GREY
from deltaopt.robot.tool import Box, Sphere
from deltaopt.scene.bodies import Body, Cylinder, HalfSpace
from deltaopt.scene.scene import Scene

_ROUND = 48
"""Points around a circle."""
_FAR = 3.0
"""How far a half-space is drawn, m: beyond all that a picture shows."""


def draw_bodies(axes: Axes, scene: Scene, place: Callable[[Array], Array]) -> None:
    """Draw the outlines of a scene's bodies behind what is drawn already, whose range stays.

    ``place``: takes points (N, 3), m, to the picture, (N, 2).
    """
    if scene.keep_out is None:
        return
    for body in scene.keep_out:
        if _covers_all(body, place):
            continue
        outline = place(_points(body))
        shadow = Polygon(_hull(outline), color=LIGHT_GREY, linewidth=0.0, zorder=0)
        axes.add_artist(shadow)  # which, unlike a patch, does not widen the range


def _covers_all(body: Body, place: Callable[[Array], Array]) -> bool:
    """Whether a body is a half-space whose plane is seen from its front."""
    if body.half_space is None:
        return False
    seen = np.diff(place(np.array([np.zeros(3), body.half_space.normal])), axis=0)
    return float(np.linalg.norm(seen)) < 1e-6


def _points(body: Body) -> Array:
    """Points of a body of which it is the convex hull, about, (N, 3), m."""
    shape = body.shape
    if isinstance(shape, Box):
        corners = np.array(list(product((-1.0, 1.0), repeat=3)))
        return np.asarray(np.array(shape.centre) + corners * shape.half)
    if isinstance(shape, Sphere):
        up, around = np.meshgrid(np.linspace(0, np.pi, _ROUND // 2), _angles())
        directions = [np.cos(up), np.sin(up) * np.cos(around), np.sin(up) * np.sin(around)]
        ball = np.stack(directions, axis=-1).reshape(-1, 3)
        return np.asarray(np.array(shape.centre) + shape.radius * ball)
    if isinstance(shape, Cylinder):
        begin, end = (np.array(each) for each in shape.ends)
        ring = shape.radius * _ring((end - begin) / shape.length)
        return np.vstack([begin + ring, end + ring])
    if isinstance(shape, HalfSpace):
        normal = np.array(shape.normal) / np.linalg.norm(shape.normal)
        plane = np.array(shape.point) + _FAR * _ring(normal)
        return np.vstack([plane, plane + _FAR * normal])
    return np.array(shape.points)


def _angles() -> Array:
    return np.linspace(0, 2 * np.pi, _ROUND)


def _ring(axis: Array) -> Array:
    """A circle of radius 1 about an axis, (N, 3)."""
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    first /= np.linalg.norm(first)
    second, angles = np.cross(axis, first), _angles()[:, None]
    return np.asarray(np.cos(angles) * first + np.sin(angles) * second)


def _hull(points: Array) -> Array:
    """The corners of the convex hull of points in a plane, in their order, (n, 2)."""
    ordered = points[np.lexsort(points.T[::-1])]
    halves = []
    for line in (ordered, ordered[::-1]):
        chain: list[Array] = []
        for point in line:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
                chain.pop()
            chain.append(point)
        halves += chain[:-1]
    return np.array(halves)


def _turn(a: Array, b: Array, c: Array) -> float:
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
