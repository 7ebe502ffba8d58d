"""Motions of least time under limits of torque rate or jerk, by Ipopt in another transcription.

Position, velocity and acceleration at the ends of many equal intervals are states, jerks that are
constant in each are controls. Torques follow by the Principle of Virtual Work, and their rates
are those between two instants. Boxes are kept clear of at four instants of an interval. It shares
no mesh, no equations of motion, no derivative of torques, no distances and no solver with the
planner.
"""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np

from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import delta_model
from deltaopt.robot.tool import Box
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from tests.oracles.motor_loads import asked_of_motors
from tests.oracles.sparse_program import QUIET

OPTIONS = QUIET | {
    "ipopt.tol": 1e-9,
}
OF_A_SOLUTION = {
    "ipopt.tol": 1e-7,
    "ipopt.mu_init": 1e-5,
    "ipopt.bound_push": 1e-5,
    "ipopt.bound_frac": 1e-5,
}
"""What lets Ipopt begin with a motion that is nearly the fastest, and not leave it first; durations
are 1e-5 longer than with a hundredth of the tolerance."""
OUTSIDE = 4
"""Instants of an interval at which boxes are kept clear of."""


def fastest_with_rates(
    scene: Scene, intervals: int, guess: float, first: Trajectory | None = None
) -> float:
    """The duration, s, from rest to rest, and through the scene's via points with as many equal
    intervals before as after each; ``guess``: of it. Limits of torque, speed, torque rate and jerk
    count, and boxes with a tool that has a radius. ``first``: what Ipopt begins with; the straight
    line unless given, which must be clear of boxes."""
    limits = limits_of(scene)
    rest = [np.array(point) for point in (scene.start, *(scene.via or ()), scene.goal)]
    legs, n = len(rest) - 1, intervals
    asked = asked_of_motors(delta_model(scene.robot, scene.payload))
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
        for share in np.arange(OUTSIDE) / OUTSIDE if scene.keep_out else ():
            t = share * h
            between = x[:, left] + t * v[:, left] + t**2 / 2 * a[:, left] + t**3 / 6 * J
            limit(squares_of_clearances(scene, between), 1, np.inf)
    for k, point in enumerate(rest):
        limit(x[:, k * n] - point, 0, 0)
    for end in (0, legs * n):
        limit(v[:, end], 0, 0)
        limit(a[:, end], 0, 0)

    if first is None:
        share = np.linspace(0, 1, n + 1)[:-1, None]
        smooth = share if legs > 1 else share**3 * (10 - 15 * share + 6 * share**2)
        way = np.vstack([b + smooth * (e - b) for b, e in pairwise(rest)] + [rest[-1]])
        rate = np.gradient(way, guess / (legs * n), axis=0)
        bend, jerk = np.zeros_like(way), np.zeros_like(way[1:])
    else:
        there = first(np.linspace(*first.knots[[0, -1]], legs * n + 1))
        way, rate, bend = there.x, there.v, there.a
        jerk = np.diff(bend, axis=0) * legs * n / guess
    parts = [np.full(legs, guess / legs), *(each.ravel() for each in (way, rate, bend, jerk))]
    problem = {"x": ca.veccat(T, x, v, a, j), "f": ca.sum1(T), "g": ca.veccat(*g)}
    solver = ca.nlpsol("oracle", "ipopt", problem, OPTIONS | (OF_A_SOLUTION if first else {}))
    least = np.full(problem["x"].numel(), -np.inf)
    least[:legs] = 0.05 * guess / legs
    found = solver(
        x0=np.concatenate(parts), lbx=least, lbg=np.concatenate(lower), ubg=np.concatenate(upper)
    )
    assert solver.stats()["success"], solver.stats()["return_status"]
    return float(found["f"])


def squares_of_clearances(scene: Scene, x: ca.MX) -> ca.MX:
    """Squared distances of places (3, N) from each box over that which tool and clearance ask for,
    (boxes, N). Their first derivatives are continuous, and zero inside of a box."""
    tool = scene.robot.tool
    assert tool is not None
    assert tool.shapes is None
    away = tool.radius + (scene.clearance or 0.0)
    rows = []
    for body in scene.keep_out or ():
        assert isinstance(body.shape, Box)
        centre, half = np.array(body.shape.centre), np.array(body.shape.half)
        beyond = ca.fmax(0, ca.fmax(x - centre - half, centre - half - x))
        rows.append(ca.sum1(beyond**2) / away**2)
    return ca.vertcat(*rows)
