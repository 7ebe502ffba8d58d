"""Bows past keep-out bodies: a path that is bent aside as a whole, and pushed out of bodies.

A path is shifted to one side most, or to two sides one after the other, each by several sizes. Of
the bows that would be pushed out of every body to the same side the one is pushed that can be
driven fastest, and what it was shifted by is smoothed, again and again. Of those that are clear
then the fastest are kept, those alone that are well apart.

Unlike a band, a bow is not drawn tight: it is as smooth as the path that it is made from, so that a
solver which begins with it goes to the fast motions of its way rather than to the short ones.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from deltaopt.curves.piecewise import Array, Index, Truths
from deltaopt.planning.first_motions.bands import Bodies, resampled, sides_of, without_bodies
from deltaopt.scene.feasibility import room_at_rest

_SIZES = np.array([0.05, 0.1, 0.16, 0.24, 0.34, 0.46, 0.6, 0.8, 1.0])
_SIZES_OF_TWO = np.array([0.12, 0.3, 0.7])
"""Of the way from start to goal, how far a path is shifted where it is shifted most, to one side
and to each of two."""
_SIDES = 8
"""Sides to which a path is shifted: with four, ways past a body beside two others are missed."""
_PEAKS = np.array([0.2, 0.35, 0.5, 0.65, 0.8])
"""Shares of the path at which it is shifted most, to one side."""
_PART = 0.6
"""Shares of the path that each of two shifts takes, from either end."""
_PIECES, _INNER = 36, slice(1, -1)
_LOOKED_AT, _ROUGHLY = (slice(6, -1, 6), slice(3, -1, 3)), slice(None, None, 3)
"""Of a path, at whose ends bows are pushed; and where it is seen which of them to push, at few
places first, and how long they take."""
_MARGIN = 0.01
"""How far bows stay from bodies where there is room, as a share of the way from start to goal."""
_DEEP, _DEARER, _PUSHED = 0.15, 3.0, 64
"""Of the way, how deep in a body a bow may be that is pushed; by what share of its time it counts
as slower for each length of the way that it is deep; and how many are pushed at most."""
_DRAWN = np.array([2.0, 1.0, 1.0, 1.0, 0.5, 0.3])
"""Tensions with which bows are drawn to their path while they are pushed, step by step: with five
steps of 1 more neighbouring problems took different ways."""
_SLOWEST, _MOST = 2.0, 6
"""How much longer than the fastest a bow may take, and how many are kept."""
_APART = 0.13
"""Of the way, how far two bows that are kept are apart somewhere. When instead they had to pass a
body on different sides, which sides hung on an edge between two of them: of 1,000 neighbouring
problems among bodies 37 were longer than the best known by 0.2 %, not one."""


def bows(bodies: Bodies, base: Array) -> list[Array]:
    """Bows of a path (N, 3), m, at equal shares of it (n, 3), each past bodies on other sides than
    all others, the one that is driven fastest first."""
    near, path = replace(bodies, margin=_MARGIN), resampled(base, _PIECES)
    shifts = bodies.way * _shifts(path)
    for places in _LOOKED_AT:
        passed, deep = _passed(near, path[places] + _SHAPES[:, places].T @ shifts)
        chosen = deep < _DEEP
        shifts, passed, deep = shifts[chosen], passed[chosen], deep[chosen]
        if not len(shifts):
            return []
    paths = path + _SHAPES.T @ shifts
    taking = speeds(paths[:, _ROUGHLY])[0].sum(axis=-1) * (1 + _DEARER * np.maximum(deep, 0.0))
    begun = _fastest_of_each(passed, taking)[:_PUSHED]
    pushed, clear = near.drawn(paths[begun], _DRAWN, path), begun[deep[begun] <= 0]
    paths = np.concatenate([paths[clear], near.beside_corners(pushed)])
    paths = paths[_are_possible(near, paths)]
    if not len(paths):
        return []
    taking, found = speeds(paths)[0].sum(axis=-1), list[Array]()
    for k in np.argsort(taking, kind="stable").tolist():
        if len(found) == _MOST or taking[k] > _SLOWEST * taking.min():
            break
        if not is_near_any(paths[k], found, _APART * bodies.way):
            found.append(paths[k])
    return found


def _shapes() -> Array:
    """How much of each shift there is along a path, (shapes, n)."""
    u = np.linspace(0.0, 1.0, _PIECES + 1)
    bumps = np.sin(np.pi * u ** (np.log(0.5) / np.log(_PEAKS))[:, None])
    part = np.sin(np.pi * np.minimum(u / _PART, 1.0)) ** 2
    return np.vstack([bumps, part, part[::-1]])


_SHAPES = _shapes()


def sides_around(along: Array) -> Array:
    """The sides to which a path in some direction is shifted, unit vectors, (sides, 3)."""
    up, left, _, _ = sides_of(along)
    angles = 2 * np.pi * np.arange(_SIDES)[:, None] / _SIDES
    return np.asarray(np.cos(angles) * up + np.sin(angles) * left)


def _shifts(path: Array) -> Array:
    """All bows of a path, by how far each shape shifts it, of the way, (bows, shapes, 3)."""
    sides = sides_around(path[-1] - path[0])
    one, each = ((sizes[:, None, None] * sides).reshape(-1, 3) for sizes in (_SIZES, _SIZES_OF_TWO))
    shifts = np.zeros((len(_PEAKS) * len(one) + len(each) ** 2, len(_SHAPES), 3))
    for k, own in enumerate(np.split(shifts[: len(_PEAKS) * len(one)], len(_PEAKS))):
        own[:, k] = one
    both = shifts[len(_PEAKS) * len(one) :]
    both[:, -2], both[:, -1] = np.repeat(each, len(each), axis=0), np.tile(each, (len(each), 1))
    return shifts


def _passed(bodies: Bodies, paths: Array) -> tuple[Index, Array]:
    """On which sides paths, (bows, n, 3), pass bodies, (bows, rows), and how deep in one and what
    is to be kept from it they are, a share of the way, (bows,)."""
    distance, slope = bodies.distances(paths)
    deep = (bodies.margins(paths) - distance).max(axis=(1, 2)) / bodies.way
    return bodies.passed(distance, slope), deep


def _fastest_of_each(passed: Index, taking: Array) -> Index:
    """Of paths past bodies on the same sides, (bows, rows), the one that takes least, (bows,): the
    numbers of these, the fastest first."""
    first = dict[bytes, int]()
    for k in np.argsort(taking, kind="stable").tolist():
        first.setdefault(passed[k].tobytes(), k)
    return np.array(list(first.values()))


def _are_possible(bodies: Bodies, paths: Array) -> Truths:
    """Which paths, (bows, n, 3), are clear of bodies where the platform can be held, (bows,)."""
    distance, _ = bodies.distances(paths)
    inner = paths[:, _INNER]
    room = room_at_rest(without_bodies(bodies.scene), inner.reshape(-1, 3))
    held = (room > 0).reshape(inner.shape[:2]).all(axis=1)
    possible = np.asarray(held & (distance[:, _INNER] >= bodies.kept).all(axis=(1, 2)))
    whole = bodies.pierced(paths[possible], distance[possible]) < 0
    possible[possible] = whole.all(axis=1)
    return possible


def is_near_any(path: Array, others: Iterable[Array], most: float) -> bool:
    """Whether a path, (n, 3), m, is nowhere farther than ``most`` (m) in a coordinate from one of
    some others, (n, 3), place by place."""
    return any(float(np.abs(path - other).max()) < most for other in others)


def speeds(paths: Array, most: Array | float = 1.0) -> tuple[Array, Array]:
    """How long the pieces of paths (..., n, 3), m, take, (..., n - 1), and the largest speeds at
    their places, (..., n), from rest to rest, at which the acceleration of each piece, forwards and
    sideways each, is at most ``most``, (..., n - 1): roughly, as if the robot's reach were a ball
    of accelerations."""
    steps = np.diff(paths, axis=-2)
    lengths = np.linalg.norm(steps, axis=-1)
    most = np.broadcast_to(most, lengths.shape)
    turn = np.linalg.norm(np.diff(steps / lengths[..., None], axis=-2), axis=-1)
    curvature = 2 * turn / (lengths[..., 1:] + lengths[..., :-1])
    squares = np.zeros(paths.shape[:-1])
    squares[..., 1:-1] = np.minimum(most[..., 1:], most[..., :-1]) / np.maximum(curvature, 1e-9)
    gained = np.zeros_like(squares)  # from the start, at the largest acceleration forwards
    gained[..., 1:] = 2 * np.cumsum(most * lengths, axis=-1)
    squares = np.minimum.accumulate(squares - gained, axis=-1) + gained
    left = np.flip(squares + gained, axis=-1)
    squares = np.flip(np.minimum.accumulate(left, axis=-1), axis=-1) - gained
    squares[..., [0, -1]] = 0.0
    fastest = np.sqrt(np.maximum(squares, 0.0))
    return 2 * lengths / (fastest[..., 1:] + fastest[..., :-1]), fastest
