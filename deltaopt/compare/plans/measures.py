"""How good a planned motion is, measured on what the program itself reports.

E_K and E_D (Bordalba et al. 2023) are of the polynomials q(t) and τ(t) as the program has
them, its torques between the points being the polynomial through them. The arrival error is
where these torques lead through forward dynamics with multipliers (model L_I), integrated to
twelve digits. The safe duration is that of the path of ξ.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite

import casadi as ca
import numpy as np

from deltaopt.compare.plans.cases import Case, motion_inside
from deltaopt.curves.nodes import lagrange
from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.precise_integrator import PreciseIntegrator
from deltaopt.planning.formulations.collocation import CollocationProblem
from deltaopt.planning.formulations.scaled_mechanism import ScaledMechanism
from deltaopt.planning.mesh.error_estimate import FRACTIONS


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


def quality(case: Case, problem: CollocationProblem, z: Array) -> Quality:
    """The measures of a solution of a case."""
    system, planned = case.system, problem.unpack(z, case.task)
    xi = independent(case, problem, planned)
    torques = problem.torques(z, case.task)
    motion: tuple[Array, ...] = motion_inside(planned)
    if len(problem.equations.coordinates) != system.n:
        motion = system.rows(system.motion, *motion, p=case.task.p)
    by_node: Array = np.stack([each.coef for each in lagrange(problem.variables.points)])
    powers = by_node.T @ torques  # (N, powers, motors)
    inside = np.vander(FRACTIONS, powers.shape[1], increasing=True) @ powers
    tau = inside.reshape(-1, system.motors)
    f, error = system.rows(_errors(system), *motion, tau, p=case.task.p)
    starts = np.linalg.norm(f, axis=1).reshape(-1, len(FRACTIONS))[:, 0]
    duration = float(planned.knots[-1])
    distance, speed = _arrival(case, xi, powers)
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
    case: Case, problem: CollocationProblem, planned: PiecewisePolynomial
) -> PiecewisePolynomial:
    """Return the path of ξ."""
    which = [problem.equations.coordinates.index(i) for i in case.system.independent]
    return PiecewisePolynomial(planned.knots, planned.coefficients[:, :, which])


def _errors(system: ScaledMechanism) -> ca.Function:
    """(q, q̇, q̈, τ, p) -> (f, J q̇), q̈ - q̈(q, q̇, τ)."""
    m = system.mechanism
    modelled, _ = Explicit().forward_dynamics(m).expand()(0, m.q, m.dq, m.controls, m.parameters)
    return ca.Function(
        "errors",
        [m.q, m.dq, m.ddq, m.controls, system.p],
        [ca.vertcat(m.holonomic, m.constraint_rate), m.ddq - modelled],
    )


def _arrival(case: Case, xi: PiecewisePolynomial, torques: Array) -> tuple[float, float]:
    """Distance to the goal and speed there under the program's torques, by their coefficients, (N,
    powers, motors)."""
    task, nu = case.task, len(case.system.independent)
    step = integrator(case.system, torques.shape[1])
    state = np.concatenate([task.start, np.zeros(nu)])
    for length, coefficients in zip(np.diff(xi.knots), torques, strict=True):
        state = step(state, np.concatenate([coefficients.ravel(), [length], task.p]))
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


def _mean(knots: Array, rows: Array) -> float:
    """(1/T) ∫ ‖row‖ dt by trapezoids between FRACTIONS."""
    sizes = np.linalg.norm(rows, axis=1).reshape(-1, len(FRACTIONS))
    mean = float(np.trapezoid(sizes, FRACTIONS, axis=1) @ np.diff(knots) / knots[-1])
    return mean if isfinite(mean) else inf
