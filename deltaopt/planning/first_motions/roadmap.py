"""Motions on paths from a grid over where the platform may be.

They lead around what lies between start and goal where no simple curve does. A grid of points over
the workspace is tried for its room, neighbours are connected, and the shortest path from start to
goal is found, where length counts more the less room there is. The path is then rounded and driven
as fast as its limits allow. For motions room is how well the
platform can be held at rest (``room_at_rest``); a path alone is found with any other measure too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from math import inf

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from deltaopt.curves.piecewise import QUINTIC, Array, PiecewisePolynomial
from deltaopt.errors import RULED_OUT, if_possible
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.bands import resampled
from deltaopt.planning.first_motions.initial_motion import roughly_fastest
from deltaopt.robot.model import model_of
from deltaopt.scene.feasibility import room_at_rest
from deltaopt.scene.scene import Scene

Index = tuple[int, int, int]
Room = Callable[[Array], Array]
"""Points (N, 3) in m -> how much room the platform has there, (N,), without unit and at most about
1: not positive where it must not be. Lengths count twice where it is ``_NARROW``."""

STEPS = (16, 32, 64)
"""Grids that are searched in turn: so many steps along the longest reach of a chain. The first
takes some milliseconds, the last, of half a million points, about a second; what only a finer one
shows is a passage narrower than a sixtieth of the robot's reach."""
_NARROW = 0.03
"""Room at which length counts twice. A larger one keeps farther from singularities and from torque
limits, on longer paths, which are not faster for that."""
_BETWEEN = 8
"""Places on a line between two points of a path at which it is tried."""
_CONNECTED = 40
"""To how many points of the grid start and goal are connected at most, the nearest first."""
_ROUNDINGS = (2, 6, 18, 54)
"""Lengths over which corners of a path are rounded, in samples of ``_SAMPLES``: long ones are
driven faster, short ones stay closer to the path."""
_SAMPLES = 192
"""Samples of a path, and cubics of the motion on it: it is only a guess."""
_STEPS: list[Index] = [
    (a, b, c) for a, b, c in product((-1, 0, 1), repeat=3) if (a, b, c) > (0, 0, 0)
]
"""From a point to half of its 26 neighbours; the others are the opposite ones."""


def roadmap_motions(scene: Scene, steps: int) -> list[Trajectory]:
    """Motions from start to goal on the best path of a grid, the fastest first; often none.

    ``steps``: of the grid along the longest reach of a chain. The platform may be wherever it can
    be held at rest within all limits.
    """
    path = path_over_grid(scene, steps, partial(room_at_rest, scene))
    if path is None:
        return []
    return sorted(_driven(scene, path), key=lambda motion: motion.duration)


def path_over_grid(scene: Scene, steps: int, room: Room) -> Array | None:
    """The best path from start to goal over a grid, (n, 3), m; None where there is none.

    ``steps``: of the grid along the longest reach of a chain. ``room``: where the platform may be.
    """
    return _Grid(scene, steps, room).path()


def spacing(scene: Scene, steps: int) -> float:
    """Distance of neighbours in a grid, m."""
    return scene.robot.reach / steps


class _Grid:
    """``points`` of the workspace, (nx, ny, nz, 3) in m, and the ``room`` at each of them."""

    def __init__(self, scene: Scene, steps: int, room_at: Room) -> None:
        """As of ``path_over_grid``."""
        self.scene, self.room_at = scene, room_at
        h = spacing(scene, steps)
        wide = steps + int(np.ceil(scene.robot.width / h))
        depths = h * np.arange(-steps // 4, steps + 1)
        across = h * np.arange(-wide, wide + 1)
        mesh = np.meshgrid(depths, across, across, indexing="ij")
        self.points = np.stack(mesh, axis=-1) + scene.robot.tool_offset
        self.room = room_at(self.points.reshape(-1, 3)).reshape(self.points.shape[:3])

    def path(self) -> Array | None:
        """The best path from start to goal, (n, 3), m; None where the grid has none."""
        start, goal = (np.array(end) for end in self.scene.given_points)
        left = self._connections(start)
        arrived = self._connections(goal)
        if not left or not arrived:
            return None
        edges = [self._edges(step) for step in _STEPS]
        cost = self._costs(left, edges)
        total = {place: cost[place] + last for place, last in arrived.items()}
        end = min(total, key=lambda place: total[place])
        if total[end] == inf:
            return None
        return np.vstack([start, self._back(cost, left, edges, end), goal])

    def _connections(self, point: Array) -> dict[Index, float]:
        """Costs of straight lines from a point to those of the grid near it that it can reach."""
        distance = np.linalg.norm(self.points - point, axis=-1)
        distance[self.room <= 0] = inf
        nearest = np.argsort(distance, axis=None)[:_CONNECTED]
        places = np.stack(np.unravel_index(nearest, distance.shape), axis=1)
        found: dict[Index, float] = {}
        share = np.linspace(0, 1, _BETWEEN)[:, None]
        for i, j, k in places.tolist():
            place = (i, j, k)
            if distance[place] == inf:
                break
            line = point + share * (self.points[place] - point)
            room = self.room_at(line[1:]).min()
            if room > 0:
                found[place] = float(distance[place] * _weight(room))
        return found

    def _costs(self, left: dict[Index, float], edges: list[Array]) -> Array:
        """The least cost from the start to every point, infinite where there is no way."""
        cost = np.full(self.room.shape, inf)
        for place, first in left.items():
            cost[place] = first
        near = [(*_shifted(step), edge) for step, edge in zip(_STEPS, edges, strict=True)]
        while True:
            before = cost.copy()
            for one, other, edge in near:
                np.minimum(cost[other], cost[one] + edge[one], out=cost[other])
                np.minimum(cost[one], cost[other] + edge[one], out=cost[one])
            if (cost == before).all():
                return cost

    def _edges(self, step: Index) -> Array:
        """Costs of the lines from every point to its neighbour a step on, infinite without one."""
        found = np.full(self.room.shape, inf)
        one, other = _shifted(step)
        begin, end, cost = self.points[one], self.points[other], found[one]
        both = np.minimum(self.room[one], self.room[other])
        kept = both > 0
        middle = self.room_at(((begin + end) / 2)[kept])
        room = np.minimum(both[kept], middle)
        length = np.linalg.norm((end - begin)[kept], axis=-1)
        cost[kept] = np.where(room > 0, length * _weight(room), inf)
        return found

    def _back(self, cost: Array, left: dict[Index, float], edges: list[Array], end: Index) -> Array:
        """The points from the start to one, along which costs add up."""
        places = [end]
        while not (places[-1] in left and cost[places[-1]] >= left[places[-1]]):
            places.append(self._before(cost, edges, places[-1]))
        return np.array([self.points[place] for place in reversed(places)])

    def _before(self, cost: Array, edges: list[Array], place: Index) -> Index:
        """The neighbour from which a point is reached at its cost. Beyond an end of the grid the
        other end is looked at, to which no line leads."""
        through: dict[Index, float] = {}
        for sign, (step, edge) in product((1, -1), zip(_STEPS, edges, strict=True)):
            i, j, k = np.mod(np.add(place, np.multiply(sign, step)), cost.shape).tolist()
            other = (i, j, k)
            through[other] = cost[other] + edge[place if sign > 0 else other]
        return min(through, key=lambda other: through[other])


def _weight(room: Array | float) -> Array | float:
    """By what factor length counts at places with little room."""
    return 1 + _NARROW / np.maximum(room, 1e-6)


def _shifted(step: Index) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Where a grid has points with a neighbour one step on, and where these neighbours are."""
    one = tuple(slice(max(0, -d), -d if d > 0 else None) for d in step)
    other = tuple(slice(max(0, d), d if d < 0 else None) for d in step)
    return one, other


def _driven(scene: Scene, path: Array) -> Iterator[Trajectory]:
    """Motions along a path, rounded more and less, each as fast as the limits roughly allow."""
    dense = resampled(path, _SAMPLES)
    for width in _ROUNDINGS:
        rounded = _motion(scene, _rounded(dense, width))
        motion = if_possible(RULED_OUT, roughly_fastest, scene, rounded)
        if motion is not None:
            yield motion


def _rounded(path: Array, width: int) -> Array:
    """A path averaged over neighbours, twice; its ends stay, for it is reflected at them."""
    for _ in range(2):
        before, after = 2 * path[0] - path[width:0:-1], 2 * path[-1] - path[-2 : -width - 2 : -1]
        summed = np.cumsum(np.vstack([np.zeros((1, 3)), before, path, after]), axis=0)
        path = (summed[2 * width + 1 :] - summed[: -2 * width - 1]) / (2 * width + 1)
    return path


def _motion(scene: Scene, path: Array) -> Trajectory:
    """The motion along samples of a path, at rest at both ends, in 1 s."""
    u = np.linspace(0, 1, len(path))
    share, rate = (np.asarray(polyval(u, each)) for each in (QUINTIC, polyder(QUINTIC)))
    slope = np.asarray(np.gradient(path, u, axis=0))
    x = np.stack([np.interp(share, u, path[:, i]) for i in range(3)], axis=1)
    v = np.stack([np.interp(share, u, slope[:, i]) for i in range(3)], axis=1) * rate[:, None]
    x[[0, -1]], v[[0, -1]] = scene.given_points, 0.0
    model = model_of(scene.robot, scene.payload)
    return Trajectory(PiecewisePolynomial.hermite(u, x, v), model)
