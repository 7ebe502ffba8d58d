"""Convex hulls of points in space, by the quickhull method (Barber, Dobkin, Huhdanpaa 1996)."""

from __future__ import annotations

from math import inf

import numpy as np

from deltaopt.curves.piecewise import Array, Index

_FLAT = 1e-9
"""Of the size of the points: what is less above a plane counts as in it, and such points are no
corners. It is far below a micrometre for what a robot moves around."""
_IN_SPACE = "points that do not all lie in one plane"


class NoHull(ValueError):
    """Points without a convex hull that can be used; the text says which would have one."""


def convex_hull(points: Array, most: float = inf) -> Index:
    """The triangles of the convex hull of points (N, 3), as indices of their corners, (T, 3),
    counter-clockwise seen from outside.

    Raises NoHull for points in one plane, and, after a time linear in their number, where so many
    triangles are not nearly enough: more than twice ``most``, for they may become fewer again.
    """
    size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    faces = _tetrahedron(points, _FLAT * size)
    while True:
        normals, offsets = _planes(points, faces)
        height = points @ normals.T - offsets
        face = int(height.max(axis=0).argmax())
        farthest = int(height[:, face].argmax())
        seen = height[farthest] > _FLAT * size
        if not seen[face]:
            return faces
        faces = np.vstack([faces[~seen], _cone(faces[seen], farthest)])
        if len(faces) > 2 * most:
            raise NoHull(f"points whose convex hull has at most {most:g} triangles")


def _tetrahedron(points: Array, least: float) -> Index:
    """Four points far from one another, as faces."""
    if len(points) < 4:
        raise NoHull(_IN_SPACE)
    a = int(points[:, 0].argmin())
    b = int(((points - points[a]) ** 2).sum(axis=1).argmax())
    along = points[b] - points[a]
    across = np.linalg.norm(np.cross(points - points[a], along), axis=1)
    c = int(across.argmax())
    if across[c] <= least * np.linalg.norm(along):
        raise NoHull(_IN_SPACE)
    normal = np.cross(along, points[c] - points[a])
    height = (points - points[a]) @ normal / np.linalg.norm(normal)
    d = int(np.abs(height).argmax())
    if abs(height[d]) <= least:
        raise NoHull(_IN_SPACE)
    if height[d] > 0:
        b, c = c, b
    return np.array([(a, b, c), (a, d, b), (b, d, c), (c, d, a)])


def _planes(points: Array, faces: Index) -> tuple[Array, Array]:
    """Unit normals (T, 3) and their products with points of the planes, (T,)."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return normals, (normals * a).sum(axis=1)


def _cone(seen: Index, top: int) -> Index:
    """Triangles from the border of what a point sees to that point."""
    edges = {(int(f[k]), int(f[(k + 1) % 3])) for f in seen for k in range(3)}
    border = [(a, b) for a, b in edges if (b, a) not in edges]
    return np.array([(a, b, top) for a, b in sorted(border)])
