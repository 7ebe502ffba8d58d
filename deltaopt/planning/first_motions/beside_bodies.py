"""Places beside the corners, edges and sides of keep-out bodies."""

from __future__ import annotations

from itertools import product
from math import hypot, tau

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.robot.solids import Convex, Polytope, Solid

_LARGEST = 100.0
"""Half the length of a side, m, beyond which a body's corners are not looked for."""
_ROUND = 8
"""Places around a cylinder or sphere."""


def beside_body(body: Convex, distance: float, line: Array) -> Array:
    """Places at about a distance (m) from the corners, edges and sides of a body, (N, 3), m; of its
    edges the middle, or the places nearest to those on a line, (n, 3), m."""
    off = body.radius + distance
    if isinstance(body, Polytope):
        return _around_polytope(np.array(body.triangles), off, line)
    axes, centre = np.array(body.axes), np.array(body.centre)
    return np.asarray(_around(body, off, (line - centre) @ axes.T) @ axes + centre)


def _around_polytope(triangles: Array, off: float, line: Array) -> Array:
    """A line that stays ``off`` a body of triangles, counter-clockwise seen from outside: straight
    out of corners and edges, between the faces that meet there."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    edges = dict[tuple[bytes, bytes], Array]()
    corners = dict[bytes, list[Array]]()
    found = []
    for triangle, normal in zip(triangles, normals, strict=True):
        for a, b in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
            corners.setdefault(a.tobytes(), []).append(normal)
            beyond = edges.get((b.tobytes(), a.tobytes()))
            if beyond is None:
                edges[a.tobytes(), b.tobytes()] = normal
                continue
            share = np.clip((line - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)[:, None]
            found.append(a + share * (b - a) + off * _outwards([normal, beyond]))
    found += [np.frombuffer(a)[None] + off * _outwards(own) for a, own in corners.items()]
    return np.vstack(found)


def _outwards(normals: list[Array]) -> Array:
    """The unit vector between some normals."""
    total = np.sum(normals, axis=0)
    return np.asarray(total / hypot(*total))


def _around(body: Solid, off: float, line: Array) -> Array:
    """A line that stays ``off`` a box or cylinder, in its axes."""
    half = np.array(body.half)
    if body.is_cylinder:
        angles = np.arange(_ROUND) * tau / _ROUND
        ring = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(_ROUND)])
        wide = (half[0] + off) / np.cos(np.pi / _ROUND)  # so that lines between them are clear
        up = np.array([0.0, 0.0, half[2] + off])
        return np.vstack([wide * ring - up, wide * ring, wide * ring + up, up, -up])
    if half.max() > _LARGEST:
        return np.zeros((0, 3))
    signs = np.array([each for each in product((-1.0, 0.0, 1.0), repeat=3) if any(each)])
    nearest = np.vstack([np.zeros(3), np.clip(line, -half, half)])
    places = np.where(signs[:, None] == 0, nearest, signs[:, None] * (half + off))
    return np.unique(places.reshape(-1, 3), axis=0)
