"""A row: what is told of the plan of one point of a sweep, or why there is none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np

from deltaopt.errors import DeltaOptError
from deltaopt.motion.active_limits import active_limits, share_curves
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.cycle_files import verified
from deltaopt.output.facts import facts
from deltaopt.planning.cycles.cycle_planning import plan_cycle
from deltaopt.planning.planner import plan
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.cycle import Cycle
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import made_of
from deltaopt.scene.task import MovingEnds
from deltaopt.sweeps.keys import changed
from deltaopt.verify.cycle import CycleVerification
from deltaopt.verify.verification import Verification

FACTS = (
    "duration",
    "parts_per_minute",
    "rms_share",
    "torque_share",
    "singularity",
    "limited_by",
    "verified",
    "gap",
    "seconds",
    "error",
)
"""Columns of every table. ``duration``: of a motion, or the period of a cycle, s.
``parts_per_minute``: of a single motion as if it went there and back. ``rms_share``: the RMS torque
of the motor that is warmest if this goes on without a pause, over what it is rated for.
``torque_share``: the largest torque over its limit. ``singularity``: the least distance from any, 1
at best. ``limited_by``: the limit that the motion is at for most of the time. ``verified``: yes or
no. ``gap``: how much longer than the optimum it is, estimated. ``seconds``: of a processor.
``error``: what verification finds wrong, or why there is no plan."""
_WITHIN = np.linspace(0.0, 1.0, 17)
"""Of each interval: where torques are looked at for the largest."""

Row = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """A point of a sweep to plan: its ``index``, the ``content`` of its files, what is to be
    changed in it by key, and the tolerance of its plan. ``file``: what errors name."""

    index: int
    file: Path
    content: Mapping[str, Any]
    changes: Mapping[str, Any]
    tolerance: float

    def row(self) -> Row:
        """The facts of its plan, by the names of columns, without those there are none of."""
        begin = thread_time()
        try:
            scene = made_of(changed(self.content, self.changes), self.file)
            if isinstance(scene, Cycle):
                told = _of_cycle(scene, self.tolerance)
            else:
                told = _of_motion(scene, self.tolerance)
        except DeltaOptError as error:
            told = {"error": str(error)}
        return {"point": self.index, **told, "seconds": thread_time() - begin}


Leg = tuple[Scene, Trajectory, Verification]


def _of_motion(scene: Scene, tolerance: float) -> Row:
    told = facts(plan(scene, tolerance=tolerance))
    duration, goes_back = told.trajectory.duration, not isinstance(scene.task, MovingEnds)
    parts = 30 / duration if goes_back else None
    legs = [(scene, told.trajectory, told.verification)]
    row = {"duration": duration, "parts_per_minute": parts, "gap": told.found.gap}
    return row | _of_legs(legs) | _judged(told.verification)


def _of_cycle(cycle: Cycle, tolerance: float) -> Row:
    found = plan_cycle(cycle, tolerance=tolerance)
    verification, parts = verified(found), found.parts_per_minute
    pairs = zip(found.legs, verification.legs, strict=True)
    legs = [(leg.scene, leg.trajectory, each) for leg, each in pairs]
    row: Row = {"duration": found.period, "parts_per_minute": parts, "gap": found.gap}
    row |= _of_legs(legs) | _judged(verification)
    if max(found.prices) > 0:
        row["limited_by"] = f"RMS torque of motor {int(np.argmax(found.prices)) + 1}"
    return row


def _of_legs(legs: Sequence[Leg]) -> Row:
    """What is largest, nearest or longest in any of some motions."""
    shares, seconds, distances = list[float](), dict[str, float](), list[float]()
    for scene, motion, verification in legs:
        problem = problem_of(scene)
        curves = share_curves(problem, motion, _WITHIN)
        shares += [np.abs(each.values).max() for each in curves if each.limit == "torque"]
        distances += [each.least for each in verification.distances]
        for each in active_limits(problem, motion):
            name = f"{each.limit} of {each.subject}"
            seconds[name] = seconds.get(name, 0.0) + each.share * motion.duration
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
    if duty is not None and duty.rated_torque is not None:
        pairs = zip(duty.motors, duty.rated_torque, strict=True)
        row["rms_share"] = max(motor.rms_torque / rated for motor, rated in pairs)
    return row
