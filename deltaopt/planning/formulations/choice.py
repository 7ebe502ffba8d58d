"""Formulations of the problem as values: what a user chooses between."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

from deltaopt.dynamics.formulation import Projected
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.planning.formulations.collocation import Equations
from deltaopt.planning.formulations.delta import DeltaEquations, scaled_delta
from deltaopt.planning.formulations.equations import (
    explicit_equations,
    forward_equations,
    multiplier_equations,
)
from deltaopt.planning.formulations.loop_closure import KnotConstraints, LoopClosure
from deltaopt.planning.formulations.scaled_mechanism import ScaledMechanism
from deltaopt.planning.nlp.cost import FASTEST, Cost
from deltaopt.planning.nlp.problem import (
    InteriorPoint,
    Ipopt,
    ProblemFormulation,
    Solver,
)
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration

_IPOPT = Ipopt()


@dataclass(frozen=True)
class Redundant:
    """Twelve coordinates as polynomials under loop closure, by a formulation of the dynamics.

    ``Multiplier``: eq. (37). Any other: eq. (39), for virtual work and Kane's method end in
    the same three equations as the explicit form.
    """

    formulation: Multiplier | Projected
    closure: LoopClosure = field(default_factory=KnotConstraints)

    @property
    def name(self) -> str:
        kind = "multiplier" if isinstance(self.formulation, Multiplier) else "explicit"
        return f"{kind}, {self.closure.name}"

    @property
    def solvers(self) -> tuple[type[Ipopt] | type[InteriorPoint], ...]:
        """Only the general one."""
        return (Ipopt,)

    def of(
        self,
        functions: DeltaFunctions,
        transcription: PiecewiseAcceleration,
        constraints: Constraints,
        cost: Cost = FASTEST,
        solver: Solver = _IPOPT,
    ) -> DeltaEquations:
        """Its equations for the Delta under limits."""
        return DeltaEquations(_equations(self, functions, constraints), transcription, cost)

    def equations(self, system: ScaledMechanism) -> Equations:
        if isinstance(self.formulation, Multiplier):
            return multiplier_equations(system, self.closure)
        return explicit_equations(system, self.closure)


@dataclass(frozen=True)
class Forward:
    """Minimal coordinates with the torque as control, forward dynamics as the defect."""

    name: str = "forward"

    @property
    def solvers(self) -> tuple[type[Ipopt] | type[InteriorPoint], ...]:
        """Only the general one."""
        return (Ipopt,)

    def of(
        self,
        functions: DeltaFunctions,
        transcription: PiecewiseAcceleration,
        constraints: Constraints,
        cost: Cost = FASTEST,
        solver: Solver = _IPOPT,
    ) -> DeltaEquations:
        """Its equations for the Delta under limits."""
        return DeltaEquations(_equations(self, functions, constraints), transcription, cost)

    def equations(self, system: ScaledMechanism) -> Equations:
        return forward_equations(system)


@lru_cache(maxsize=16)
def _equations(
    formulation: Redundant | Forward, functions: DeltaFunctions, constraints: Constraints
) -> Equations:
    return formulation.equations(scaled_delta(functions, constraints))


def problem_formulation(
    formulation: ProblemFormulation | Multiplier | Projected,
) -> ProblemFormulation:
    """A formulation of the problem as it is; one of the dynamics in redundant coordinates."""
    if isinstance(formulation, Multiplier | Projected):
        return Redundant(formulation)
    return formulation
