"""Motions of least time under limits of torque rate or jerk, by Ipopt in another transcription.

Position, velocity and acceleration at the ends of many equal intervals are states, jerks that are
constant in each are controls. Torques follow by eq. (37), with multipliers, and their rates are
those between two instants. It shares no mesh, no derivative of torques and no solver with the
planner.
"""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np

from deltaopt.robot.model import delta_model
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene

OPTIONS = {
    "print_time": False,
    "show_eval_warnings": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-9,
    "ipopt.max_iter": 500,
}


def fastest_with_rates(scene: Scene, intervals: int, guess: float) -> float:
    """The duration, s, from rest to rest, and through the scene's via points with as many equal
    intervals before as after each; ``guess``: of it. Limits of torque, speed, torque rate and jerk
    count."""
    limits = limits_of(scene)
    rest = [np.array(point) for point in (scene.start, *(scene.via or ()), scene.goal)]
    legs, n = len(rest) - 1, intervals
    model = delta_model(scene.robot, scene.payload).with_multipliers()
    x_, v_, a_ = (ca.MX.sym(name, 3) for name in "xva")
    dtheta = model.functions.velocity(x_, v_, model.parameters)[1][model.functions.motors]
    torque = model.functions.inverse_dynamics(x_, v_, a_, model.parameters)[0]
    asked = ca.Function("asked", [x_, v_, a_], [torque, dtheta])
    T, lower, upper, g = ca.MX.sym("T", legs), [], [], []
    x, v, a = (ca.MX.sym(name, 3, legs * n + 1) for name in "xva")
    j = ca.MX.sym("j", 3, legs * n)

    def limit(row: ca.MX, low: float, high: float) -> None:
        g.append(row)
        lower.append(np.full(row.numel(), low))
        upper.append(np.full(row.numel(), high))

    tau, rates = asked.map(legs * n + 1)(x, v, a)
    limit(tau / limits.upper("torque"), -1, 1)
    fastest = limits.upper("speed")
    if fastest is not None:
        limit(rates / fastest, -1, 1)
    for leg in range(legs):
        h = T[leg] / n
        own, left, right = (slice(leg * n + k, (leg + 1) * n + k) for k in (0, 0, 1))
        J = j[:, own]
        limit(
            x[:, right] - x[:, left] - h * v[:, left] - h**2 / 2 * a[:, left] - h**3 / 6 * J, 0, 0
        )
        limit(v[:, right] - v[:, left] - h * a[:, left] - h**2 / 2 * J, 0, 0)
        limit(a[:, right] - a[:, left] - h * J, 0, 0)
        most = limits.upper("torque rate")
        if most is not None:
            limit((tau[:, right] - tau[:, left]) / h / most, -1, 1)
        most = limits.upper("jerk")
        if most is not None:
            limit(ca.sum1(J**2) / most[0] ** 2, -np.inf, 1)
    for k, point in enumerate(rest):
        limit(x[:, k * n] - point, 0, 0)
    for end in (0, legs * n):
        limit(v[:, end], 0, 0)
        limit(a[:, end], 0, 0)

    share = np.linspace(0, 1, n + 1)[:-1, None]
    smooth = share if legs > 1 else share**3 * (10 - 15 * share + 6 * share**2)
    way = np.vstack([b + smooth * (e - b) for b, e in pairwise(rest)] + [rest[-1]])
    rate = np.gradient(way, guess / (legs * n), axis=0)
    zero = np.zeros(3 * legs * n)
    parts = [np.full(legs, guess / legs), way.ravel(), rate.ravel(), zero, np.zeros(3), zero]
    problem = {"x": ca.veccat(T, x, v, a, j), "f": ca.sum1(T), "g": ca.veccat(*g)}
    solver = ca.nlpsol("oracle", "ipopt", problem, OPTIONS)
    least = np.full(problem["x"].numel(), -np.inf)
    least[:legs] = 0.05 * guess / legs
    found = solver(
        x0=np.concatenate(parts), lbx=least, lbg=np.concatenate(lower), ubg=np.concatenate(upper)
    )
    assert solver.stats()["success"], solver.stats()["return_status"]
    return float(found["f"])
