"""Paths of straight lines past keep-out bodies, where no simple bend of a motion leads around them.

Places beside the edges of every body, at several distances, and places of a coarse grid are
connected by straight lines. Distances from convex bodies are convex along a line, so that two
tangents bound them between samples: a line that counts as clear is clear. The shortest path is
looked for as if all lines were clear; those that leave the places on it are then checked, until
the path is made of clear lines (a lazy probabilistic roadmap with places that are not random, after
Bohlin and Kavraki 2000).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import inf, tau

import numpy as np
from numpy.typing import NDArray

from deltaopt.limits.constraints import SceneLimits
from deltaopt.motion.sure_bounds import signed_distances
from deltaopt.motion.trajectory import Array
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.robot.solids import Convex, Polytope, Solid
from deltaopt.scene.scene import Scene, limits_of
from deltaopt.scene.task import given_points

Truths = NDArray[np.bool]

BESIDE = (4e-4, 3e-3, 1.5e-2)
"""Distances beside bodies of the places that are connected, m. A passage is found if it is wider
than the first and its ends are beside edges of a body."""
GRID = (5, 7, 7)
"""Places of the coarse grid: depths, and both ways across."""
_ROOM = 0.6
"""By what share of the way from start to goal the grid reaches beyond both."""
_LARGEST = 100.0
"""Half the length of a side, m, beyond which a body's corners are not looked for."""
_ROUND = 8
"""Places around a cylinder or sphere."""
_BETWEEN = np.linspace(0.0, 1.0, 9)
"""Of a line, where distances and their slopes are taken."""
_MOST_CHECKS = 400
"""Searches for a shortest path, each of which finds that at least one line is blocked or ends."""


def shortest_path(scene: Scene) -> Array | None:
    """The corners of the shortest path of clear lines from start to goal, (n, 3), m, both ends
    among them; None if there is none."""
    lines = _Lines.of(scene)
    ends = np.array(given_points(scene.task))
    places = np.vstack([ends, lines.clear_places(_places(scene, ends))])
    n = len(places)
    length = np.linalg.norm(places[:, None] - places, axis=2)
    length[np.arange(n), np.arange(n)] = inf
    known = np.zeros(n, dtype=np.bool)
    for _ in range(_MOST_CHECKS):
        path = _dijkstra(length)
        if path is None:
            return None
        new = [place for place in path if not known[place]]
        if not new:
            return np.asarray(places[path])
        for place in new:
            known[place] = True
            others = np.flatnonzero(np.isfinite(length[place]))
            blocked = others[~lines.are_clear(places[place], places[others])]
            length[place, blocked] = length[blocked, place] = inf
    return None


def what_was_searched(scene: Scene) -> str:
    """In words."""
    distances = ", ".join(f"{1e3 * each:g}" for each in BESIDE)
    return (
        "neither bends to four sides of each body nor straight lines between places "
        f"{distances} mm beside its edges and a grid of {' x '.join(map(str, GRID))} places"
    )


@dataclass(frozen=True)
class _Lines:
    """What a straight line must stay clear of, and where the platform can be."""

    scene: Scene
    model: DeltaModel
    limits: SceneLimits

    @classmethod
    def of(cls, scene: Scene) -> _Lines:
        return cls(scene, delta_model(scene.robot, scene.payload), limits_of(scene))

    @property
    def _kept(self) -> Array:
        return self.limits.bounds[0][self.limits.constraints.convex]

    def clear_places(self, places: Array) -> Array:
        """Those that are clear of bodies and within reach."""
        distance, _ = signed_distances(self.scene, places)
        return places[(distance > self._kept).all(axis=1) & self._in_reach(places)]

    def are_clear(self, begin: Array, ends: Array) -> Truths:
        """Whether the lines from a place to others, (N, 3), are clear, (N,)."""
        way = ends - begin
        x = begin + _BETWEEN[:, None] * way[:, None]
        flat = x.reshape(-1, 3)
        distance, slope = signed_distances(self.scene, flat)
        distance = distance.reshape(len(ends), len(_BETWEEN), -1)
        rate = np.einsum("nsrc,nc->nsr", slope.reshape(*distance.shape, 3), way)
        reach = self._in_reach(flat).reshape(len(ends), -1).all(axis=1)
        return np.asarray(reach & (_least(distance, rate) >= self._kept).all(axis=1))

    def _in_reach(self, places: Array) -> Truths:
        alignments = self.model.alignments(places)
        return np.asarray((alignments > 0).all(axis=1))  # False where not a number


def _least(distance: Array, rate: Array) -> Array:
    """Least values of convex functions by their tangents at samples, (N, samples, rows) each."""
    h = _BETWEEN[1] - _BETWEEN[0]
    before, after, down, up = distance[:, :-1], distance[:, 1:], rate[:, :-1], rate[:, 1:]
    dips = (down < 0) & (up > 0)
    t = (after - before - up * h) / np.where(dips, down - up, 1.0)
    lowest = np.where(dips, before + down * t, np.minimum(before, after))
    return np.asarray(lowest.min(axis=1))


def _places(scene: Scene, ends: Array) -> Array:
    """Places beside all bodies and of a grid, (N, 3), m."""
    margin = _ROOM * float(np.linalg.norm(ends[1] - ends[0]))
    low, high = ends.min(axis=0) - margin, ends.max(axis=0) + margin
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, GRID, strict=True)]
    grid = np.array(list(product(*axes)))
    beside = [
        _beside(body, scene.least_clearance + distance)
        for body in scene.kept_out
        for distance in BESIDE
    ]
    return np.vstack([grid, *beside])


def _beside(body: Convex, distance: float) -> Array:
    """Places at about a distance (m) from the corners, edges and sides of a body, (N, 3), m."""
    off = body.radius + distance
    if isinstance(body, Polytope):
        corners = np.unique(np.array(body.triangles).reshape(-1, 3), axis=0)
        away = corners - corners.mean(axis=0)
        return np.asarray(corners + off * away / np.linalg.norm(away, axis=1, keepdims=True))
    return np.asarray(_around(body, off) @ np.array(body.axes) + np.array(body.centre))


def _around(body: Solid, off: float) -> Array:
    """The same in the axes of a box or cylinder."""
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
    return np.asarray(signs * (half + off))


def _dijkstra(length: Array) -> list[int] | None:
    """The shortest path from place 0 to place 1, as places; None if there is none."""
    n = len(length)
    cost, before, done = np.full(n, inf), np.zeros(n, dtype=np.intp), np.zeros(n, dtype=np.bool)
    cost[0] = 0.0
    for _ in range(n):
        place = int(np.where(done, inf, cost).argmin())
        if cost[place] == inf or done[place]:
            return None
        if place == 1:
            path = [1]
            while path[-1] != 0:
                path.append(int(before[path[-1]]))
            return path[::-1]
        done[place] = True
        through = cost[place] + length[place]
        better = through < cost
        cost[better], before[better] = through[better], place
    return None
