"""Convex solids that a point keeps clear of: data alone, in two families.

A platform that only translates keeps its tool T clear of a body B exactly as long as the tool's
point keeps clear of B ⊕ (−T), the body grown by the tool reflected. Such a sum is a member of one
of two families, whose signed distances have one formula each, so that other bodies are other
numbers in the same compiled code.
"""

from __future__ import annotations

from dataclasses import dataclass

from deltaopt.files.validated_record import Vector3

Axes = tuple[Vector3, Vector3, Vector3]

MOST_TRIANGLES = 64
"""Of a polytope: the function of its distance grows with them."""
ALONG_THE_BASE: Axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Solid:
    """A box or an upright cylinder in axes of its own, and all that is within ``radius`` of it.

    ``axes``: unit vectors, the third along a cylinder's axis. ``centre``: m. ``half``: of the
    lengths of a box's sides; of a cylinder its radius, any positive number, and half of its length;
    m. Spheres and capsules are cylinders of no radius; a half-space is one side of a large box.
    """

    axes: Axes
    centre: Vector3
    half: Vector3
    is_cylinder: bool
    radius: float


@dataclass(frozen=True)
class Polytope:
    """The convex hull of points, and all that is within ``radius`` of it, m.

    ``triangles``: its surface, three corners each in m, counter-clockwise seen from outside.
    """

    triangles: tuple[tuple[Vector3, Vector3, Vector3], ...]
    radius: float


Convex = Solid | Polytope
