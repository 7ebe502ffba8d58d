"""The gap of the solutions on meshes that were refined one after the other."""

from __future__ import annotations

from deltaopt.planning.mesh.error_estimate import SAFETY_FACTOR
from deltaopt.planning.mesh.mesh_solution import MeshSolution
from deltaopt.planning.plan import Iteration

_JUDGEABLE = 0.1
"""Share of the estimated loss of one mesh that the next must be expected to gain, so that the
estimate can be corrected by what was really gained."""


def gap_of(iterations: list[Iteration], chosen: int) -> float:
    """Optimality gap of the motion of the mesh ``chosen``, by the estimates of all meshes after it.

    Each later mesh bounds the least duration from below by its safe duration over (1 + gap). The
    last bound that is not above the chosen motion is used; a higher one belongs to a worse local
    minimum.
    """
    own = iterations[chosen]
    for last in reversed(iterations[chosen + 1 :]):
        shortest = last.safe_duration / (1 + last.gap)
        if shortest <= own.safe_duration:
            return min(own.gap, own.safe_duration / shortest - 1)
    return own.gap


def iteration_of(solutions: list[MeshSolution]) -> Iteration:
    """The record of the last mesh solution, with its gap.

    The estimated loss of time is compared with how much the duration really fell since the
    last solution on another mesh: where the estimate fell short, it is raised in proportion, but
    for what softer friction loses, which no other mesh changes.
    """
    last = solutions[-1]
    to_be_gained = last.unused + _left(solutions)
    others = [each for each in solutions if len(each.mesh) != len(last.mesh)]
    correction = 1.0
    if others:
        before = others[-1]
        fell = before.cost / last.cost - 1
        expected = before.to_be_gained - last.to_be_gained
        judgeable = expected > _JUDGEABLE * before.to_be_gained
        # Two solutions with nearly the same estimate say nothing about it: allow for a factor of 2.
        correction = max(1.0, fell / expected) if judgeable else 2.0
    return Iteration(
        intervals=len(last.mesh),
        iterations=last.solution.iterations,
        duration=last.trajectory.duration,
        safe_duration=last.safe_duration,
        gap=last.exceeding
        + SAFETY_FACTOR
        * (correction * (to_be_gained - last.lost_to_friction) + last.lost_to_friction),
        cost=last.cost if last.problem.objective.running else None,
        unit=last.problem.objective.unit,
    )


def _left(solutions: list[MeshSolution]) -> float:
    """What the solver has left of the last solution, as a fraction of the duration.

    Where it had not arrived on the meshes before, it has been in a valley that is nearly flat: what
    it says now may be small by chance, and is taken to be no less than it was there.
    """
    left = [solutions[-1].solution.left]
    for each in reversed(solutions[:-1]):
        if each.has_arrived:
            break
        left.append(each.solution.left)
    return max(left)
