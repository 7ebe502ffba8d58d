"""The shortest motion of a linear Delta by means of its own: no line of the package is used.

Dynamics are written out by hand: slender bars are particles α ṡ² + 2 β ṡ ẋ + α ẋ², α = m/3 and β =
m/6, and each pair pushes along itself. The acceleration is linear in equal intervals and may jump
between them; forces, speeds, positions and distances are kept at four points of each. Ipopt.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AZIMUTHS = (0.0, 2 * pi / 3, -2 * pi / 3)
POINTS = (0.0, 1 / 3, 2 / 3, 1.0)


@dataclass(frozen=True)
class Numbers:
    """Lengths in m, masses in kg: ``width`` is the guides' radius less the pins', ``moved`` the
    mass of platform and payload. ``force``, ``speed``, ``range``: of the carriages, N, m/s, m."""

    width: float
    bar: float
    moved: float
    carriage: float
    bars: float
    force: float
    speed: float
    range: tuple[float, float]
    g: float = 9.81


def carriages(n: Numbers, x: ca.SX, v: ca.SX, a: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Positions, speeds and forces of the carriages, 3 each, for a motion of the platform."""
    bars, s, ds, dds = [], [], [], []
    for azimuth in AZIMUTHS:
        y, z = x[1] - n.width * cos(azimuth), x[2] - n.width * sin(azimuth)
        height = ca.sqrt(n.bar**2 - y**2 - z**2)
        along = ca.vertcat(height, y, z)
        speed = ca.dot(along, v) / height
        turning = v - ca.vertcat(speed, 0, 0)
        bars.append(along)
        s.append(x[0] - height)
        ds.append(speed)
        dds.append((ca.dot(along, a) + ca.dot(turning, turning)) / height)
    s, ds, dds = (ca.vertcat(*each) for each in (s, ds, dds))
    down = n.bars / 6 * ca.sum1(dds) - n.g * (n.moved + 1.5 * n.bars)
    pushes = ca.solve(ca.horzcat(*bars), (n.moved + n.bars) * a + ca.vertcat(down, 0, 0))
    heights = ca.vertcat(*(along[0] for along in bars))
    own = (n.carriage + n.bars / 3) * dds - n.g * (n.carriage + n.bars / 2)
    return s, ds, own + n.bars / 6 * a[0] + pushes * heights


def shortest(
    n: Numbers, guess: Array, duration: float, sphere: tuple[tuple[float, float, float], float]
) -> float:
    """The duration of a locally shortest motion from rest to rest that passes below a sphere, given
    by centre and radius, m, and stays out of it.

    ``guess``: places, (3, intervals + 1), m, from the start to the goal, and a ``duration``, s.
    """
    intervals = guess.shape[1] - 1
    problem = ca.Opti()
    T = problem.variable()
    x, v = problem.variable(3, intervals + 1), problem.variable(3, intervals + 1)
    a = problem.variable(3, 2 * intervals)  # at both ends of each interval
    h, centre = T / intervals, ca.DM(sphere[0])
    state = [ca.SX.sym(name, 3) for name in ("x", "v", "a")]
    loads = ca.Function("loads", state, list(carriages(n, *state)))
    for i in range(intervals):
        first, last = a[:, 2 * i], a[:, 2 * i + 1]
        for u in POINTS:
            there = first + u * (last - first)
            rate = v[:, i] + h * u * (first + u / 2 * (last - first))
            place = x[:, i] + h * u * v[:, i] + (h * u) ** 2 * (first / 2 + u / 6 * (last - first))
            s, ds, force = loads(place, rate, there)
            problem.subject_to(problem.bounded(n.range[0], s, n.range[1]))
            problem.subject_to(problem.bounded(-n.speed, ds, n.speed))
            problem.subject_to(problem.bounded(-1, force / n.force, 1))
            problem.subject_to(ca.sumsqr(place - centre) / sphere[1] ** 2 >= 1)
        problem.subject_to(x[:, i + 1] == place)
        problem.subject_to(v[:, i + 1] == rate)
    problem.subject_to(x[:, 0] == guess[:, 0])
    problem.subject_to(x[:, -1] == guess[:, -1])
    problem.subject_to(x[0, intervals // 2] >= centre[0] + 0.9 * sphere[1])
    problem.subject_to(v[:, 0] == 0)
    problem.subject_to(v[:, -1] == 0)
    problem.set_initial(x, guess)
    problem.set_initial(v, np.gradient(guess, duration / intervals, axis=1))
    problem.subject_to(problem.bounded(-0.2, x[1:, :], 0.2))  # within reach
    problem.set_initial(T, duration)
    problem.subject_to(T >= 0.01)
    problem.minimize(T)
    near = {"print_level": 0, "sb": "yes", "mu_init": 1e-3, "bound_push": 1e-6, "bound_frac": 1e-6}
    options = {"print_time": False, "expand": True, "show_eval_warnings": False}
    problem.solver("ipopt", options, near)
    return float(problem.solve().value(T))
