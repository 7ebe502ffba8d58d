"""Plans on a path that a scene gives: there is one motion, and no first guess."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from deltaopt.planning.journal import Progress
from deltaopt.planning.path.path_planning import NAME, PathMotion, fastest_on_path
from deltaopt.planning.plan import Plan
from deltaopt.scene.parallel_singularity import require_path_on_one_side
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath

_ALONG = 1001
"""Instants at which a path whose plan misses its tolerance is looked at for a singularity."""


def planned_on_path(scene: Scene, task: OnPath, tolerance: float, report: Progress) -> Plan:
    """The plan of the fastest motion on the path that a scene gives.

    Raises Infeasible, Unreachable or Singular where the path cannot be driven, and NotConverged.
    """
    begin = perf_counter()
    found = fastest_on_path(scene, task, tolerance, report)
    if found.gap > tolerance:  # which no mesh mends where torques grow without bound
        position = found.trajectory.position
        first, last = position.knots[[0, -1]].tolist()
        require_path_on_one_side(scene, position.at(np.linspace(first, last, _ALONG)))
    return plan_of(scene, found, tolerance, perf_counter() - begin)


def plan_of(scene: Scene, found: PathMotion, tolerance: float, seconds: float = 0.0) -> Plan:
    """The plan of a motion on a path, which was found in so many ``seconds``."""
    return Plan(
        scene=scene,
        trajectory=found.trajectory,
        formulation="path",
        transcription=NAME,
        intervals=len(found.trajectory.knots) - 1,
        status="Swept",
        iterations=len(found.iterations),
        solve_seconds=seconds,
        gap=found.gap,
        tolerance=tolerance,
        meshes=found.iterations,
        multipliers=found.multipliers,
    )
