"""Whether another way round would have been faster than the one that a plan takes.

Random curves from start to goal, and the ways that bows and bands of these lead to, are all solved
on the first mesh: none is left out for being slow. What comes near the plan there is planned.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from itertools import chain

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.attempts import Attempt
from deltaopt.planning.first_motions.around_bodies import CLEAR, ways_around
from deltaopt.planning.first_motions.multistart import first_motions
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser

_NEAR = 1.06
"""Duration on the first mesh, over that of the plan, up to which a way is planned: that mesh tells
durations to some two per cent, of ways that are squeezed to more."""
_SAME, _COMPARED = 0.02, 33
"""Of the straight line: first motions, or motions on the first mesh, that are nowhere farther apart
at so many equal shares of their durations are one."""
_INTERVALS = (16, 32)
"""Of first meshes: a finer one where the coarse one is not solved."""


@dataclass(frozen=True)
class OtherWays:
    """What exhaustive multistart found beside a plan.

    ``number``: of the scene. ``duration``: of the plan, s, and ``fastest`` of all that was planned,
    itself among it. ``gap``: of the plan. ``starts``: first motions that were solved on the first
    mesh; ``planned``: how many of them were planned. ``way``: the way that is faster, in words;
    empty where none is.
    """

    number: int
    duration: float
    fastest: float
    gap: float
    starts: int
    planned: int
    way: str

    @property
    def gain(self) -> float:
        """By how much the plan takes longer than the fastest, as a share."""
        return self.duration / self.fastest - 1


def other_ways(scene: deltaopt.Scene, number: int, curves: int) -> OtherWays:
    """Look for faster ways from so many random curves; from none where the fastest motion without
    bodies is clear of them."""
    plan = deltaopt.plan(scene)
    if plan.ways[0].name == CLEAR:
        return OtherWays(number, plan.duration, plan.duration, plan.gap, 0, 0, "")
    optimiser = TrajectoryOptimiser()
    starts = _starts(scene, curves, number)
    found = list[tuple[Trajectory, str]]()
    for motion, name in starts:
        solved = _on_first_mesh(optimiser, scene, motion)
        if solved is not None and solved.duration < _NEAR * plan.duration:
            found.append((solved, name))
    fastest, way, tried = plan.duration, "", list[Array]()
    for motion, name in found:
        path = _sampled(motion)
        if _is_among(path, tried):
            continue
        tried.append(path)
        with suppress(deltaopt.DeltaOptError):
            attempt = Attempt(scene, motion, _INTERVALS[0], is_near=True)
            other = optimiser.plan(attempt, lambda _: None)
            if other.duration < fastest and deltaopt.verify(scene, other.trajectory).ok:
                fastest, way = other.duration, name
    return OtherWays(number, plan.duration, fastest, plan.gap, len(starts), len(tried), way)


def _starts(scene: deltaopt.Scene, curves: int, seed: int) -> list[tuple[Trajectory, str]]:
    """Distinct first motions that are clear of bodies, with their ways in words."""
    without = scene.model_copy(update={"keep_out": None, "clearance": None})
    found, paths = list[tuple[Trajectory, str]](), list[Array]()
    for curve in first_motions(without, curves, seed):
        for way in chain.from_iterable(ways_around(scene, curve)):
            path = _sampled(way.motion)
            if not _is_among(path, paths):
                paths.append(path)
                found.append((way.motion, way.name))
    return found


def _on_first_mesh(
    optimiser: TrajectoryOptimiser, scene: deltaopt.Scene, motion: Trajectory
) -> Trajectory | None:
    for intervals in _INTERVALS:
        with suppress(deltaopt.DeltaOptError):
            attempt = Attempt(scene, motion, intervals)
            return optimiser.on_first_mesh(attempt)
    return None


def _sampled(motion: Trajectory) -> Array:
    shares = np.linspace(0.0, 1.0, _COMPARED)
    return motion.position.at(motion.knots[0] + motion.duration * shares)


def _is_among(path: Array, others: list[Array]) -> bool:
    way = float(np.linalg.norm(path[-1] - path[0]))
    return any(np.abs(path - other).max() < _SAME * way for other in others)
