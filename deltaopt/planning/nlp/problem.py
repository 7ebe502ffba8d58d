"""What a planner needs of a problem, whatever its variables are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.motion.trajectory import PiecewisePolynomial, Trajectory
from deltaopt.planning.nlp.cost import Cost
from deltaopt.planning.nlp.program import Program, Solution, Spent
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration

Array = NDArray[np.float64]


IPOPT_FINEST = 300
"""Intervals of the finest mesh that is worth its time by Ipopt: every refinement multiplies it by
four."""


class Problem(Protocol):
    """A problem on a mesh, ready to be solved for scenes of a robot."""

    @property
    def mesh(self) -> Array:
        """Lengths of the intervals as fractions of the duration, (N,)."""
        ...

    @property
    def points(self) -> Array:
        """Fractions of every interval where the limits hold."""
        ...

    @property
    def finest(self) -> int:
        """Intervals of the finest mesh that is worth its time."""
        ...

    def solve(self, guess: Guess, scales: Scales, parameters: Array) -> Solved:
        """The best motion on this mesh; ``parameters``: the mechanism's."""
        ...


@dataclass(frozen=True)
class Guess:
    """A motion to start from. ``near``: whether it is a solution of a similar problem.
    ``tolerance``: relative, of the duration, to which the solution is wanted at least."""

    trajectory: Trajectory
    near: bool
    tolerance: float


class NonlinearProblem(Protocol):
    """A problem written as a nonlinear program for Ipopt."""

    def pack(self, trajectory: Trajectory, scales: Scales) -> Array:
        """The variables that describe a motion on this mesh."""
        ...

    def unpack(self, z: Array, scales: Scales) -> PiecewisePolynomial:
        """The motion of the platform that the variables describe, m and s."""
        ...

    def bounds(self, scales: Scales) -> tuple[Array, Array]:
        """Of the variables, for a scene."""
        ...

    def prices(self, solution: Solution) -> Array:
        """As in ``Solved``."""
        ...


@dataclass(frozen=True)
class Solved:
    """The motion found on a mesh, and what its limits cost.

    ``prices``: fraction of the duration per fraction of a limit, (N, points, 3 or 6): torques,
    then limited speeds; positive at the upper limit, negative at the lower. ``coordinates``: all
    twelve, m and rad, where they do not follow from the platform's position. ``left``: by what
    fraction of the duration the solver's next step would shorten it. ``opening_prices``: where
    the solver tells them, fraction of the duration per unit of the margins of the folds, (N,
    points, 3), positive where a margin holds.
    """

    position: PiecewisePolynomial
    prices: Array
    status: str
    iterations: int
    spent: Spent
    coordinates: PiecewisePolynomial | None = None
    left: float = 0.0
    opening_prices: Array | None = None


def solved_by_ipopt(
    problem: NonlinearProblem, program: Program, guess: Guess, scales: Scales, parameters: Array
) -> Solved:
    """By a program of the problem, with the parameters ``Scales.vector`` and the mechanism's.

    Raises NotConverged.
    """
    p, z = np.concatenate([scales.vector(), parameters]), problem.pack(guess.trajectory, scales)
    found = program.solve(z, *problem.bounds(scales), p)
    position = problem.unpack(found.z, scales)
    return Solved(position, problem.prices(found), found.status, found.iterations, found.spent)


class Posed(Protocol):
    """A formulation's equations for a mechanism, differentiated once."""

    def on(self, mesh: Array) -> Problem:
        """The problem on a mesh."""
        ...


class Pose(Protocol):
    """A way to write the problem as a nonlinear program; a value."""

    def __hash__(self) -> int: ...

    @property
    def name(self) -> str: ...

    def of(
        self,
        functions: DeltaFunctions,
        transcription: PiecewiseAcceleration,
        *,
        speed: bool,
        cost: Cost,
    ) -> Posed:
        """Its equations for a mechanism; ``speed``: whether motor speeds are limited; ``cost``:
        what is minimised, the running part of it effort in N²m²."""
        ...
