"""The Delta as a system: a scene's task and its units in the terms of a chain."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.dynamics.mechanism import SX
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.motion.trajectory import PiecewisePolynomial
from deltaopt.planning.formulations.collocation import FAR, NEAR, ChainProblem, Equations
from deltaopt.planning.formulations.scaled_mechanism import RestToRest, System, Units
from deltaopt.planning.nlp.cost import Cost
from deltaopt.planning.nlp.problem import IPOPT_FINEST, Guess, Solved
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration

Array = NDArray[np.float64]


def delta_system(functions: DeltaFunctions, *, speed: bool) -> System:
    """The Delta, ξ the platform's position, with units from ``Scales.vector``.

    Lengths are measured by the distance D from start to goal; angles by D / (2 a₂), what an
    arm turns when its elbow moves so far; energies by the largest torque through that angle.
    """
    m = functions.mechanism
    scales = SX.sym("scales", 12 if speed else 9)
    D, time, torque = scales[3], scales[4], scales[5:8]
    named = dict(zip(functions.terms.names, ca.vertsplit(m.parameters), strict=True))
    angle = D / (2 * named["a2"])
    units = Units(
        q=ca.vertcat(*3 * [D], *9 * [angle]),
        closure=ca.vertcat(*9 * [D]),
        time=time,
        energy=ca.mmax(torque) * angle,
        torque=torque,
        speed=scales[9:12] if speed else None,
    )
    openings = ca.sin(m.q[3::3] - m.q[4::3]) ** 2 - scales[8]
    x = [SX.sym(name, 3) for name in ("x", "v", "a", "tau")]
    force = functions.explicit_equations(*x, m.parameters)[0]
    explicit = ca.Function("explicit", [*x, m.parameters], [force])
    return System(m, (0, 1, 2), functions.inverse_kinematics, scales, units, openings, explicit)


def rest_to_rest(scales: Scales, parameters: Array) -> RestToRest:
    """A scene's task; ``parameters``: the mechanism's."""
    scene = scales.scene
    p = np.concatenate([scales.vector(), parameters])
    return RestToRest(p, np.array(scene.start), np.array(scene.goal))


@dataclass(frozen=True)
class DeltaPosed:
    """A chain's equations for the Delta, to be put on a mesh."""

    equations: Equations
    transcription: PiecewiseAcceleration
    cost: Cost

    def on(self, mesh: Array) -> DeltaProblem:
        return DeltaProblem(self.equations.on(mesh, self.transcription, self.cost))


@dataclass(frozen=True)
class DeltaProblem:
    """A chain's problem in the terms of a scene."""

    chain: ChainProblem

    @property
    def mesh(self) -> Array:
        return self.chain.mesh

    @property
    def points(self) -> Array:
        return self.chain.transcription.points

    @property
    def finest(self) -> int:
        return IPOPT_FINEST

    def solve(self, guess: Guess, scales: Scales, parameters: Array) -> Solved:
        """By Ipopt. All twelve coordinates are told where they drift; otherwise the loops close
        at the knots and the motion is reported as that of the platform."""
        task, chain = rest_to_rest(scales, parameters), self.chain
        z = chain.pack(guess.trajectory.position, task)
        program = chain.program_with(NEAR if guess.near else FAR)
        found = program.solve(z, *chain.bounds(task, scales.torque_share), task.p)
        q, closure = chain.unpack(found.z, task), chain.equations.closure
        return Solved(
            PiecewisePolynomial(q.knots, q.coefficients[:, :, :3]),
            chain.prices(found),
            found.status,
            found.iterations,
            found.spent,
            q if closure is not None and closure.drifts else None,
        )
