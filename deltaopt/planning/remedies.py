"""Remedies: what is attempted where an attempt failed, or missed its tolerance, and why."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

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


@dataclass(frozen=True)
class Remedy:
    """``helps``: whether it may help after what came of an attempt. ``changed``: what is attempted
    then, one after the other as long as it may help; it may raise an error where nothing can."""

    helps: Callable[[TrajectoryOptimiser, Attempt, Outcome], bool]
    changed: Callable[[Attempt], Iterable[Attempt]]


def _crosses(optimiser: TrajectoryOptimiser, attempt: Attempt, outcome: Outcome) -> bool:
    return isinstance(outcome, CrossesSingularity)


def _kept_away(attempt: Attempt) -> Iterator[Attempt]:
    require_ends_on_one_side(attempt.scene)
    away = attempt.away
    if away is not None:
        yield away


def _is_held(optimiser: TrajectoryOptimiser, attempt: Attempt, outcome: Outcome) -> bool:
    return isinstance(outcome, HeldByMotion)


def _with_less_torque(attempt: Attempt) -> Iterator[Attempt]:
    room = limit_room_at_ends(attempt.scene) / 2
    for kept in _TORQUE_KEPT:
        yield replace(attempt, torque_share=1 - min(kept, room))


def _is_softened(optimiser: TrajectoryOptimiser, attempt: Attempt, outcome: Outcome) -> bool:
    return _is_missed(attempt, outcome) and bool(optimiser.softer(attempt))


def _without_softer(attempt: Attempt) -> Iterator[Attempt]:
    yield replace(attempt, may_be_softer=False)


def _is_unresolved(optimiser: TrajectoryOptimiser, attempt: Attempt, outcome: Outcome) -> bool:
    return _is_missed(attempt, outcome) and optimiser.tolerance < optimiser.resolved_below


def _from_another_mesh(attempt: Attempt) -> Iterator[Attempt]:
    yield replace(attempt, intervals=_RETRY_HALVES * attempt.intervals // 2)


def _is_missed(attempt: Attempt, outcome: Outcome) -> bool:
    """Whether a motion from rest to rest that is not in phases is found and misses its
    tolerance."""
    scene = attempt.scene
    resolvable = (
        scene.task.is_at_rest and not scene.task.gates and isinstance(scene.objective, Time)
    )
    return resolvable and isinstance(outcome, Plan) and not outcome.within_tolerance


REMEDIES = (
    Remedy(_crosses, _kept_away),
    Remedy(_is_held, _with_less_torque),
    Remedy(_is_softened, _without_softer),
    Remedy(_is_unresolved, _from_another_mesh),
)
"""In this order: where one led to a plan, those after it may make it better."""


def better(one: Outcome, other: Outcome) -> Outcome:
    """The shorter of two plans, the only one, or the later error."""
    if isinstance(one, Plan) and isinstance(other, Plan):
        return quicker(one, other)
    return one if isinstance(one, Plan) else other
