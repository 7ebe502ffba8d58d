"""Keep-out bodies of a scene, and their sums with the tool.

In a scene file, lengths in m in the base's frame:

    keep_out:
      - box: {from: [0.95, -0.10, -1], to: [2, 0.10, 1]}
      - sphere: {centre: [0.45, 0.02, 0.0], radius: 0.03}
      - cylinder: {from: [0.95, 0, 0], to: [1.2, 0, 0], radius: 0.05}     # with flat ends
      - half_space: {point: [0.9, 0, 0], normal: [1, 0, 0]}  # out of bounds is where normal points
      - hull: {points: [[0.9, 0, 0], …]}                     # or file: PART.stl, its convex hull
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from math import hypot
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError, in_words
from deltaopt.files.units import RATIO
from deltaopt.files.validated_record import Record, Triple, Vector3, optional, vector3
from deltaopt.robot.solids import ALONG_THE_BASE, MOST_TRIANGLES, Axes, Convex, Polytope, Solid
from deltaopt.robot.tool import POINT, Along, Box, Capsule, OneOf, Point, Sphere, Tool
from deltaopt.scene.convex_hull import NoHull, convex_hull

EXPECTED_BODIES = (
    "a list of bodies, each one of box: {from, to}, sphere: {centre, radius}, "
    "cylinder: {from, to, radius}, half_space: {point, normal}, hull: {points or file}"
)
_LARGE = 1e3
"""Half the size of the box that stands for a half-space, m: far beyond any robot, and its rounding
error is 1e-13 m."""
_PARALLEL = 1e-12
"""Of a unit vector: what two directions differ by that count as one."""


class Cylinder(Along):
    """A cylinder with flat ends: its axis from ``from`` to ``to`` and its ``radius``, m.

    Examples:
        >>> pillar = {"from": (0.95, 0, 0), "to": (1.2, 0, 0), "radius": "50 mm"}
        >>> deltaopt.Cylinder(**pillar).radius
        0.05
    """


class HalfSpace(Record):
    """All that lies beyond a plane: ``point`` (m) is in the plane, ``normal`` points out of
    bounds.

    Examples:
        >>> deltaopt.HalfSpace(point=(0.9, 0.0, 0.0), normal=(1.0, 0.0, 0.0)).point
        (0.9, 0.0, 0.0)
    """

    point: Point = Field(description=POINT)
    normal: Annotated[Triple, RATIO] = Field(description="a vector [x, y, z], not zero")

    @property
    def centre(self) -> Vector3:
        """The point that is given, m."""
        return self.point

    def require_consistent(self) -> None:
        if not any(self.normal):
            raise SceneError(None, "normal", self.normal, "a vector [x, y, z], not zero")


class Hull(Record):
    """The convex hull of ``points``, m.

    Examples:
        >>> corners = [(0.9, 0, 0), (1.1, 0.1, 0), (1.1, -0.1, 0), (1.1, 0, 0.1)]
        >>> len(deltaopt.Hull(points=corners).points)
        4
    """

    points: tuple[Point, ...] = Field(description=f"four points or more, each {POINT}")

    @property
    def centre(self) -> Vector3:
        """The mean of its points, m."""
        return vector3(np.mean(self.points, axis=0))

    def require_consistent(self) -> None:
        try:
            convex_hull(np.array(self.points, dtype=float).reshape(-1, 3), MOST_TRIANGLES)
        except NoHull as error:
            raise SceneError(None, "points", len(self.points), str(error)) from None


class Body(OneOf):
    """One keep-out body.

    Examples:
        >>> wall = deltaopt.Body(half_space={"point": (0.9, 0.0, 0.0), "normal": (1.0, 0.0, 0.0)})
        >>> wall.half_space.normal
        (1.0, 0.0, 0.0)
    """

    box: Box | None = optional("a mapping with from, to")
    sphere: Sphere | None = optional("a mapping with centre, radius")
    cylinder: Cylinder | None = optional("a mapping with from, to, radius")
    half_space: HalfSpace | None = optional("a mapping with point, normal")
    hull: Hull | None = optional("a mapping with points or file")
    kinds: ClassVar[str] = EXPECTED_BODIES.removeprefix("a list of bodies, each ")

    @property
    def kind(self) -> str:
        """In words."""
        return self.given.replace("_", "-")

    def named(self, index: int) -> str:
        """Its key in a scene, in which it is the one of this index, and its kind."""
        return f"keep_out[{index}], a {self.kind}"

    @property
    def in_words(self) -> str:
        """Its kind and what gives its size: "box, from [0, 0, 0], to [1, 1, 1] m"."""
        shape = self.shape
        if isinstance(shape, Hull):
            return f"{self.kind} of {len(shape.points)} points about {in_words(shape.centre)} m"
        sizes = (f"{k} {in_words(v) if isinstance(v, tuple) else f'{v:g}'}" for k, v in shape)
        return f"{self.kind}, {', '.join(sizes)} m"


def sums(bodies: Sequence[Body], tool: Tool | None) -> Iterator[tuple[int, Convex]]:
    """What the tool's point must stay out of: for each body its index, and the body grown by a
    shape of the tool, reflected.

    Raises SceneError for a sum that has no closed form here.
    """
    shapes: list[Sphere | Box | Capsule | None] = [None]
    if tool is not None and tool.radius is not None:
        shapes = [Sphere(centre=(0.0, 0.0, 0.0), radius=tool.radius)]
    elif tool is not None and tool.shapes is not None:
        shapes = [each.shape for each in tool.shapes]
    for index, body in enumerate(bodies):
        for shape in shapes:
            found = _sum(body.shape, shape)
            if found is None:
                raise SceneError(
                    None,
                    f"keep_out[{index}]",
                    body.kind,
                    "another body, or a tool of spheres or of capsules along the cylinder's axis",
                    f"is a {body.kind}, whose sum with a {type(shape).__name__.lower()} of the "
                    "tool is not known in closed form",
                )
            yield index, found


def solid_about(body: Convex) -> Solid:
    """A body as a solid: of a hull the smallest box about it along the axes of the base's frame or
    of its own inertia, grown by its radius."""
    if isinstance(body, Solid):
        return body
    corners = np.unique(np.array(body.triangles).reshape(-1, 3), axis=0)
    principal = np.linalg.svd(corners - corners.mean(axis=0))[2]
    boxes = [_box_about(corners, axes, body.radius) for axes in (np.eye(3), principal)]
    return min(boxes, key=lambda box: float(np.prod(box.half)))


def solids_about(bodies: Sequence[Body]) -> list[Solid]:
    """Bodies as solids, hulls as boxes about them."""
    return [solid_about(body) for _, body in sums(bodies, None)]


def _box_about(corners: Array, axes: Array, radius: float) -> Solid:
    """The smallest box about points (N, 3), m, along some axes, grown by a radius."""
    along = corners @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    first, second, third = map(vector3, axes)
    centre, half = vector3((low + high) / 2 @ axes), vector3((high - low) / 2)
    return Solid((first, second, third), centre, half, False, radius)


def _sum(
    body: Box | Sphere | Cylinder | HalfSpace | Hull, shape: Sphere | Box | Capsule | None
) -> Convex | None:
    """A body and a shape of the tool, reflected in the tool's point; None where their sum is
    neither a solid nor a polytope."""
    if shape is None:
        return _alone(body, np.zeros(3))
    moved = -np.array(shape.centre)
    if isinstance(shape, Sphere):
        return _grown(_alone(body, moved), shape.radius)
    spread = _half_sides(shape)
    radius = 0.0 if isinstance(shape, Box) else shape.radius
    if isinstance(body, HalfSpace):
        return _grown(_alone(body, moved, spread), radius)
    if isinstance(body, Sphere):
        return _grown(_at(moved + body.centre, shape), body.radius)
    if isinstance(body, Cylinder):
        along = _axis(body)
        if isinstance(shape, Box) or np.linalg.norm(np.cross(along, spread[0])) > _PARALLEL:
            return None
        return _grown(_at(moved + body.centre, body, hypot(*spread[0])), radius)
    if isinstance(body, Box) and all(np.count_nonzero(side) <= 1 for side in spread):
        half = np.array(body.half) + np.abs(spread).sum(axis=0)
        return Solid(ALONG_THE_BASE, vector3(moved + body.centre), vector3(half), False, radius)
    corners = corners_of(body)[:, None] + _ends(spread) + moved
    return _polytope(corners.reshape(-1, 3), radius)


def _grown(solid: Convex, radius: float) -> Convex:
    """All that is within a radius of a solid, m."""
    return replace(solid, radius=solid.radius + radius)


def _alone(
    body: Box | Sphere | Cylinder | HalfSpace | Hull, moved: Array, spread: Array | float = 0.0
) -> Convex:
    """A body, moved; a half-space also by as much as a box or a line of half sides ``spread``, (n,
    3), m, reaches towards it."""
    if isinstance(body, HalfSpace):
        normal = np.array(body.normal) / hypot(*body.normal)
        reach = float(np.abs((spread * normal).sum(axis=-1)).sum())
        middle = np.array(body.point) + moved + (_LARGE - reach) * normal
        return Solid(axes_with(normal), vector3(middle), (_LARGE, _LARGE, _LARGE), False, 0.0)
    if isinstance(body, Hull):
        return _polytope(np.array(body.points) + moved, 0.0)
    return _at(moved + body.centre, body)


def _at(place: Array, shape: Box | Sphere | Along, longer: float = 0.0) -> Solid:
    """A shape with its centre at a place, (3,), m; one along a line longer by so much at both ends.
    Spheres and capsules are cylinders of no radius, grown."""
    centre = vector3(place)
    if isinstance(shape, Box):
        return Solid(ALONG_THE_BASE, centre, shape.half, False, 0.0)
    if isinstance(shape, Sphere):
        return Solid(ALONG_THE_BASE, centre, (0.0, _LARGE, 0.0), True, shape.radius)
    across, radius = (shape.radius, 0.0) if isinstance(shape, Cylinder) else (0.0, shape.radius)
    half = (across, _LARGE, shape.length / 2 + longer)
    return Solid(axes_with(_axis(shape)), centre, half, True, radius)


def _polytope(points: Array, radius: float) -> Polytope:
    triangles = tuple(
        (vector3(a), vector3(b), vector3(c)) for a, b, c in points[convex_hull(points)]
    )
    return Polytope(triangles, radius)


def _half_sides(shape: Box | Capsule) -> Array:
    """Half of the sides of a box, or of the line of a capsule, (n, 3), m."""
    if isinstance(shape, Box):
        return np.diag(shape.half)
    one, other = shape.ends
    return np.subtract(other, one)[None] / 2


def _ends(spread: Array) -> Array:
    """All corners of a box or both ends of a line, from its half sides, (corners, 3)."""
    signs = np.array(list(product((-1.0, 1.0), repeat=len(spread))))
    return np.asarray((signs[:, :, None] * spread).sum(axis=1))


def corners_of(body: Box | Hull) -> Array:
    """Of a box, or the points of a hull, (N, 3), m."""
    if isinstance(body, Hull):
        return np.array(body.points)
    return np.array(body.centre) + _ends(_half_sides(body))


def _axis(body: Along) -> Array:
    one, other = body.ends
    along = np.subtract(other, one)
    return np.asarray(along / hypot(*along))


def axes_with(third: Array) -> Axes:
    """Orthogonal unit vectors of which this is the third; those of the base where it is one."""
    first = np.eye(3)[np.argmin(np.abs(third))]
    second = np.cross(third, first)
    second = second / hypot(*second)
    return vector3(np.cross(second, third)), vector3(second), vector3(third)
