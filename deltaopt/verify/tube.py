"""The largest distance of a motion from the path about which its tube is, at all instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deltaopt.curves.bernstein import largest_norm
from deltaopt.curves.piecewise import Array, Index, PiecewisePolynomial
from deltaopt.limits.limit import OwnMeasure
from deltaopt.motion.trajectory import Trajectory
from deltaopt.scene.path import Path
from deltaopt.scene.scene import Scene, limits_of
from deltaopt.verify.away_from_path import from_moving_place, largest_distance
from deltaopt.verify.measures import Excess, Known
from deltaopt.verify.path_distance import nearest_places


def tube_excess(scene: Scene, trajectory: Trajectory) -> Excess | None:
    """By how much the motion leaves the tube of its scene, as a share of the tube; negative where
    it stays inside. None if there is no tube."""
    limits = limits_of(scene).constraints.limits
    limit = next((each for each in limits if each.own_measure is OwnMeasure.TUBE), None)
    if limit is None or scene.path is None or scene.tube is None:
        return None
    path = scene.path.between(*scene.given_points)
    farthest, t = farthest_from(path, trajectory.position, scene.tube)
    over = farthest - scene.tube
    share = over / scene.tube
    return Excess(limit.name, limit.unit, limit.subject, t, share, over, known=Known.SURE)


def farthest_from(path: Path, position: PiecewisePolynomial, asked: float) -> tuple[float, float]:
    """The largest distance (m) of a motion from a path, and when (s): that of an instant where all
    of the motion is known to keep what is asked for (m), and otherwise a bound that no instant
    exceeds."""
    return largest_distance(_NearestPlaces(path, position), position, asked)


@dataclass(frozen=True)
class _NearestPlaces:
    """The places of a path that are nearest to a motion."""

    path: Path
    position: PiecewisePolynomial

    def at_knots(self) -> Array:
        return nearest_places(self.path, self.position.at(self.position.knots))[0]

    def inside(self, pieces: Index, fractions: Array, x: Array, s: Array) -> Array:
        return nearest_places(self.path, x)[0]

    def bound(self, points: Array, s: Array) -> Array:
        on = self.path.interval(s.mean(axis=1))
        begin, end = self.path.knots[on, None], self.path.knots[on + 1, None]
        bound = from_moving_place(self.path, on, points, np.clip(s, begin, end))
        # Where the nearest place leaps from one side of a bend to the other, one that stays is
        # nearer.
        for place in s.T:
            bound = np.minimum(bound, largest_norm(points - self.path(place)[:, None]))
        return bound
