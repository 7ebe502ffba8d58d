"""Where the platform ends up when the motors apply the reported torques.

The torques, as functions of time, drive forward dynamics with multipliers (model L_I, eq. 37),
and CVODES integrates it to 12 digits. The torques come from the explicit model L_E (eq. 39); the
two share the mechanism's kinematics, masses and forces, not the way the constraints are eliminated.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.mechanisms.delta.functions import DeltaFunctions
from deltaopt.motion.trajectory import Array, Trajectory
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.scene import Scene

_CVODES: dict[str, Any] = {
    "reltol": 1e-12,
    "abstol": 1e-13,  # m and m/s: far below the 1e-5 m that is asked
    "linear_multistep_method": "adams",  # the motion is smooth and not stiff
    "nonlinear_solver_iteration": "functional",
    "max_num_steps": 20_000,  # an interval takes about 20
    "disable_internal_warnings": True,
}


class NotIntegrated(Exception):
    """The motion under the reported torques could not be followed to the end."""


def arrival(scene: Scene, trajectory: Trajectory) -> tuple[float, float]:
    """Distance to the goal (m) and to its velocity (m/s) at the end, from the scene's start.

    Raises NotIntegrated where CVODES fails, as on leaving the workspace.
    """
    model = DeltaModel(scene.robot, scene.payload, Multiplier())
    position = trajectory.position
    step = _step(model.functions, trajectory.model.functions, position.coefficients.shape[1])
    p = np.concatenate([model.parameters, trajectory.model.parameters])
    start, goal = scene.task.start, scene.task.goal
    state = np.concatenate([start.position, start.velocity])
    lengths = np.diff(position.knots)
    for begin, length, coefficients in zip(
        position.knots, lengths, position.coefficients, strict=False
    ):
        state = _integrated(step, state, np.concatenate([coefficients.ravel(), [length], p]))
        if not np.isfinite(state).all():
            raise NotIntegrated(f"CVODES failed after t = {begin:.6g} s")
    away, too_fast = state[:3] - goal.position, state[3:] - goal.velocity
    return float(np.linalg.norm(away)), float(np.linalg.norm(too_fast))


@lru_cache(maxsize=16)
def _step(model: DeltaFunctions, reported: DeltaFunctions, powers: int) -> ca.Function:
    """Integrator of the state (x, v) through one interval, built once for all robots alike.

    Its parameters: coefficients of the reported position (powers × 3), length of the
    interval (s), parameters of both models.
    """
    u, state = ca.MX.sym("u"), ca.MX.sym("state", 6)  # u: fraction of the interval
    coefficients, length = ca.MX.sym("coefficients", 3, powers), ca.MX.sym("length")
    p = ca.MX.sym("p", len(model.terms.names))
    p_reported = ca.MX.sym("p_reported", len(reported.terms.names))
    tau = _reported_torque(reported, powers)(u * length, coefficients, p_reported)
    a = model.forward_dynamics(state[:3], state[3:], tau, p)
    problem = {
        "t": u,
        "x": state,
        "p": ca.vertcat(ca.vec(coefficients), length, p, p_reported),
        "ode": length * ca.vertcat(state[3:], a),
    }
    return ca.integrator("arrival", "cvodes", problem, 0, 1, _CVODES)


def _reported_torque(model: DeltaFunctions, powers: int) -> ca.Function:
    """(time since the interval began, coefficients 3 × powers, p) -> τ (3)."""
    t, coefficients = ca.MX.sym("t"), ca.MX.sym("coefficients", 3, powers)
    p = ca.MX.sym("p", len(model.terms.names))
    x = ca.MX.zeros(3)
    for power in reversed(range(powers)):  # Horner
        x = x * t + coefficients[:, power]
    v = ca.jacobian(x, t)
    tau, _ = model.inverse_dynamics(x, v, ca.jacobian(v, t), p)
    return ca.Function("reported_torque", [t, coefficients, p], [tau])


def _integrated(step: ca.Function, state: Array, parameters: Array) -> Array:
    """The state at the end of an interval; not a number where CVODES fails."""
    try:
        return np.asarray(step(x0=state, p=parameters)["xf"].full()).ravel()
    except RuntimeError:  # CasADi's only word for it
        return np.full(6, np.nan)
