"""The gap of the solutions on meshes that were refined one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from deltaopt.planning.mesh.error_estimate import SAFETY_FACTOR
from deltaopt.planning.mesh.mesh_solution import MeshSolution
from deltaopt.planning.plan import Iteration

_JUDGEABLE = 0.1
"""Share of the estimated loss of one mesh that the next must be expected to gain, so that the
estimate can be corrected by what was really gained."""


def with_gap(last: MeshSolution, before: Sequence[MeshSolution]) -> MeshSolution:
    """A mesh solution with its gap, by those on the meshes ``before`` it too.

    The estimated loss of time is compared with how much the duration really fell since the
    last solution on another mesh: where the estimate fell short, it is raised in proportion, but
    for what softer friction loses, which no other mesh changes.
    """
    to_be_gained = last.unused + _left([*before, last])
    others = [each for each in before if len(each.mesh) != len(last.mesh)]
    correction = 1.0
    if others:
        other = others[-1]
        fell = other.cost / last.cost - 1
        expected = other.to_be_gained - last.to_be_gained
        judgeable = expected > _JUDGEABLE * other.to_be_gained
        # Two solutions with nearly the same estimate say nothing about it: allow for a factor of 2.
        correction = max(1.0, fell / expected) if judgeable else 2.0
    lost = correction * (to_be_gained - last.lost_to_friction) + last.lost_to_friction
    return replace(last, gap=last.exceeding + SAFETY_FACTOR * lost)


def record_of(found: MeshSolution) -> Iteration:
    """What is told of a mesh solution."""
    return Iteration(
        intervals=len(found.mesh),
        iterations=found.solution.iterations,
        duration=found.trajectory.duration,
        safe_duration=found.safe_duration,
        gap=found.gap,
        cost=found.cost if found.problem.objective.running else None,
        unit=found.problem.objective.unit,
    )


def _left(solutions: Sequence[MeshSolution]) -> float:
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


def above_least(found: MeshSolution, meshes: Sequence[MeshSolution]) -> float:
    """By what share a mesh solution costs more than the least of all: its gap is no less."""
    return found.cost / min(each.cost for each in meshes) - 1


def above_relaxed(kept: MeshSolution, relaxed: MeshSolution) -> float:
    """The gap of a solution that keeps limits between points, by the one before, which does not."""
    least = relaxed.cost / (1 + SAFETY_FACTOR * relaxed.to_be_gained)
    return kept.cost / least - 1


def with_cost_of_keeping(gap: float, kept: MeshSolution, before: MeshSolution) -> float:
    """A gap with what it has cost to keep the limits between points, which the mesh solution
    ``before`` does not."""
    ratio = kept.cost / before.cost
    by_mesh_before = ratio * (1 + before.gap) - 1
    gap += max(0.0, ratio - 1)
    # A motion that costs less than that bound disproves it.
    return min(gap, by_mesh_before) if by_mesh_before > 0 else gap
