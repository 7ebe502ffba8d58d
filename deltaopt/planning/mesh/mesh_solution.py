"""What one mesh brings: the motion, what it gives away, and the gap that leaves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deltaopt.motion.extrema import sample_fractions
from deltaopt.motion.time_scaling import (
    Loads,
    loads_inside,
    safe_factor,
    sampled_factor,
    slowing_inside,
)
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.mesh.constraint_tightening import Overshoot
from deltaopt.planning.mesh.error_estimate import DOUBT, FRACTIONS, TIGHTENED, GivenAway, given_away
from deltaopt.planning.nlp.problem import Guess, Problem, Solved
from deltaopt.planning.nlp.program import Spent
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.scene import Scene

Array = NDArray[np.float64]

_TELLING = 0.1
"""Of what was to be gained on a mesh: if the next gains less, its estimate cannot be judged."""


@dataclass(frozen=True)
class Round:
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


def attempt(problem: Problem, scales: Scales, guess: Guess, model: DeltaModel) -> Attempt:
    """Solve a problem and see what its motion asks of the motors. Raises NotConverged."""
    solution = problem.solve(guess, scales, model.parameters)
    trajectory = Trajectory(solution.position, model, solution.coordinates)
    scene, loads = scales.scene, loads_inside(scales.scene, trajectory, FRACTIONS)
    demands = loads.highest_demands(len(FRACTIONS))
    lost = given_away(solution.prices, *shares(scene, loads), slowing_inside(demands))
    factor = sampled_factor(demands)
    return Attempt(problem, solution, trajectory, loads, lost, factor, scales)


@dataclass(frozen=True)
class Attempt:
    """A problem solved on one mesh in a scene's scales, the motion not yet slowed; ``loads`` at
    ``FRACTIONS``."""

    problem: Problem
    solution: Solved
    trajectory: Trajectory
    loads: Loads
    lost: GivenAway
    safe_factor: float
    scales: Scales
    is_exact: bool = False

    @property
    def scene(self) -> Scene:
        return self.scales.scene

    @property
    def mesh(self) -> Array:
        return self.problem.mesh

    def tightened(self, mesh: Array) -> Scales:
        """The limits that a motion on the next mesh, which divides this one, may use."""
        if mesh.min() > TIGHTENED:
            return self.scales.whole
        overshoot = Overshoot.of(self.mesh, self.problem.points, *shares(self.scene, self.loads))
        return overshoot.tightened(self.scales, mesh)

    @property
    def status(self) -> str:
        return self.solution.status

    @property
    def to_be_gained(self) -> float:
        """By other meshes and by solving this one exactly, a fraction of the duration."""
        return self.lost.total + self.solution.left

    def exact(self) -> Attempt:
        """With the safe factor of all instants, not of samples only."""
        if self.is_exact:
            return self
        as_sampled = len(sample_fractions(len(self.mesh))) == len(FRACTIONS)
        known = self.loads if as_sampled else None
        factor = safe_factor(self.scene, self.trajectory, sampled=known)
        return replace(self, safe_factor=factor, is_exact=True)


def mean_torques(attempt: Attempt) -> Array:
    """Of the intervals, as fractions of the limits, (N, 3)."""
    return np.asarray(shares(attempt.scene, attempt.loads)[0].mean(axis=1))


def shares(scene: Scene, loads: Loads) -> tuple[Array, Array | None]:
    """Torques and, if limited, speeds inside the intervals, as fractions of their limits."""
    shape = (-1, len(FRACTIONS), 3)
    speed = None if scene.speed_limits is None else loads.speed.reshape(shape)
    return loads.torque.reshape(shape), speed


def gap_of(rounds: list[Round], chosen: int) -> float:
    """Of a round's motion, by its own estimate or by what the last one leaves possible, unless
    that was led to a worse local minimum."""
    own = rounds[chosen]
    for last in reversed(rounds[chosen + 1 :]):
        shortest = last.safe_duration / (1 + last.gap)
        if shortest <= own.safe_duration:
            return min(own.gap, own.safe_duration / shortest - 1)
    return own.gap


def round_of(attempts: list[Attempt]) -> Round:
    """What the last attempt reached.

    The estimate of what it gives away is held against how much the duration really fell from
    the last other mesh: where the estimate fell short there, it is raised in proportion.
    """
    last = attempts[-1]
    others = [each for each in attempts if len(each.mesh) != len(last.mesh)]
    correction = 1.0
    if others:
        before = others[-1]
        fell = before.trajectory.duration / last.trajectory.duration - 1
        expected = before.to_be_gained - last.to_be_gained
        tells = expected > _TELLING * before.to_be_gained
        correction = max(1.0, fell / expected) if tells else 2.0
    return Round(
        intervals=len(last.mesh),
        iterations=last.solution.iterations,
        duration=last.trajectory.duration,
        safe_duration=last.trajectory.duration * last.safe_factor,
        gap=last.safe_factor - 1 + correction * DOUBT * last.to_be_gained,
        spent=last.solution.spent,
    )
