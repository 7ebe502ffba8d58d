"""The measure of every limit against a formula written out by hand, in numpy alone."""

from __future__ import annotations

from math import factorial
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from deltaopt import load_robot
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.mechanisms.delta.functions import delta_functions
from deltaopt.mechanisms.instant import CoordinateInstant, PlatformInstant
from deltaopt.robot.model import delta_model
from deltaopt.robot.robot import Robot
from deltaopt.scene.known_limits import LIMITS
from deltaopt.scene.scene import Scene
from tests import paper_delta

_STEP = 2e-3
_PLACES = _STEP * np.arange(-4, 5)
_STENCILS = np.linalg.inv(np.vander(_PLACES, increasing=True))
"""Weights of nine neighbours in value, first derivative, half the second ... of a function."""


class Motion:
    """A polynomial path about an instant, and what follows from it by closed-form kinematics and
    differences of eighth order."""

    def __init__(self, model, rng):
        self.p = model.numbers
        self.powers = rng.normal(size=(4, 3)) * np.array([[0.06], [1.5], [20.0], [100.0]])
        middle = 0.45 if self.p.a3 < 0.3 else 0.75
        self.powers[0] += [middle, 0, 0]
        self.x, self.v, self.a, self.j = (self.powers[k] * factorial(k) for k in range(4))
        points = np.vander(_PLACES, 4, increasing=True) @ self.powers
        along = np.array([paper_delta.inverse_kinematics(self.p, x) for x in points])
        self.curve = [np.polynomial.Polynomial(each) for each in (_STENCILS @ along).T]
        self.q, self.dq, self.ddq, self.dddq = (self.at(0.0, order) for order in range(4))

    def at(self, t, order):
        """A derivative of all coordinates at a time, s."""
        return np.array([each.deriv(order)(t) if order else each(t) for each in self.curve])

    @property
    def tau(self):
        return self.torques(0.0)

    @property
    def dtau(self):
        """By the differences of four neighbours."""
        h = _STEP / 2
        weights = np.array([1.0, -8.0, 8.0, -1.0]) / (12 * h)
        return weights @ np.array([self.torques(k * h) for k in (-2, -1, 1, 2)])

    def torques(self, t):
        """From eq. (39), Cᵀ (Q* + Q) = 0, with the paper's letters: linear in τ."""
        p, (q, dq, ddq) = self.p, (self.at(t, order) for order in range(3))
        inertia = paper_delta.gyroscopic_force(p, q, dq)
        inertia = inertia - paper_delta.inertia_matrix(p, q) @ ddq
        C = paper_delta.constraint_matrix(p, q)
        without = C.T @ (inertia + paper_delta.active_force(p, q, np.zeros(3)))
        by_torque = C[3::3].T
        return np.linalg.solve(by_torque, -without)


GRAVITY = np.array([9.81, 0.0, 0.0])
SLOPE = 7.5
"""Of the torque curve below, N·m·s/rad: (10 - 4) / (2.0 - 1.2)."""

FORMULAS = {
    "torque": lambda motion: motion.tau,
    "speed": lambda motion: motion.dq[3::3],
    "distance to the serial singularity": lambda motion: (
        np.sin(motion.q[3::3] - motion.q[4::3]) ** 2
    ),
    "platform speed": lambda motion: [np.sqrt(motion.v @ motion.v)],
    "acceleration": lambda motion: [np.sqrt(motion.a @ motion.a)],
    "specific force": lambda motion: [np.sqrt((motion.a - GRAVITY) @ (motion.a - GRAVITY))],
    "torque rate": lambda motion: motion.dtau,
    "jerk": lambda motion: [np.sqrt(motion.j @ motion.j)],
    "joint jerk": lambda motion: motion.dddq[3::3],
    "torque at speed": lambda motion: motion.tau + SLOPE * motion.dq[3::3],
    "arm angle": lambda motion: motion.q[3::3],
    "ball joint angle": lambda motion: motion.q[5::3],
    "workspace depth": lambda motion: motion.x[:1],
    "workspace radius": lambda motion: [np.hypot(motion.x[1], motion.x[2])],
}
"""By the name of the limit, in its unit: torques in N·m, rates of the arms in rad/s, sin²."""

KEYS = {
    "joints": {"arm": [-1.2, 1.5], "ball": 0.9},
    "workspace": {"depth": [0.1, 1.1], "radius": 0.6},
}
ALL = {"speed": 1.5, "platform_speed": 2.0, "acceleration": 50.0, "specific_force": 60.0}
ALL |= {"torque_rate": 1e3, "jerk": 1e3, "joint_jerk": 1e4}


def limited(name: str) -> Robot:
    """A shipped robot with every key that limits it."""
    content = load_robot(f"problems/robots/{name}.yaml").model_dump(exclude_none=True)
    content["drive"] |= {"torque": 10.0, "torque_curve": [[0.0, 10.0], [1.2, 10.0], [2.0, 4.0]]}
    return Robot.model_validate(content | KEYS)


BY_FORMULA = [limit for limit in LIMITS if limit.name in FORMULAS]


def test_every_limit_is_held_against_a_formula():
    """Here, or in a file of its own."""
    assert len(BY_FORMULA) == len(FORMULAS)
    for limit in set(LIMITS) - set(BY_FORMULA):
        file = type(limit).__module__.split(".")[-1]
        assert Path(__file__).with_name(f"test_{file}.py").exists(), limit.name


def test_differences_are_exact_enough():
    """Of t⁵ and its derivatives at 0, and of a sine."""
    np.testing.assert_allclose(_STENCILS @ _PLACES**5, [0] * 5 + [1] + [0] * 3, atol=1e-4)
    np.testing.assert_allclose((_STENCILS @ np.sin(40 * _PLACES))[1], 40, rtol=1e-9)


@pytest.mark.parametrize("limit", BY_FORMULA, ids=lambda limit: limit.name)
@pytest.mark.parametrize("name", ["orsino", "industrial"])
@pytest.mark.parametrize("payload", [None, 1.0])
def test_measure_is_its_formula(limit, name, payload):
    """By the platform's equations and by those of twelve coordinates."""
    model = delta_model(limited(name), payload)
    rng = np.random.default_rng(5)
    motions = [Motion(model, rng) for _ in range(5)]
    start, goal = (tuple(motion.x.tolist()) for motion in motions[:2])
    scene = Scene(robot=model.robot, payload=payload, start=start, goal=goal, limits=ALL)
    x, v, a, j = (ca.SX.sym(letter, 3) for letter in "xvaj")
    p = model.functions.terms.symbols().vector()
    functions = delta_functions(model.functions.terms, Explicit())
    assert limit.items(scene)
    rough = 100 if limit.order == 3 else 1  # differences of differences
    for numbers in limit.items(scene):
        for instant in (
            PlatformInstant(functions, x, v, a, p, jerk=j),
            CoordinateInstant.general(functions, x, v, a, p, j),
        ):
            measure = limit.measure(instant, ca.SX(ca.DM(list(numbers))))
            f = ca.Function("measure", [x, v, a, j, p], [measure])
            for motion in motions:
                at = (motion.x, motion.v, motion.a, motion.j, model.parameters)
                found, expected = f(*at).full().ravel(), np.array(FORMULAS[limit.name](motion))
                size = 2e-7 * rough * max(1.0, float(np.abs(expected).max()))
                np.testing.assert_allclose(found, expected, rtol=2e-7 * rough, atol=size)


@pytest.mark.parametrize("limit", BY_FORMULA, ids=lambda limit: limit.name)
def test_rows_reach_their_bounds_where_measures_do(limit):
    """Rows may be other functions of the motion, such as squares: they are inside ±1, at it and
    outside of it with the measure."""
    model = delta_model(limited("orsino"), None)
    motion = Motion(model, np.random.default_rng(6))
    goal = (0.5, 0.0, 0.0)
    scene = Scene(robot=model.robot, start=tuple(motion.x.tolist()), goal=goal, limits=ALL)
    x, v, a, j = (ca.SX.sym(letter, 3) for letter in "xvaj")
    p = model.functions.terms.symbols().vector()
    functions = delta_functions(model.functions.terms, Explicit())
    instant = PlatformInstant(functions, x, v, a, p, jerk=j)
    for numbers in limit.items(scene):
        symbols = ca.SX.sym("numbers", len(numbers))
        bounds = limit.bounds(symbols)
        sides = [side for side in (bounds.lower, bounds.upper) if side is not None]
        results = [limit.measure(instant, symbols), limit.rows(instant, symbols), *sides]
        f = ca.Function("limit", [x, v, a, j, p, symbols], results)
        motions = [motion.x, motion.v, motion.a, motion.j, model.parameters]
        measure, rows, *found = (np.array(each).ravel() for each in f(*motions, numbers))
        if bounds.lower is not None:
            assert (np.sign(measure - found[0]) == np.sign(rows + 1)).all()
        if bounds.upper is not None:
            assert (np.sign(measure - found[-1]) == np.sign(rows - 1)).all()
