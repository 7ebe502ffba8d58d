"""Ways past keep-out bodies over a grid of the workspace: an oracle for what is possible.

Places are clear of all bodies by distances of their own, and the platform can be held there. A line
between two of them counts only if it is surely clear: a distance changes by no more than the way,
so that it is at least (d₁ + d₂ - L)/2 on a line of length L between distances d₁ and d₂; lines are
halved until that says enough. Whether the platform can be held between the places of a path is
looked at when it is found: where it cannot, the line is taken out and the next path looked for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import pairwise, product
from math import inf

import numpy as np
from numpy.typing import NDArray

from deltaopt.robot.robot import as_delta
from deltaopt.scene.feasibility import room_at_rest
from deltaopt.scene.scene import Scene
from tests.oracles.body_distances import tool_distances

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Truths = NDArray[np.bool]
Free = Callable[[Array], Truths]
"""Places (N, 3), m -> at which of them the platform may be."""

_HALVINGS = 10
"""Of a line, after which one that is not known to be clear counts as blocked."""
_HELD = np.linspace(0.0, 1.0, 9)[:, None]
"""Where on a line of a path it is looked whether the platform can be held."""
_NEAR = 1.8
"""Given places are joined to those of the grid within so many of its spacings."""
_STEPS = [step for step in product((-1, 0, 1), repeat=3) if step > (0, 0, 0)]


@dataclass(frozen=True, eq=False)
class ClearGrid:
    """Places, (N, 3), m, start and goal the first two, of each the places that it is joined to by
    clear lines, ``others[first[i] : first[i + 1]]``, with their ``lengths``, m, and where the
    platform can be held."""

    places: Array
    first: Indices
    others: Indices
    lengths: Array
    held: Free

    @classmethod
    def of(cls, scene: Scene, spacing: float, given: Array | None = None) -> ClearGrid:
        """Of a scene, with places ``spacing`` (m) apart over all that the robot reaches, and with
        ``given`` places besides, (n, 3), m."""
        ends, held = np.array(scene.given_points), can_be_held(scene)

        def free(x: Array) -> Truths:
            clear = tool_distances(scene, x) >= scene.least_clearance
            found = np.asarray(clear.all(axis=1))
            found[found] = held(x[found])
            return found

        lattice = _lattice(scene, spacing)
        allowed = free(lattice.reshape(-1, 3)).reshape(lattice.shape[:3])
        extra = ends if given is None else np.vstack([ends, given[free(given)]])
        number = np.full(allowed.shape, -1)
        number[allowed] = len(extra) + np.arange(allowed.sum())
        places = np.vstack([extra, lattice[allowed]])
        pairs = np.vstack(
            [_neighbours(number, step) for step in _STEPS]
            + [_within(places, i, _NEAR * spacing) for i in range(len(extra))]
        )
        pairs = pairs[_are_clear(scene, places[pairs[:, 0]], places[pairs[:, 1]])]
        both = np.vstack([pairs, pairs[:, ::-1]])
        both = both[np.argsort(both[:, 0], kind="stable")]
        first = np.searchsorted(both[:, 0], np.arange(len(places) + 1))
        lengths = np.linalg.norm(places[both[:, 0]] - places[both[:, 1]], axis=1)
        return cls(places, first, both[:, 1], lengths, held)

    def path(self, via: int | None = None) -> Array | None:
        """The shortest path from start to goal, (n, 3), m, by way of a place if one is given; None
        if there is none."""
        while True:
            path = self._shortest(0, 1) if via is None else self._by_way_of(via)
            if path is None:
                return None
            lines = list(pairwise(path))
            bad = [line for line in lines if not self._can_be_driven(*line)]
            if not bad:
                return np.asarray(self.places[path])
            for one, other in bad:
                self._take_out(one, other)

    def _by_way_of(self, via: int) -> list[int] | None:
        there, on = self._shortest(0, via), self._shortest(via, 1)
        return None if there is None or on is None else there + on[1:]

    def _can_be_driven(self, one: int, other: int) -> bool:
        x = self.places[one] + _HELD * (self.places[other] - self.places[one])
        return bool(self.held(x).all())

    def _take_out(self, one: int, other: int) -> None:
        for a, b in ((one, other), (other, one)):
            own = slice(self.first[a], self.first[a + 1])
            self.lengths[own][self.others[own] == b] = inf

    def _shortest(self, begin: int, end: int) -> list[int] | None:
        """The numbers of the places on the shortest path from one to another (Dijkstra)."""
        cost, before, done = {begin: 0.0}, {begin: -1}, set[int]()
        waiting = [(0.0, begin)]
        while waiting:
            so_far, place = heappop(waiting)
            if place == end:
                path = [end]
                while before[path[-1]] >= 0:
                    path.append(before[path[-1]])
                return path[::-1]
            if place in done:
                continue
            done.add(place)
            own = slice(self.first[place], self.first[place + 1])
            for other, length in zip(
                self.others[own].tolist(), self.lengths[own].tolist(), strict=True
            ):
                if so_far + length < cost.get(other, inf):
                    cost[other], before[other] = so_far + length, place
                    heappush(waiting, (so_far + length, other))
        return None


def can_be_held(scene: Scene) -> Free:
    """Where the platform can be at rest within all limits, whatever bodies are there."""
    without = scene.model_copy(update={"keep_out": None, "clearance": None})
    return lambda x: np.asarray(room_at_rest(without, x) > 0)


def _are_clear(scene: Scene, a: Array, b: Array) -> Truths:
    """Whether lines between places (M, 3), m, are clear of all bodies for certain."""
    kept, clear, line = scene.least_clearance, np.ones(len(a), dtype=np.bool), np.arange(len(a))
    d, e = (tool_distances(scene, x).min(axis=1) for x in (a, b))
    for _ in range(_HALVINGS):
        clear[line[np.minimum(d, e) < kept]] = False
        left = (d + e - np.linalg.norm(b - a, axis=1) < 2 * kept) & clear[line]
        a, b, d, e, line = a[left], b[left], d[left], e[left], line[left]
        if not len(line):
            return clear
        middle = (a + b) / 2
        m = tool_distances(scene, middle).min(axis=1)
        a, b = np.vstack([a, middle]), np.vstack([middle, b])
        d, e, line = np.append(d, m), np.append(m, e), np.tile(line, 2)
    clear[line] = False
    return clear


def _lattice(scene: Scene, spacing: float) -> Array:
    """Places over all that the robot reaches, (nx, ny, nz, 3), m."""
    robot = as_delta(scene.robot)
    reach = robot.upper_arm.length + robot.forearm.length
    wide = reach + abs(robot.base_radius - robot.platform_radius)
    axes = [
        np.arange(low, high, spacing) for low, high in ((-reach / 4, reach), *[(-wide, wide)] * 2)
    ]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def _neighbours(number: Indices, step: tuple[int, ...]) -> Indices:
    """Pairs of numbers of places that are a step apart, (M, 2)."""
    one = tuple(slice(max(0, -d), -d if d > 0 else None) for d in step)
    other = tuple(slice(max(0, d), d if d < 0 else None) for d in step)
    pairs = np.stack([number[one].ravel(), number[other].ravel()], axis=1)
    return np.asarray(pairs[(pairs >= 0).all(axis=1)])


def _within(places: Array, which: int, distance: float) -> Indices:
    """Pairs of a place with those within a distance of it, m."""
    near = np.flatnonzero(np.linalg.norm(places - places[which], axis=1) <= distance)
    near = near[near != which]
    return np.stack([np.full(len(near), which), near], axis=1)
