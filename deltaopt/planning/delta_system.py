"""The Delta as a system, and the poses of its planner beside the flat one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.dynamics.mechanism import SX
from deltaopt.mechanisms.delta_functions import DeltaFunctions
from deltaopt.model import DeltaModel
from deltaopt.planning.chain import (
    ChainProblem,
    Equations,
    explicit_equations,
    flat_equations,
    forward_equations,
    multiplier_equations,
)
from deltaopt.planning.closure import KnotConstraints, LoopClosure
from deltaopt.planning.nlp import Program, Solution
from deltaopt.planning.scales import Scales
from deltaopt.planning.system import RestToRest, System, Units
from deltaopt.planning.transcription import PiecewiseAcceleration
from deltaopt.trajectory import PiecewisePolynomial, Trajectory

Array = NDArray[np.float64]


def delta_system(functions: DeltaFunctions, *, speed: bool) -> System:
    """The Delta, ξ the platform's position, with units from ``Scales.vector``.

    Lengths are measured by the distance D from start to goal; angles by D / (2 a₂), what an
    arm turns when its elbow moves so far; energies by the largest torque through that angle.
    """
    m = functions.mechanism
    scales = SX.sym("scales", 11 if speed else 8)
    D, time, torque = scales[3], scales[4], scales[5:8]
    named = dict(zip(functions.parameters.present(), ca.vertsplit(m.parameters), strict=True))
    angle = D / (2 * named["a2"])
    units = Units(
        q=ca.vertcat(*3 * [D], *9 * [angle]),
        closure=ca.vertcat(*9 * [D]),
        time=time,
        energy=ca.mmax(torque) * angle,
        torque=torque,
        speed=scales[8:11] if speed else None,
    )
    return System(m, (0, 1, 2), functions.inverse_kinematics, scales, units)


def rest_to_rest(scales: Scales) -> RestToRest:
    """A scene's task in the order of ``delta_system``'s parameters."""
    scene = scales.scene
    model = DeltaModel(scene.robot, scene.payload)
    p = np.concatenate([scales.vector(), model.parameters])
    return RestToRest(p, np.array(scene.start), np.array(scene.goal))


@dataclass(frozen=True)
class Redundant:
    """Twelve coordinates as polynomials under loop closure, by a formulation of the dynamics.

    ``Multiplier``: eq. (37). Any other: eq. (39), for virtual work and Kane's method end in
    the same three equations as the explicit form.
    """

    formulation: Formulation
    closure: LoopClosure = field(default_factory=KnotConstraints)

    @property
    def name(self) -> str:
        kind = "multiplier" if isinstance(self.formulation, Multiplier) else "explicit"
        return f"{kind}, {self.closure.name}"

    def of(
        self, functions: DeltaFunctions, transcription: PiecewiseAcceleration, *, speed: bool
    ) -> DeltaPosed:
        return DeltaPosed(self.equations(delta_system(functions, speed=speed)), transcription)

    def equations(self, system: System) -> Equations:
        if isinstance(self.formulation, Multiplier):
            return multiplier_equations(system, self.closure)
        return explicit_equations(system, self.closure)


@dataclass(frozen=True)
class Forward:
    """Minimal coordinates with the torque as control, forward dynamics as the defect."""

    name: str = "forward"

    def of(
        self, functions: DeltaFunctions, transcription: PiecewiseAcceleration, *, speed: bool
    ) -> DeltaPosed:
        return DeltaPosed(self.equations(delta_system(functions, speed=speed)), transcription)

    def equations(self, system: System) -> Equations:
        return forward_equations(system)


@dataclass(frozen=True)
class DeltaPosed:
    """A chain's equations for the Delta, to be put on a mesh."""

    equations: Equations
    transcription: PiecewiseAcceleration

    def on(self, mesh: Array) -> DeltaProblem:
        return DeltaProblem(self.equations.on(mesh, self.transcription))


@dataclass(frozen=True)
class DeltaProblem:
    """A chain's problem in the terms of a scene."""

    chain: ChainProblem

    @property
    def mesh(self) -> Array:
        return self.chain.mesh

    @property
    def program(self) -> Program:
        return self.chain.program

    def pack(self, trajectory: Trajectory, scales: Scales) -> Array:
        task = rest_to_rest(scales)
        self.chain.equations.system.require_independent_constraints(task)
        return self.chain.pack(trajectory.position, task)

    def unpack(self, z: Array, scales: Scales) -> PiecewisePolynomial:
        q = self.chain.unpack(z, rest_to_rest(scales))
        return PiecewisePolynomial(q.knots, q.coefficients[:, :, :3])

    def coordinates(self, z: Array, scales: Scales) -> PiecewisePolynomial | None:
        """All twelve, where they drift; else they follow from the platform's path."""
        closure = self.chain.equations.closure
        if closure is None or not closure.drifts:
            return None
        return self.chain.unpack(z, rest_to_rest(scales))

    def bounds(self, scales: Scales) -> tuple[Array, Array]:
        return self.chain.bounds(rest_to_rest(scales))

    def prices(self, solution: Solution) -> Array:
        return self.chain.prices(solution)
