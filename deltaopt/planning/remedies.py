"""Remedies: what is attempted where an attempt failed, or missed its tolerance, and why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from deltaopt.errors import DeltaOptError
from deltaopt.planning.attempts import Attempt
from deltaopt.planning.first_motions.order_of_merit import CrossesSingularity
from deltaopt.planning.plan import Plan, quicker
from deltaopt.planning.trajectory_optimiser import HeldByMotion, TrajectoryOptimiser
from deltaopt.scene.feasibility import limit_room_at_ends
from deltaopt.scene.objective import Time
from deltaopt.scene.parallel_singularity import require_ends_on_one_side

_TORQUE_KEPT = (3e-4, 1e-3, 1e-2)
"""Parts of the torque limits that meshes leave unused where gravity takes almost all of them
somewhere, so that slowing cannot make up for what is exceeded between points; at most half of what
gravity leaves at start and goal. The gap counts what it costs."""
_RETRY_HALVES = 3
"""A plan that misses a tolerance below ``RESOLVED_BELOW`` is made once more from a first mesh of
3/2 as many intervals. Which switching structure is detected and which intervals are split depends
on the first mesh, so another one may succeed; it costs as much time again."""

Outcome = Plan | DeltaOptError
"""What came of an attempt."""


Remedy = Callable[[TrajectoryOptimiser, Attempt, Outcome], Attempt | None]
"""What to attempt after what came of an attempt; None where the remedy is none for that. It may
raise an error where nothing can help."""


def _kept_away(_: TrajectoryOptimiser, attempt: Attempt, outcome: Outcome) -> Attempt | None:
    if not isinstance(outcome, CrossesSingularity):
        return None
    require_ends_on_one_side(attempt.scene)
    return attempt.away


def _leaving_torque(kept: float) -> Remedy:
    """With this part of the torque limits left unused."""

    def changed(_: TrajectoryOptimiser, attempt: Attempt, outcome: Outcome) -> Attempt | None:
        if not isinstance(outcome, HeldByMotion):
            return None
        room = limit_room_at_ends(attempt.scene) / 2
        return replace(attempt, torque_share=1 - min(kept, room))

    return changed


def _from_another_mesh(
    optimiser: TrajectoryOptimiser, attempt: Attempt, outcome: Outcome
) -> Attempt | None:
    """Where a motion from rest to rest that is not in phases is found and misses a tolerance to
    which switches are resolved."""
    task, is_tight = attempt.scene.task, optimiser.tolerance < optimiser.resolved_below
    in_one = task.is_at_rest and not task.gates and isinstance(attempt.scene.objective, Time)
    is_missed = isinstance(outcome, Plan) and not outcome.within_tolerance
    if not (in_one and is_tight and is_missed):
        return None
    return replace(attempt, intervals=_RETRY_HALVES * attempt.intervals // 2)


REMEDIES = (_kept_away, *map(_leaving_torque, _TORQUE_KEPT), _from_another_mesh)
"""In this order, each after what came of those before."""


def better(one: Outcome, other: Outcome) -> Outcome:
    """The shorter of two plans, the only one, or the later error."""
    if isinstance(one, Plan) and isinstance(other, Plan):
        return quicker(one, other)
    return one if isinstance(one, Plan) else other
