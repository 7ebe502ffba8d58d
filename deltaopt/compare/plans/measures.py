"""How good a planned motion is, measured on what the program itself reports.

E_K and E_D (Bordalba et al. 2023) are of the polynomials q(t) and τ(t) as the program has
them, its torques between the points being the polynomial through them. The arrival error is
where these torques lead through forward dynamics with multipliers (model L_I), integrated to
twelve digits. The safe duration is that of the path of ξ.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import inf, isfinite

import casadi as ca
import numpy as np

from deltaopt.compare.plans.cases import FRACTIONS, Case, motion_inside
from deltaopt.curves.nodes import lagrange
from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.precise_integrator import PreciseIntegrator
from deltaopt.planning.formulations.collocation import CollocationProblem
from deltaopt.planning.formulations.scaled_mechanism import ScaledMechanism


@dataclass(frozen=True)
class Quality:
    """Measures of a planned motion. ``duration``, ``safe_duration``: s. ``kinematic_error``: E_K, m
    and m/s. ``at_knots``: the largest ‖f‖, ‖J q̇‖ at the beginning of an interval.
    ``dynamic_error``: E_D, m/s², rad/s². ``arrival_distance``, ``arrival_speed``: m, m/s. Infinite:
    could not be had."""

    duration: float = inf
    safe_duration: float = inf
    kinematic_error: float = inf
    at_knots: float = inf
    dynamic_error: float = inf
    arrival_distance: float = inf
    arrival_speed: float = inf


@dataclass(frozen=True)
class Meter:
    """Measures the motions of one case."""

    case: Case

    def quality(self, problem: CollocationProblem, z: Array) -> Quality:
        case, system = self.case, self.case.system
        planned = problem.unpack(z, case.task)
        xi = self.independent(problem, planned)
        torques = problem.torques(z, case.task)
        q, dq, ddq = self._coordinates(problem, planned)
        tau = _between(problem.variables.points, torques, FRACTIONS).reshape(-1, system.motors)
        f, error = system.rows(self._errors, q, dq, ddq, tau, p=case.task.p)
        starts = np.linalg.norm(f, axis=1).reshape(-1, len(FRACTIONS))[:, 0]
        duration = float(planned.knots[-1])
        distance, speed = self._arrival(xi, problem, torques)
        return Quality(
            duration,
            duration * case.safe_factor(xi),
            _mean(planned.knots, f),
            float(starts.max()),
            _mean(planned.knots, error),
            distance,
            speed,
        )

    def independent(
        self, problem: CollocationProblem, planned: PiecewisePolynomial
    ) -> PiecewisePolynomial:
        """Return the path of ξ."""
        which = [problem.equations.coordinates.index(i) for i in self.case.system.independent]
        return PiecewisePolynomial(planned.knots, planned.coefficients[:, :, which])

    def _coordinates(
        self, problem: CollocationProblem, planned: PiecewisePolynomial
    ) -> tuple[Array, ...]:
        """q, q̇, q̈ inside the intervals, as the program has them."""
        motion = motion_inside(planned, FRACTIONS)
        if len(problem.equations.coordinates) == self.case.system.n:
            return motion
        return self.case.system.rows(self.case.system.motion, *motion, p=self.case.task.p)

    @cached_property
    def _errors(self) -> ca.Function:
        """(q, q̇, q̈, τ, p) -> (f, J q̇), q̈ - q̈(q, q̇, τ)."""
        system, m = self.case.system, self.case.system.mechanism
        modelled, _ = (
            Explicit().forward_dynamics(m).expand()(0, m.q, m.dq, m.controls, m.parameters)
        )
        return ca.Function(
            "errors",
            [m.q, m.dq, m.ddq, m.controls, system.p],
            [ca.vertcat(m.holonomic, m.constraint_rate), m.ddq - modelled],
        )

    def _arrival(
        self, xi: PiecewisePolynomial, problem: CollocationProblem, torques: Array
    ) -> tuple[float, float]:
        """Distance to the goal and speed there under the program's torques."""
        task, nu = self.case.task, len(self.case.system.independent)
        step = integrator(self.case.system, len(problem.variables.points))
        powers = _powers(problem.variables.points)
        state = np.concatenate([task.start, np.zeros(nu)])
        for length, values in zip(np.diff(xi.knots), torques, strict=True):
            p = np.concatenate([(powers.T @ values).ravel(), [length], task.p])
            state = step(state, p)
            if not np.isfinite(state).all():
                return inf, inf
        distance = float(np.linalg.norm(state[:nu] - task.goal))
        return distance, float(np.linalg.norm(state[nu:]))


def integrator(system: ScaledMechanism, points: int) -> PreciseIntegrator:
    """Return the integrator through one interval under a polynomial torque: state (ξ, ξ̇);
    parameters: coefficients (powers × motors), length (s), p."""
    nu, m = len(system.independent), system.mechanism
    u, state, length = ca.MX.sym("u"), ca.MX.sym("state", 2 * nu), ca.MX.sym("length")
    coefficients = ca.MX.sym("coefficients", system.motors, points)
    p = ca.MX.sym("p", system.p.numel())
    tau = ca.MX.zeros(system.motors)
    for power in reversed(range(points)):
        tau = tau * u + coefficients[:, power]
    q, dq, _ = system.motion(state[:nu], state[nu:], ca.MX.zeros(nu), p)
    ddq, _ = Multiplier().forward_dynamics(m)(0, q, dq, tau, p[system.scales.numel() :])
    rate = ca.vertcat(state[nu:], ddq[list(system.independent)])
    return PreciseIntegrator(u, state, rate, length, ca.vertcat(ca.vec(coefficients), length, p))


def _between(nodes: Array, values: Array, c: Array) -> Array:
    """Polynomials through values (N, nodes, m), at fractions c: (N, len(c), m)."""
    return np.asarray(np.vander(c, len(nodes), increasing=True) @ (_powers(nodes).T @ values))


def _powers(nodes: Array) -> Array:
    """Coefficients of Lagrange's polynomials, (node, power)."""
    return np.stack([each.coef for each in lagrange(nodes)])


def _mean(knots: Array, rows: Array) -> float:
    """(1/T) ∫ ‖row‖ dt by trapezoids between FRACTIONS."""
    sizes = np.linalg.norm(rows, axis=1).reshape(-1, len(FRACTIONS))
    mean = float(np.trapezoid(sizes, FRACTIONS, axis=1) @ np.diff(knots) / knots[-1])
    return mean if isfinite(mean) else inf
