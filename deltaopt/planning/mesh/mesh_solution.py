"""What one mesh brings: the motion, what it gives away, and the gap that leaves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deltaopt.limits.constraints import Constraints
from deltaopt.motion.extrema import sample_fractions
from deltaopt.motion.time_scaling import Loads, loads_inside, safe_factor, sampled_factor
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.mesh.constraint_tightening import Overshoot
from deltaopt.planning.mesh.error_estimate import (
    FRACTIONS,
    SAFETY_FACTOR,
    TIGHTENED,
    ErrorEstimate,
    error_estimate,
)
from deltaopt.planning.nlp.problem import Guess, Problem, Solved
from deltaopt.planning.nlp.program import Spent
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.scene import Scene

Array = NDArray[np.float64]
Truths = NDArray[np.bool]

_JUDGEABLE = 0.1
"""Of what was to be gained on a mesh: if the next gains less, its estimate cannot be judged."""


@dataclass(frozen=True)
class Iteration:
    """One mesh: ``duration`` of its solution, ``safe_duration`` once slowed to the limits (s),
    estimated ``gap`` of the latter to the shortest possible, as a fraction of it; seconds
    ``spent``."""

    intervals: int
    iterations: int
    duration: float
    safe_duration: float
    gap: float
    spent: Spent

    def __str__(self) -> str:
        return (
            f"{self.intervals} intervals, {self.iterations} iterations: "
            f"{self.safe_duration:.6f} s, at most {self.gap:.1e} above the optimum"
        )


def solve_on_mesh(
    problem: Problem, scaling: Scaling, guess: Guess, model: DeltaModel
) -> MeshSolution:
    """Solve a problem and see what its motion asks of the limits. Raises NotConverged."""
    solution = problem.solve(guess, scaling, model.parameters)
    trajectory = Trajectory(solution.position, model, solution.coordinates)
    loads = loads_inside(scaling.scene, trajectory, FRACTIONS)
    rows = time_costing_rows(scaling.constraints)
    lost = error_estimate(
        solution.multipliers[:, :, rows],
        _by_interval(loads.rows)[:, :, rows],
        np.sqrt(loads.highest_slower(len(FRACTIONS))),
    )
    factor = sampled_factor(loads)
    return MeshSolution(problem, solution, trajectory, loads, lost, factor, scaling)


def time_costing_rows(constraints: Constraints) -> Truths:
    """Rows that give time away where the mesh leaves them unused, (rows,): all but those of
    positions, which an optimal motion too touches at an instant and leaves again."""
    return np.asarray(constraints.orders > 0)


def _by_interval(rows: Array) -> Array:
    """Rows at ``FRACTIONS``, (N · len(FRACTIONS), rows), by interval."""
    return rows.reshape(-1, len(FRACTIONS), rows.shape[1])


@dataclass(frozen=True)
class MeshSolution:
    """A problem solved on one mesh in a scene's scaling, the motion not yet slowed; ``loads`` at
    ``FRACTIONS``."""

    problem: Problem
    solution: Solved
    trajectory: Trajectory
    loads: Loads
    lost: ErrorEstimate
    safe_factor: float
    scaling: Scaling
    is_exact: bool = False

    @property
    def has_all_multipliers(self) -> bool:
        """Whether it is a motion of cubics with the multipliers of all limits."""
        cubic = self.solution.position.coefficients.shape[1] == 4
        return cubic and self.solution.all_at_points

    @property
    def rows(self) -> Array:
        """Constraint rows inside the intervals, (N, len(FRACTIONS), rows)."""
        return _by_interval(self.loads.rows)

    @property
    def scene(self) -> Scene:
        return self.scaling.scene

    @property
    def mesh(self) -> Array:
        return self.problem.mesh

    def tightened(self, mesh: Array) -> Scaling:
        """The limits that a motion on the next mesh, which divides this one, may use."""
        if mesh.min() > TIGHTENED:
            return self.scaling.untightened
        tightenable = time_costing_rows(self.scaling.constraints)
        size = self.scaling.constraints.size(self.rows)
        overshoot = Overshoot.of(self.mesh, self.problem.points, size, tightenable)
        return overshoot.tightened(self.scaling, mesh)

    @property
    def status(self) -> str:
        return self.solution.status

    @property
    def to_be_gained(self) -> float:
        """By other meshes and by solving this one exactly, a fraction of the duration."""
        return self.lost.total + self.solution.left

    def exact(self) -> MeshSolution:
        """With the safe factor of all instants, not of samples only."""
        if self.is_exact:
            return self
        as_sampled = len(sample_fractions(len(self.mesh))) == len(FRACTIONS)
        known = self.loads if as_sampled else None
        factor = safe_factor(self.scene, self.trajectory, sampled=known)
        return replace(self, safe_factor=factor, is_exact=True)


def gap_of(iterations: list[Iteration], chosen: int) -> float:
    """Of a round's motion, by its own estimate or by what the last one leaves possible, unless
    that was led to a worse local minimum."""
    own = iterations[chosen]
    for last in reversed(iterations[chosen + 1 :]):
        shortest = last.safe_duration / (1 + last.gap)
        if shortest <= own.safe_duration:
            return min(own.gap, own.safe_duration / shortest - 1)
    return own.gap


def iteration_of(solutions: list[MeshSolution]) -> Iteration:
    """What the last attempt reached.

    The estimate of what it gives away is held against how much the duration really fell from
    the last other mesh: where the estimate fell short there, it is raised in proportion.
    """
    last = solutions[-1]
    others = [each for each in solutions if len(each.mesh) != len(last.mesh)]
    correction = 1.0
    if others:
        before = others[-1]
        fell = before.trajectory.duration / last.trajectory.duration - 1
        expected = before.to_be_gained - last.to_be_gained
        judgeable = expected > _JUDGEABLE * before.to_be_gained
        correction = max(1.0, fell / expected) if judgeable else 2.0
    return Iteration(
        intervals=len(last.mesh),
        iterations=last.solution.iterations,
        duration=last.trajectory.duration,
        safe_duration=last.trajectory.duration * last.safe_factor,
        gap=last.safe_factor - 1 + correction * SAFETY_FACTOR * last.to_be_gained,
        spent=last.solution.spent,
    )
