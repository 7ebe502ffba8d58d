"""Many first guesses: a minimum is local, and another start may lead to a better one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.initial_motion import curve_between, drivable, first_motion
from deltaopt.scene.scene import Scene

Array = NDArray[np.float64]

_SPREAD = 0.5
"""Of the control points about the line, in units of the distance from start to goal."""
_TRIES = 50
"""Random curves for each that can be driven: more than that, and there are hardly any."""
_SAME_PATH = 1e-2
"""Motions half of whose time leads to places closer together than this share of the distance
from start to goal are the same motion, planned to a tolerance."""


def first_motions(scene: Scene, number: int, seed: int) -> Iterator[Trajectory]:
    """``first_motion``, then random cubics from start to goal as fast as the limits allow.

    Fewer than ``number`` where hardly any cubic can be driven.
    """
    yield first_motion(scene)
    random = drivable(scene, islice(_cubics(scene, seed), _TRIES * (number - 1)))
    yield from islice(random, number - 1)


def _cubics(scene: Scene, seed: int) -> Iterator[Trajectory]:
    """Bézier curves whose control points are normally distributed about thirds of the line."""
    rng = np.random.default_rng(seed)
    start, way = np.array(scene.start), np.array(scene.goal) - np.array(scene.start)
    thirds = start + np.outer([1 / 3, 2 / 3], way)
    while True:
        away = _SPREAD * np.linalg.norm(way) * rng.standard_normal((2, 3))
        yield curve_between(scene, *(thirds + away))


@dataclass(frozen=True)
class Optimum:
    """A local minimum: ``duration`` (s), ``cost`` in the objective's unit, the platform's place
    at half of the time (m), the gap it was planned to, and how many of the starts led there."""

    duration: float
    cost: float
    halfway: tuple[float, float, float]
    gap: float
    starts: int


def distinct(found: Sequence[tuple[Trajectory, float, float]], length: float) -> list[Optimum]:
    """Local minima among motions with their costs and gaps, best first.

    Two are one if their costs differ by no more than their gaps leave open and their
    halfway places by no more than a hundredth of ``length``, start to goal.
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
    apart = float(np.linalg.norm(np.subtract(one.halfway, other.halfway)))
    difference = abs(one.cost / other.cost - 1)
    return difference <= one.gap + other.gap and apart <= _SAME_PATH * length
