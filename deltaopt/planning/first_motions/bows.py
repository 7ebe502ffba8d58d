"""Bows past keep-out bodies: a path that is bent aside as a whole until it is clear of all of them.

A path is shifted to eight sides, most in its first part, its middle or its last part, each time as
little as it takes. Two bows are the same way if all straight lines between them, from place to
place at equal shares of both, are clear of bodies: then one can be pushed into the other (the
uniform visibility deformation of Zhou, Gao, Pan and Shen 2020).

Unlike a band, a bow is not drawn tight: it is as smooth as the path that it is made from, so that a
solver which begins with it goes to the fast motions of its way rather than to the short ones.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deltaopt.curves.piecewise import Array
from deltaopt.planning.first_motions.bands import Bodies, resampled, sides_of, without_bodies
from deltaopt.scene.feasibility import room_at_rest

Truths = NDArray[np.bool]

_SIZES = np.array([0.08, 0.16, 0.24, 0.34, 0.46, 0.6, 0.8, 1.0])
"""Of the way from start to goal, how far a path is shifted where it is shifted most; the least that
is clear is taken. More of them leave less room to spare, and cost time."""
_SIDES = 8
"""Sides to which a path is shifted: with four, ways past a body beside two others are missed."""
_PEAKS = np.array([0.3, 0.5, 0.7])
"""Shares of the path at which it is shifted most."""
PIECES = 24
"""Of a path, at whose ends it is looked at first."""
_MARGIN = 0.01
"""How far bows stay from bodies where there is room, as a share of the way from start to goal."""
_BETWEEN = np.linspace(0.0, 1.0, 7)[1:-1]
"""Shares of the straight lines between two bows at which these are looked at."""


def bows(bodies: Bodies, base: Array) -> list[Array]:
    """Distinct bows of a path (N, 3), m, at equal distances (n, 3), the one bent least first."""
    path = resampled(base, PIECES)
    shifted = _shifted(path, bodies.way)  # (sizes, peaks and sides, n, 3)
    clear = _are_clear(replace(bodies, margin=_MARGIN), shifted)
    found = list[Array]()
    least = np.where(clear.any(axis=0), clear.argmax(axis=0), len(_SIZES))
    for which in np.argsort(least, kind="stable").tolist():
        if least[which] == len(_SIZES):
            break
        bow = shifted[least[which], which]
        if not any(is_same_way(bodies, bow, other) for other in found):
            found.append(bow)
    return [resampled(bow) for bow in found]


def _shifted(path: Array, way: float) -> Array:
    """A path shifted by all sizes, with all peaks to all sides, (sizes, peaks and sides, n, 3)."""
    up, left, _, _ = sides_of(path[-1] - path[0])
    angles = 2 * np.pi * np.arange(_SIDES)[:, None] / _SIDES
    sides = np.cos(angles) * up + np.sin(angles) * left
    u = np.linspace(0.0, 1.0, len(path))
    bumps = np.sin(np.pi * u ** (np.log(0.5) / np.log(_PEAKS))[:, None])
    shifts = (bumps[:, None, :, None] * sides[None, :, None]).reshape(-1, len(path), 3)
    return np.asarray(path + way * _SIZES[:, None, None, None] * shifts)


def _are_clear(bodies: Bodies, paths: Array) -> Truths:
    """Which paths, (…, n, 3), are clear of bodies at all their places, where the platform can be
    held, (…,)."""
    inner = paths[..., 1:-1, :]
    distance = bodies.distances(paths.reshape(-1, 3))[0].reshape(*paths.shape[:-1], -1)
    kept = np.asarray((distance[..., 1:-1, :] >= bodies.margins(inner)).all(axis=(-1, -2)))
    kept[kept] = (bodies.pierced(paths[kept], distance[kept]) < 0).all(axis=-1)
    held = room_at_rest(without_bodies(bodies.scene), inner[kept].reshape(-1, 3)) > 0
    found = np.zeros(kept.shape, dtype=np.bool)
    found[kept] = held.reshape(-1, inner.shape[-2]).all(axis=1)
    return found


def is_same_way(bodies: Bodies, one: Array, other: Array) -> bool:
    """Whether all lines between two paths, (n, 3) each, are clear of bodies, by samples."""
    between = one[1:-1, None] + _BETWEEN[:, None] * (other - one)[1:-1, None]
    distance = bodies.distances(between.reshape(-1, 3))[0].reshape(*between.shape[:-1], -1)
    return not ((distance < bodies.kept).any() or (bodies.pierced(between, distance) >= 0).any())
