"""The fastest motion on a path that accelerates as long as it can, and then brakes: two arcs of the
largest and the least s̈ that the torques allow, integrated to 12 digits, and the switch between
them by Newton's method. Written with the general dynamics of the Delta, not the rows of planning.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.dynamics.precise_integrator import PreciseIntegrator
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import as_delta
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath, given_points

Array = NDArray[np.float64]
_NEWTON = 12


def two_arcs(scene: Scene, guess: float) -> float:
    """The duration, s, on a straight line; ``guess``: of the duration."""
    task, model = scene.task, DeltaModel(as_delta(scene.robot), scene.payload)
    assert isinstance(task, OnPath)
    length = float(task.path.knots[-1])
    forward, backward = (_arc(scene, model, sign) for sign in (1, -1))
    times = np.array([guess / 2, guess / 2])
    for _ in range(_NEWTON):
        ends = _ends(forward, backward, length, times)
        step = 1e-6 * guess
        slopes = [
            (
                _ends(forward, backward, length, times + step * e)
                - _ends(forward, backward, length, times - step * e)
            )
            / (2 * step)
            for e in np.eye(2)
        ]
        change = np.linalg.solve(np.array(slopes).T, -ends)
        times = times + change
        if np.abs(change).max() < 1e-13:
            break
    return float(times.sum())


def _ends(
    forward: PreciseIntegrator, backward: PreciseIntegrator, length: float, times: Array
) -> Array:
    """Differences of s and ṡ where both arcs meet."""
    first = forward(np.zeros(2), times[:1])
    last = backward(np.array([length, 0.0]), times[1:])
    return np.asarray(first - last)


def _arc(scene: Scene, model: DeltaModel, sign: int) -> PreciseIntegrator:
    """(s, ṡ) after a time (its parameter) of the largest s̈, or of the least one backwards."""
    functions, p = model.functions, ca.DM(model.parameters)
    start, goal = np.array(given_points(scene.task))
    way = goal - start
    direction = way / np.linalg.norm(way)
    u, state, T = ca.MX.sym("u"), ca.MX.sym("state", 2), ca.MX.sym("T")
    s, rate = state[0], state[1]
    x, v = ca.DM(start) + s * ca.DM(direction), rate * ca.DM(direction)
    still, _ = functions.inverse_dynamics(x, v, ca.DM.zeros(3), p)
    moved, _ = functions.inverse_dynamics(x, v, ca.DM(direction), p)
    upper = limits_of(scene).upper("torque")
    assert upper is not None
    limit = ca.DM(upper.tolist())
    alpha = moved - still
    reach = (sign * ca.sign(alpha) * limit - still) / alpha
    best = ca.mmin(reach) if sign > 0 else ca.mmax(reach)
    return PreciseIntegrator(u, state, sign * ca.vertcat(rate, best), T, T)
