"""The fastest motion on a path as a nonlinear program for Ipopt, with the torques of the model.

On a given path there is one coordinate left: with b = ṡ² the torques are affine in b and b′, speeds
are bounds of b, and the duration ∫ ds / √b is convex (Verscheure et al. 2009). On a uniform grid
in s, u is constant in a cell, and the limits hold at both of its ends.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.path import Path
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath

Array = NDArray[np.float64]


def duration_by_ipopt(scene: Scene, cells: int) -> float:
    """The shortest duration on the scene's path from rest to rest, s."""
    task, model = scene.task, delta_model(scene.robot, scene.payload)
    assert isinstance(task, OnPath)
    path, s = task.path, np.linspace(*task.path.knots[[0, -1]], cells + 1)
    g, by_u, by_b = torque_coefficients(model, path, s)
    torque = limits_of(scene).upper("torque")
    assert torque is not None
    opti, most = ca.Opti(), _fastest(scene, model, path, s)
    scale = float(np.sum(torque) / np.abs(by_u).max())
    b = scale * opti.variable(cells + 1)
    h = float(s[1] - s[0])
    u = (b[1:] - b[:-1]) / (2 * h)
    for first in (0, 1):
        rows = slice(first, cells + first)
        for k in range(3):
            tau = by_u[rows, k] * u + by_b[rows, k] * b[rows] + g[rows, k]
            opti.subject_to(opti.bounded(-1, tau / torque[k], 1))
    opti.subject_to(opti.bounded(1e-9, b[1:-1] / scale, most[1:-1] / scale))
    opti.subject_to(b[0] == 0)
    opti.subject_to(b[-1] == 0)
    roots = ca.sqrt(b[1:-1])
    T = 2 * h * (1 / roots[0] + 1 / roots[-1] + ca.sum1(1 / (roots[1:] + roots[:-1])))
    opti.minimize(T)
    share = (s - s[0]) / (s[-1] - s[0])
    opti.set_initial(opti.x, np.maximum(0.1 * share * (1 - share), 1e-6))
    opti.solver("ipopt", {"print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"})
    return float(opti.solve().value(T))


def torque_coefficients(model: DeltaModel, path: Path, s: Array) -> tuple[Array, Array, Array]:
    """Torques at rest, and their slopes by u and by b, (N, 3) each, at parameters s."""
    x, dx, ddx = (path(s, order) for order in range(3))
    rest = np.zeros_like(x)
    g = model.inverse_dynamics(x, rest, rest)
    return (
        g,
        model.inverse_dynamics(x, rest, dx) - g,
        model.inverse_dynamics(x, dx, ddx) - g,
    )


def _fastest(scene: Scene, model: DeltaModel, path: Path, s: Array) -> Array:
    """The largest ṡ² that the speed limits of the motors allow at each point."""
    limits = limits_of(scene).upper("speed")
    if limits is None:
        return np.full(len(s), 1e12)
    rates = model.motion(path(s), path(s, 1), np.zeros((len(s), 3)))[1][:, 3::3]
    return np.asarray(((limits / np.maximum(np.abs(rates), 1e-9)) ** 2).min(axis=1))
