"""The formulations of the planning problem that a user chooses from, as values."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from functools import lru_cache
from typing import ClassVar

from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.errors import Unusable
from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.functions import Functions
from deltaopt.planning.flat.equations import point_equations
from deltaopt.planning.flat.flat_problem import compiled_flat
from deltaopt.planning.formulations.collocation import CollocationProblem, Equations
from deltaopt.planning.formulations.delta import DeltaProblem, scaled_delta
from deltaopt.planning.formulations.equations import (
    explicit_equations,
    flat_equations,
    forward_equations,
    multiplier_equations,
)
from deltaopt.planning.formulations.loop_closure import KnotConstraints, LoopClosure
from deltaopt.planning.formulations.scaled_mechanism import ScaledMechanism
from deltaopt.planning.nlp.problem import FASTEST, Cost, Formulated, InteriorPoint, Ipopt, Solver
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration


class ProblemFormulation(ABC):
    """A way to write the planning problem as a nonlinear program.

    Its differential equations hold at the nodes of every interval. It is a hashable value, so that
    equal formulations share their equations. ``solvers``: kinds of solver that can be asked for,
    the default first.
    """

    solvers: ClassVar[tuple[type[Solver], ...]] = (Ipopt,)

    @property
    @abstractmethod
    def name(self) -> str:
        """The name that a plan reports: "explicit, constraints at knots"."""

    def of(
        self,
        functions: Functions,
        transcription: PiecewiseAcceleration,
        constraints: Constraints,
        cost: Cost = FASTEST,
        solver: Solver | None = None,
    ) -> Formulated:
        """Its equations for a mechanism under limits, for one of its solvers, or for the default.

        ``cost``: what is minimised; the rate of its running part is τᵀτ, N²m². They are for Ipopt
        too without a C compiler, and for accelerations that are not linear in every interval.
        Raises Unusable for limits of order 3 then.
        """
        kind = self.solvers[0] if solver is None else type(solver)
        if kind is InteriorPoint and (constraints.order == 3 or transcription.degree == 1):
            own = compiled_flat(point_equations(functions, constraints), transcription, cost)
            if own is not None:
                return own
        if constraints.order == 3:
            raise Unusable(
                "limits and costs of jerk or torque rate are planned by deltaopt's own method "
                "alone: in the flat formulation, with a C compiler"
            )

        def on(mesh: Array) -> DeltaProblem:
            equations = _equations(self, functions, constraints)
            return DeltaProblem(CollocationProblem(equations, transcription, mesh, cost))

        return on

    @abstractmethod
    def equations(self, system: ScaledMechanism) -> Equations:
        """Its equations for any scaled mechanism."""


@dataclass(frozen=True)
class Flat(ProblemFormulation):
    """The formulation in the platform's coordinates alone, which is the default."""

    name: str = "flat"
    solvers: ClassVar[tuple[type[Solver], ...]] = (InteriorPoint, Ipopt)

    def equations(self, system: ScaledMechanism) -> Equations:
        """Its equations for any scaled mechanism."""
        return flat_equations(system)


@dataclass(frozen=True)
class Redundant(ProblemFormulation):
    """The formulation in all twelve coordinates, which are polynomials under loop closure.

    ``formulation``: of the dynamics. With ``Multiplier`` it is eq. (37), with any other eq. (39),
    for virtual work and Kane's method lead to the same three equations as the explicit form.
    ``closure``: how drift of the loops is prevented.

    Examples:
        >>> deltaopt.Redundant(deltaopt.multiplier).name
        'multiplier, constraints at knots'
    """

    formulation: Formulation
    closure: LoopClosure = field(default_factory=KnotConstraints)

    @property
    def name(self) -> str:
        kind = "multiplier" if isinstance(self.formulation, Multiplier) else "explicit"
        return f"{kind}, {self.closure.name}"

    def equations(self, system: ScaledMechanism) -> Equations:
        """Its equations for any scaled mechanism."""
        if isinstance(self.formulation, Multiplier):
            return multiplier_equations(system, self.closure)
        return explicit_equations(system, self.closure)


@dataclass(frozen=True)
class Forward(ProblemFormulation):
    """The formulation in the platform's coordinates with polynomial torques as controls.

    Collocation demands that the accelerations are those of forward dynamics at the nodes.
    """

    name: str = "forward"

    def equations(self, system: ScaledMechanism) -> Equations:
        """Its equations for any scaled mechanism."""
        return forward_equations(system)


@lru_cache(maxsize=16)
def _equations(
    formulation: ProblemFormulation, functions: Functions, constraints: Constraints
) -> Equations:
    return formulation.equations(scaled_delta(functions, constraints))
