"""Multistart: several first guesses, because a minimum is local and another may be better."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from math import dist, hypot

import numpy as np
from numpy.typing import NDArray

from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.initial_motion import curve_between, drivable
from deltaopt.planning.first_motions.order_of_merit import in_order_of_merit
from deltaopt.planning.plan import Optimum
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import given_points

Array = NDArray[np.float64]

_SPREAD = 0.5
"""Standard deviation of the random control points about the line, as a share of the distance from
start to goal. A larger one explores more of the workspace, but more curves leave it."""
_TRIES = 50
"""Random curves drawn for each guess that is wanted, before the search for drivable ones ends."""
_SAME_PATH = 1e-2
"""Two motions are the same local minimum if their positions at half time are closer than this share
of the distance from start to goal: more than planning to a tolerance moves them."""


def first_motions(scene: Scene, number: int, seed: int) -> Iterator[Trajectory]:
    """First guesses: distinct ways in order of merit, then random cubics as fast as the limits
    allow.

    They are fewer than ``number`` if hardly any random cubic stays in the workspace. Raises
    Unreachable if there is no way.
    """
    ways = 0
    for motion in islice(in_order_of_merit(scene), number):
        ways += 1
        yield motion
    random = drivable(scene, islice(_cubics(scene, seed), _TRIES * (number - ways)))
    yield from islice(random, number - ways)


def _cubics(scene: Scene, seed: int) -> Iterator[Trajectory]:
    """Bézier curves whose control points are normally distributed about thirds of the line."""
    rng = np.random.default_rng(seed)
    start, goal = (np.array(point) for point in given_points(scene.task))
    way = goal - start
    thirds = start + np.outer([1 / 3, 2 / 3], way)
    while True:
        away = _SPREAD * hypot(*way) * rng.standard_normal((2, 3))
        yield curve_between(scene, *(thirds + away))


def distinct(found: Sequence[tuple[Trajectory, float, float]], length: float) -> list[Optimum]:
    """The distinct local minima among motions with their costs and gaps, best first.

    Two motions are the same if their costs differ by no more than the sum of their gaps and
    their positions at half time by no more than ``_SAME_PATH`` times ``length``, the distance from
    start to goal in m.
    """
    optima: list[Optimum] = []
    for motion, cost, gap in sorted(found, key=lambda each: each[1]):
        halfway = motion([motion.knots[0] + motion.duration / 2]).x[0]
        new = Optimum(motion.duration, cost, tuple(halfway.tolist()), gap, 1)
        known = next((i for i, old in enumerate(optima) if _same(old, new, length)), None)
        if known is None:
            optima.append(new)
        else:
            old = optima[known]
            optima[known] = replace(old, starts=old.starts + 1)
    return optima


def _same(one: Optimum, other: Optimum, length: float) -> bool:
    apart = dist(one.halfway, other.halfway)
    difference = abs(one.cost / other.cost - 1)
    return difference <= one.gap + other.gap and apart <= _SAME_PATH * length
