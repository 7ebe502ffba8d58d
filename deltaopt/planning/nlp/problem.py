"""What a planner needs of a problem, whatever its variables are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.motion.trajectory import PiecewisePolynomial, Trajectory
from deltaopt.planning.nlp.cost import Cost
from deltaopt.planning.nlp.program import Spent
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration

Array = NDArray[np.float64]


IPOPT_FINEST = 300
"""Intervals of the finest mesh that is worth its time by Ipopt: every refinement multiplies it by
four."""


@dataclass(frozen=True)
class Ipopt:
    """The general interior-point solver that most of the field knows and cites. It solves every
    formulation, with or without a compiler."""

    name: str = "ipopt"


@dataclass(frozen=True)
class InteriorPoint:
    """deltaopt's own interior-point method in compiled C, for the flat formulation; Ipopt where
    there is no compiler, and where the method does not converge."""

    name: str = "interior-point"


Solver = Ipopt | InteriorPoint


@dataclass(frozen=True)
class Guess:
    """A motion to start from. ``near``: whether it is a solution of a similar problem.
    ``tolerance``: relative, of the duration, to which the solution is wanted at least."""

    trajectory: Trajectory
    near: bool
    tolerance: float


@dataclass(frozen=True)
class Solved:
    """The motion found on a mesh, and the multipliers of its limits.

    ``multipliers``: by what fraction of the duration a motion is longer for each unit of a
    normalised row that its bound is tighter ("shadow prices"), (N, points, rows): positive at an
    upper bound, negative at a lower one. ``all_at_points``: whether these are all multipliers of
    the motion, and at the problem's points. ``coordinates``: all twelve, m and rad, where they do
    not follow from the platform's position. ``left``: by what fraction of the duration the
    solver's next step would shorten it.
    """

    position: PiecewisePolynomial
    multipliers: Array
    status: str
    iterations: int
    spent: Spent
    all_at_points: bool = False
    coordinates: PiecewisePolynomial | None = None
    left: float = 0.0


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

    def solve(self, guess: Guess, scaling: Scaling, parameters: Array) -> Solved:
        """The best motion on this mesh; ``parameters``: the mechanism's. Raises NotConverged."""
        ...


class FormulatedProblem(Protocol):
    """A formulation's equations for a mechanism and limits, differentiated once."""

    def on(self, mesh: Array) -> Problem:
        """The problem on a mesh."""
        ...


class ProblemFormulation(Protocol):
    """A way to write the problem as a nonlinear program; a value."""

    def __hash__(self) -> int: ...

    @property
    def name(self) -> str: ...

    @property
    def solvers(self) -> tuple[type[Ipopt] | type[InteriorPoint], ...]:
        """Which solvers can be asked for."""
        ...

    def of(
        self,
        functions: DeltaFunctions,
        transcription: PiecewiseAcceleration,
        constraints: Constraints,
        cost: Cost,
        solver: Solver,
    ) -> FormulatedProblem:
        """Its equations for a mechanism under limits; ``cost``: what is minimised, the running part
        of it effort in N²m²."""
        ...
