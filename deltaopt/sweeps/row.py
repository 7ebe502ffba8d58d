"""A row: what is told of the plan of one point of a sweep, or why there is none."""

from __future__ import annotations

from time import thread_time
from typing import Any

import numpy as np

from deltaopt.errors import DeltaOptError
from deltaopt.motion.active_limits import active_limits, share_curves
from deltaopt.output.cycle_files import verified
from deltaopt.planning.cycles.cycle_planning import plan_cycle
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import plan
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.cycle import Cycle
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import made_of
from deltaopt.scene.task import MovingEnds
from deltaopt.sensitivity.keys import changed
from deltaopt.sweeps.points import Task
from deltaopt.verify.cycle import CycleVerification
from deltaopt.verify.verification import Verification, verify

_WITHIN = np.linspace(0.0, 1.0, 17)
"""Of each interval: where torques are looked at for the largest."""

Row = dict[str, Any]


def row_of(task: Task) -> Row:
    """The row of a point by the names of its columns, without facts that there are none of."""
    begin = thread_time()
    try:
        job = made_of(changed(task.base.content, task.changes), task.base.file)
        tolerance = task.tolerance
        told = _of_cycle(job, tolerance) if isinstance(job, Cycle) else _of_motion(job, tolerance)
    except DeltaOptError as error:
        told = {"error": str(error)}
    return {**task.head, **told, "seconds": thread_time() - begin}


def _of_motion(scene: Scene, tolerance: float) -> Row:
    found = plan(scene, tolerance=tolerance)
    judged = verify(found.scene, found.trajectory)
    parts = None if isinstance(scene.task, MovingEnds) else 30 / found.duration
    row = {"duration": found.duration, "parts_per_minute": parts, "gap": found.gap}
    return _of_legs((found,), (judged,)) | _judged(judged) | row


def _of_cycle(cycle: Cycle, tolerance: float) -> Row:
    found = plan_cycle(cycle, tolerance=tolerance)
    judged, parts = verified(found), found.parts_per_minute
    row: Row = {"duration": found.period, "parts_per_minute": parts, "gap": found.gap}
    if max(found.prices) > 0:
        row["limited_by"] = f"RMS torque of motor {int(np.argmax(found.prices)) + 1}"
    return _of_legs(found.legs, judged.legs) | _judged(judged) | row


def _of_legs(legs: tuple[Plan, ...], judged: tuple[Verification, ...]) -> Row:
    """What is largest, nearest or longest in any of some motions."""
    shares, seconds = list[float](), dict[str, float]()
    for leg in legs:
        problem, motion = problem_of(leg.scene), leg.trajectory
        curves = share_curves(problem, motion, _WITHIN)
        shares += [np.abs(each.values).max() for each in curves if each.limit == "torque"]
        for each in active_limits(problem, motion):
            name = f"{each.limit} of {each.subject}"
            seconds[name] = seconds.get(name, 0.0) + each.share * motion.duration
    distances = (each.least for one in judged for each in one.distances)
    return {
        "torque_share": float(max(shares)),
        "singularity": min(distances, default=None),
        "limited_by": max(seconds, key=lambda name: seconds[name], default=None),
    }


def _judged(verification: Verification | CycleVerification) -> Row:
    duty, failures = verification.duty, verification.failures()
    row: Row = {"verified": "no" if failures else "yes"}
    if failures:
        row["error"] = f"verification failed: {'; '.join(failures)}"
    if duty is not None and duty.rms_share is not None:
        row["rms_share"] = duty.rms_share
    return row
