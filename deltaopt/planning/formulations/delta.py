"""The Delta in the collocation problem: its scaled mechanism, and scenes as boundary values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.dynamics.mechanism import SX
from deltaopt.errors import NotConverged
from deltaopt.limits.constraints import Constraints
from deltaopt.limits.limit import Instant
from deltaopt.mechanisms.functions import Functions
from deltaopt.mechanisms.instant import CoordinateInstant, PlatformInstant
from deltaopt.planning.formulations.collocation import FAR, NEAR, CollocationProblem
from deltaopt.planning.formulations.scaled_mechanism import (
    BoundaryValues,
    LimitRows,
    ScaledMechanism,
    ScaledUnits,
)
from deltaopt.planning.nlp.problem import IPOPT_FINEST, Guess, Solved
from deltaopt.planning.nlp.scaling import Parameters, Scaling


def scaled_delta(functions: Functions, constraints: Constraints) -> ScaledMechanism:
    """The Delta as a scaled mechanism; its independent coordinates ξ are the platform's position.

    The unit of length is the distance from start to goal, of angle what an arm turns when its elbow
    moves by that distance, of energy the work of the largest torque through that angle.
    """
    m = functions.mechanism
    parameters = Parameters.symbols(constraints, functions, m.parameters)
    length, torque = parameters.length, parameters.torque
    angle = length / functions.lever(m.parameters)
    units = ScaledUnits(
        q=ca.vertcat(*(length if is_length else angle for is_length in functions.lengths)),
        closure=ca.vertcat(*m.holonomic.numel() * [length]),
        time=parameters.time,
        energy=ca.mmax(torque) * angle,
        torque=torque,
        motors=parameters.motors,
    )
    x = [SX.sym(name, 3) for name in ("x", "v", "a", "tau")]
    force = functions.explicit_equations(*x, m.parameters)[0]
    explicit = ca.Function("explicit", [*x, m.parameters], [force])
    limits = _limit_rows(functions, constraints, parameters)
    return ScaledMechanism(
        m, (0, 1, 2), functions.inverse_kinematics, parameters.scaling, units, limits, explicit
    )


def _limit_rows(
    functions: Functions, constraints: Constraints, parameters: Parameters
) -> LimitRows:
    """The rows of a scene's limits as functions of the twelve coordinates."""

    def rows(name: str, size: int, at: Callable[[SX, SX, SX, SX], Instant]) -> ca.Function:
        motion, tau = [SX.sym(each, size) for each in ("q", "dq", "ddq")], SX.sym("tau", 3)
        found = constraints.rows(at(motion[0], motion[1], motion[2], tau), parameters.limits)
        found[np.flatnonzero(constraints.is_control).tolist()] = tau / parameters.torque
        return ca.Function(name, [*motion, tau, parameters.vector], [found])

    p = parameters.mechanism

    def of_platform(x: SX, v: SX, a: SX, tau: SX) -> Instant:
        return PlatformInstant(functions, x, v, a, p, tau)

    def of_all(q: SX, dq: SX, ddq: SX, tau: SX) -> Instant:
        return CoordinateInstant(functions, q, dq, ddq, tau, p, functions.explicit_torques)

    return LimitRows(
        rows("limits", len(functions.lengths), of_all),
        constraints.orders,
        constraints.sides,
        constraints.is_control,
        rows("limits_of_platform", 3, of_platform),
    )


def boundary_values(scaling: Scaling) -> BoundaryValues:
    """The boundary values of a scene."""
    start, goal = scaling.problem.start, scaling.problem.goal
    return BoundaryValues(
        scaling.parameters,
        np.array(start.position),
        np.array(goal.position),
        rates=np.array([start.velocity, goal.velocity]),
        drift=np.array(goal.belt),
        free=np.array(goal.free),
    )


@dataclass(frozen=True)
class DeltaProblem:
    """A collocation problem that is solved for scenes."""

    collocation: CollocationProblem
    finest: ClassVar[int] = IPOPT_FINEST
    takes_phases: ClassVar[bool] = False

    @property
    def mesh(self) -> Array:
        return self.collocation.mesh

    @property
    def points(self) -> Array:
        return self.collocation.transcription.points

    def solve(self, guess: Guess, scaling: Scaling) -> Solved:
        """Find the best motion on this mesh by Ipopt.

        The solution has all twelve coordinates if the loops may drift; otherwise they close at the
        knots and the platform's position determines the motion. Raises NotConverged.
        """
        if scaling.gates:
            raise NotConverged(
                "motions in phases are planned by the interior-point method alone, which is not "
                "compiled",
                "No_Progress",
                guess.trajectory,
            )
        ends, collocation = boundary_values(scaling), self.collocation
        z = collocation.pack(guess.trajectory.position, ends)
        # Long waits of least effort move too far from their guess for the options of a near one.
        options = NEAR if guess.near and not collocation.cost.running else FAR
        program = collocation.program(options, ends)
        N = len(self.mesh)
        bounds = collocation.bounds(ends, scaling.shares(N))
        row_shares = collocation.row_shares(program, lambda at: scaling.shares_at(N, at))
        found = program.solve(z, *bounds, ends.p, row_shares)
        q, closure = collocation.unpack(found.z, ends), collocation.equations.closure
        multipliers = collocation.multipliers(found)
        return Solved(
            PiecewisePolynomial(q.knots, q.coefficients[:, :, :3]),
            multipliers,
            found.status,
            found.iterations,
            all_at_points=multipliers.shape[1] == len(self.points),
            coordinates=q if closure is not None and closure.drifts else None,
        )
