"""Bows past keep-out bodies: a path that is bent aside as a whole until it is clear of all of them.

A path is shifted to one side most, or to two sides one after the other, each by several sizes. Of
the bows that are clear and pass every body on the same side the one is kept that can be driven
fastest, as if the robot's reach were a ball of accelerations.

Unlike a band, a bow is not drawn tight: it is as smooth as the path that it is made from, so that a
solver which begins with it goes to the fast motions of its way rather than to the short ones.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from deltaopt.curves.piecewise import Array
from deltaopt.planning.first_motions.bands import Bodies, resampled, sides_of, without_bodies
from deltaopt.planning.first_motions.speeds import durations
from deltaopt.scene.feasibility import room_at_rest

Truths = NDArray[np.bool]

_SIZES = np.array([0.05, 0.1, 0.16, 0.24, 0.34, 0.46, 0.6, 0.8, 1.0])
_SIZES_OF_TWO = np.array([0.12, 0.25, 0.45, 0.8])
"""Of the way from start to goal, how far a path is shifted where it is shifted most, to one side
and to each of two. More of them leave less room to spare, and cost time."""
_SIDES = 8
"""Sides to which a path is shifted: with four, ways past a body beside two others are missed."""
_PEAKS = np.array([0.2, 0.35, 0.5, 0.65, 0.8])
"""Shares of the path at which it is shifted most, to one side."""
_PART = 0.6
"""Shares of the path that each of two shifts takes, from either end."""
_PIECES, _FIRST, _INNER = 24, slice(4, -1, 4), slice(1, -1)
"""Of a path, at whose ends it is looked at, at some of them first: most bows are not clear there."""
_MARGIN = 0.01
"""How far bows stay from bodies where there is room, as a share of the way from start to goal."""
_SLOWEST, _MOST = 2.0, 8
"""How much longer than the fastest a bow may take, and how many are kept."""


def bows(bodies: Bodies, base: Array) -> list[Array]:
    """Bows of a path (N, 3), m, at equal shares of it (n, 3), each past bodies on other sides than
    all others, the one that is driven fastest first."""
    near = replace(bodies, margin=_MARGIN)
    paths = _shifted(resampled(base, _PIECES), bodies.way)
    for holds, places in ((_are_clear, _FIRST), (_are_clear, _INNER), (_can_be_held, _FIRST)):
        paths = paths[holds(near, paths[:, places])]
        if not len(paths):
            return []
    distance, slope = near.distances(paths.reshape(-1, 3))
    distance = distance.reshape(*paths.shape[:2], -1)
    passed, _ = near.passed(distance[:, _INNER], slope.reshape(*distance.shape, 3)[:, _INNER])
    taking, found = durations(paths), dict[bytes, Array]()
    for k in np.argsort(taking, kind="stable").tolist():
        if len(found) == _MOST or taking[k] > _SLOWEST * taking.min():
            break
        sides = passed[k].tobytes()
        if sides in found or not _can_be_held(near, paths[k, _INNER]):
            continue
        if (near.pierced(paths[k], distance[k]) < 0).all():
            found[sides] = paths[k]
    return list(found.values())


def _shifted(path: Array, way: float) -> Array:
    """A path, (n, 3), shifted by all sizes to all sides, with all peaks and in two parts,
    (bows, n, 3)."""
    up, left, _, _ = sides_of(path[-1] - path[0])
    angles = 2 * np.pi * np.arange(_SIDES)[:, None] / _SIDES
    sides = way * (np.cos(angles) * up + np.sin(angles) * left)
    u = np.linspace(0.0, 1.0, len(path))
    bumps = np.sin(np.pi * u ** (np.log(0.5) / np.log(_PEAKS))[:, None])
    one = _SIZES[:, None, None, None, None] * bumps[:, None, :, None] * sides[:, None]
    part = np.sin(np.pi * np.minimum(u / _PART, 1.0)) ** 2
    first, then = (
        (_SIZES_OF_TWO[:, None, None, None] * bump[:, None] * sides[:, None]).reshape(
            -1, *path.shape
        )
        for bump in (part, part[::-1])
    )
    shifts = [one.reshape(-1, *path.shape), (first[:, None] + then).reshape(-1, *path.shape)]
    return np.asarray(path + np.concatenate(shifts))


def _are_clear(bodies: Bodies, paths: Array) -> Truths:
    """Which paths, (bows, n, 3), are clear of bodies at all their places, (bows,)."""
    distance, _ = bodies.distances(paths.reshape(-1, 3))
    clear = distance.reshape(*paths.shape[:2], -1) >= bodies.margins(paths)
    return np.asarray(clear.all(axis=(1, 2)))


def _can_be_held(bodies: Bodies, paths: Array) -> Truths:
    """On which paths, (..., n, 3), the platform can be held at all places, (...)."""
    room = room_at_rest(without_bodies(bodies.scene), paths.reshape(-1, 3))
    return np.asarray((room.reshape(paths.shape[:-1]) > 0).all(axis=-1))
