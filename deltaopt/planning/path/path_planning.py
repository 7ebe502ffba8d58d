"""The fastest motion of a scene that gives its path, as a trajectory that keeps every limit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isinf

import numpy as np

from deltaopt.errors import Infeasible, NotConverged
from deltaopt.motion.time_scaling import highest_rows, safe_factor
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.path.path_multipliers import PathMultipliers
from deltaopt.planning.path.path_rows import PathRows
from deltaopt.planning.path.path_timing import PathTiming, TimedPath
from deltaopt.planning.plan import PathIteration
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import model_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath

NAME = "quintic in time on the path"
"""Of the transcription."""
_KEPT = 1e-10
"""Excess up to which a motion that begins or ends at a speed keeps its limits: it must not be
slowed, for that would change its boundary values."""
_MOST_MARGINS = 8
_SHARES = (0.5, 0.2, 0.05)
"""Of the tolerance: estimated losses at which meshes are not refined further. The rest is for
tightening and slowing; if that is not enough, all is done again with the next."""
_ROUNDING = 1 + 2.0**-45
"""Factor by which motions are slowed to allow for rounding of torques."""
_TOUCHED = 1e-9
"""Share of a limit of position by which a path may be beyond it: rounding."""


@dataclass(frozen=True)
class PathMotion:
    """A motion on a given path that keeps every limit; ``gap``: estimated relative excess of its
    duration over the shortest possible on that path. ``multipliers``: of its limits."""

    trajectory: Trajectory
    gap: float
    multipliers: PathMultipliers
    iterations: tuple[PathIteration, ...]


def fastest_on_path(
    scene: Scene, task: OnPath, tolerance: float, report: Callable[[str], None]
) -> PathMotion:
    """The fastest motion of a scene on the path of its task.

    Raises Infeasible where no motion on the path keeps the limits, Unreachable and Singular where
    the path leads out of the workspace.
    """
    first, last = task.rates
    timing = PathTiming(task.path, PathRows.of(scene), (first**2, last**2), tolerance, report)
    planned = _slowed if task.speeds == (0.0, 0.0) else _held
    trajectory, gap, timed = planned(scene, timing)
    _require_positions(scene, trajectory)
    if trajectory.duration < scene.least_duration:
        trajectory = _waiting(scene, task, trajectory)
        gap = 0.0  # nothing is faster than what rotation takes
    multipliers = PathMultipliers(
        limits_of(scene).up_to(2),
        timing.rows,
        timed.on_mesh,
        timing.ends,
    )
    return PathMotion(trajectory, gap, multipliers, tuple(timing.iterations))


def _waiting(scene: Scene, task: OnPath, trajectory: Trajectory) -> Trajectory:
    """A motion slowed until a fourth axis has turned. Raises Infeasible where it cannot be."""
    least = scene.least_duration
    factor = safe_factor(problem_of(scene), trajectory, at_least=least / trajectory.duration)
    if isinf(factor) or task.speeds != (0.0, 0.0):
        raise Infeasible(
            f"the path takes {trajectory.duration:.6g} s, less than rotation does, and cannot be "
            f"slowed until then ({least:.6g} s)"
        )
    return trajectory.slowed(factor)


def _slowed(scene: Scene, timing: PathTiming) -> tuple[Trajectory, float, TimedPath]:
    """The fastest motion from rest to rest, slowed by what its limits are exceeded at last, its
    gap, and what it was before."""
    best: tuple[Trajectory, float, TimedPath] | None = None
    for share in _SHARES:
        found = timing.fastest(share)
        trajectory = Trajectory(found.motion.position, model_of(scene.robot, scene.payload))
        factor = safe_factor(problem_of(scene), trajectory) * _ROUNDING
        if isinf(factor):
            _require_positions(scene, trajectory)
            raise Infeasible("the path: somewhere on it a limit is exceeded at rest")
        slowed = trajectory.slowed(factor), (1 + found.loss) * factor - 1, found
        if best is None or slowed[0].duration < best[0].duration:
            best = slowed
        if slowed[1] <= timing.tolerance:
            return slowed
    assert best is not None
    return best


def _held(scene: Scene, timing: PathTiming) -> tuple[Trajectory, float, TimedPath]:
    """The fastest motion between given speeds, with all limits tightened until none is exceeded,
    its gap, and what it is on its mesh.

    Raises NotConverged where that takes too long.
    """
    margin = 0.0
    for _ in range(_MOST_MARGINS):
        found = timing.fastest(_SHARES[0], margin)
        trajectory = Trajectory(found.motion.position, model_of(scene.robot, scene.payload))
        factor = safe_factor(problem_of(scene), trajectory)
        if factor <= 1 + _KEPT:
            return trajectory, found.loss, found
        margin = max(2 * margin, 4 * (factor - 1))
    raise NotConverged("limits are exceeded between points of every mesh", "margin", trajectory)


def _require_positions(scene: Scene, trajectory: Trajectory) -> None:
    """Raise Infeasible where a path is beyond a limit of position, which no timing cures."""
    constraints = limits_of(scene).up_to(2).constraints
    positions = np.flatnonzero(constraints.of_place)
    if not len(positions):
        return
    highest = highest_rows(problem_of(scene), trajectory).values[positions]
    worst = int(highest.argmax())
    if highest[worst] > 1 + _TOUCHED:
        label = constraints.label(int(positions[worst]))
        raise Infeasible(f"the path: {label} is beyond its limit on it")
