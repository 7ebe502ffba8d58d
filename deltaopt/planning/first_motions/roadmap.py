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

from deltaopt.curves.piecewise import QUINTIC, Array, Index, PiecewisePolynomial
from deltaopt.errors import RULED_OUT, if_possible
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.bands import resampled
from deltaopt.planning.first_motions.initial_motion import roughly_fastest
from deltaopt.robot.model import model_of
from deltaopt.scene.feasibility import room_at_rest
from deltaopt.scene.scene import Scene

Step = tuple[int, int, int]
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
_STEPS: list[Step] = [
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
    """Points of the workspace with room for the platform.

    ``points``: (N, 3), m, and the ``room`` at each, (N,). ``begins``, ``ends``: the points of each
    line from one to a neighbour, in either direction, (M,), and what it ``costs``, (M,).
    """

    def __init__(self, scene: Scene, steps: int, room_at: Room) -> None:
        """As of ``path_over_grid``."""
        self.scene, self.room_at = scene, room_at
        h = spacing(scene, steps)
        wide = steps + int(np.ceil(scene.robot.width / h))
        depths = h * np.arange(-steps // 4, steps + 1)
        across = h * np.arange(-wide, wide + 1)
        mesh = np.stack(np.meshgrid(depths, across, across, indexing="ij"), axis=-1)
        points = mesh.reshape(-1, 3) + scene.robot.tool_offset
        room = room_at(points)
        self.points, self.room = points[room > 0], room[room > 0]
        number = np.full(mesh.shape[:3], -1)
        number[(room > 0).reshape(number.shape)] = np.arange(len(self.points))
        begins, ends, costs = zip(*(self._lines(number, step) for step in _STEPS), strict=True)
        self.begins, self.ends = np.hstack([*ends, *begins]), np.hstack([*begins, *ends])
        self.costs = np.hstack([*costs, *costs])

    def _lines(self, number: Index, step: Step) -> tuple[Index, Index, Array]:
        """The lines from points to their neighbours a step on; ``number``: of the points of the
        whole grid, -1 for those without room."""
        one = number[*(slice(max(0, -d), -d if d > 0 else None) for d in step)]
        other = number[*(slice(max(0, d), d if d < 0 else None) for d in step)]
        both = (one >= 0) & (other >= 0)
        begin, end = one[both], other[both]
        room = self.room_at((self.points[begin] + self.points[end]) / 2)
        room = np.minimum(np.minimum(self.room[begin], self.room[end]), room)
        begin, end, room = begin[room > 0], end[room > 0], room[room > 0]
        length = np.linalg.norm(self.points[end] - self.points[begin], axis=-1)
        return begin, end, np.asarray(length * _weight(room))

    def path(self) -> Array | None:
        """The best path from start to goal, (n, 3), m; None where the grid has none."""
        start, goal = (np.array(end) for end in self.scene.given_points)
        left = self._connections(start)
        arrived = self._connections(goal)
        if not left or not arrived:
            return None
        cost = self._least_costs(left)
        total = {place: cost[place] + last for place, last in arrived.items()}
        end = min(total, key=lambda place: total[place])
        if total[end] == inf:
            return None
        return np.vstack([start, self._back(cost, left, end), goal])

    def _connections(self, point: Array) -> dict[int, float]:
        """Costs of straight lines from a point to those of the grid near it that it can reach."""
        distance = np.linalg.norm(self.points - point, axis=-1)
        found = dict[int, float]()
        share = np.linspace(0, 1, _BETWEEN)[:, None]
        for place in np.argsort(distance, kind="stable")[:_CONNECTED].tolist():
            line = point + share * (self.points[place] - point)
            room = self.room_at(line[1:]).min()
            if room > 0:
                found[place] = float(distance[place] * _weight(room))
        return found

    def _least_costs(self, left: dict[int, float]) -> Array:
        """The least cost from the start to every point, infinite where there is no way."""
        cost = np.full(len(self.points), inf)
        cost[list(left)] = list(left.values())
        lower = np.isfinite(cost)
        while lower.any():
            before, onwards = cost.copy(), lower[self.begins]
            through = cost[self.begins[onwards]] + self.costs[onwards]
            np.minimum.at(cost, self.ends[onwards], through)
            lower = cost < before
        return cost

    def _back(self, cost: Array, left: dict[int, float], end: int) -> Array:
        """The points from the start to one, along which costs add up."""
        places = [end]
        while not (places[-1] in left and cost[places[-1]] >= left[places[-1]]):
            to = np.flatnonzero(self.ends == places[-1])
            begins = self.begins[to]
            places.append(int(begins[(cost[begins] + self.costs[to]).argmin()]))
        return self.points[places[::-1]]


def _weight(room: Array | float) -> Array | float:
    """By what factor length counts at places with little room."""
    return 1 + _NARROW / np.maximum(room, 1e-6)


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
