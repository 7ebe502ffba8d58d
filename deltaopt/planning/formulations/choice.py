"""Poses as values: what a user chooses between."""

from __future__ import annotations

from dataclasses import dataclass, field

from deltaopt.dynamics.formulation import Projected
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.planning.formulations.collocation import Equations
from deltaopt.planning.formulations.delta import DeltaPosed, delta_system
from deltaopt.planning.formulations.equations import (
    explicit_equations,
    forward_equations,
    multiplier_equations,
)
from deltaopt.planning.formulations.loop_closure import KnotConstraints, LoopClosure
from deltaopt.planning.formulations.scaled_mechanism import System
from deltaopt.planning.nlp.cost import FASTEST, Cost
from deltaopt.planning.nlp.problem import Pose
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration


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

    def of(
        self,
        functions: DeltaFunctions,
        transcription: PiecewiseAcceleration,
        *,
        speed: bool,
        cost: Cost = FASTEST,
    ) -> DeltaPosed:
        equations = self.equations(delta_system(functions, speed=speed))
        return DeltaPosed(equations, transcription, cost)

    def equations(self, system: System) -> Equations:
        if isinstance(self.formulation, Multiplier):
            return multiplier_equations(system, self.closure)
        return explicit_equations(system, self.closure)


@dataclass(frozen=True)
class Forward:
    """Minimal coordinates with the torque as control, forward dynamics as the defect."""

    name: str = "forward"

    def of(
        self,
        functions: DeltaFunctions,
        transcription: PiecewiseAcceleration,
        *,
        speed: bool,
        cost: Cost = FASTEST,
    ) -> DeltaPosed:
        equations = self.equations(delta_system(functions, speed=speed))
        return DeltaPosed(equations, transcription, cost)

    def equations(self, system: System) -> Equations:
        return forward_equations(system)


def posed_as(formulation: Pose | Multiplier | Projected) -> Pose:
    """A pose as it is; a formulation of the dynamics in redundant coordinates."""
    if isinstance(formulation, Multiplier | Projected):
        return Redundant(formulation)
    return formulation
