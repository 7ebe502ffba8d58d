"""Kinds of attempts: limits and terms of one's own, added as docs/dev/limits.md says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from typing import Any, ClassVar

import casadi as ca
import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.mechanism import Effort, Mechanism
from deltaopt.limits.limit import SX, Described, Instant, Limit, Numbers
from deltaopt.mechanisms.delta import functions, slender_bars
from deltaopt.mechanisms.delta.kinematics import inverse_kinematics
from deltaopt.mechanisms.delta.mechanism import DeltaParameters, delta
from deltaopt.scene.known_limits import LIMITS
from studies.attack.attempts import Attempt, Generator
from studies.attack.checks import Loads, loads, sampled
from studies.problems import ORSINO, PROBLEMS

_STRENGTH, _AT_REST, _WAY = 4e4, -0.138, 0.138
"""Of a spring at each arm: as a share of the platform's weight times half an arm; and rad. It helps
to speed up and to brake more than the motors do."""


class _OnTorque(Limit):
    """A second limit of each motor's torque; its bound is that of the attempt."""

    name, unit, subject, order, quantity = "own", "1", "motor", 2, "tau"
    bound: ClassVar[float] = 1.0

    def items(self, scene: Described) -> Sequence[Numbers]:
        return [(_OnTorque.bound,) * 3]

    def measured(self, on: Loads, x: Array) -> Array:
        """The same by the campaign's own formulas."""
        return on.tau


class _OnPower(_OnTorque):
    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.tau * motion.dtheta

    def measured(self, on: Loads, x: Array) -> Array:
        return np.asarray(on.tau * on.dtheta)


class _OnSum(_OnTorque):
    subject = "robot"

    def items(self, scene: Described) -> Sequence[Numbers]:
        return [(_OnTorque.bound,)]

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return ca.sum1(motion.tau)

    def measured(self, on: Loads, x: Array) -> Array:
        return np.asarray(on.tau.sum(axis=1))


class _OnPlace(_OnSum):
    order = 0
    slid_along = has_ridges = True

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.x[0] - 1.0

    def measured(self, on: Loads, x: Array) -> Array:
        return np.asarray(x[:, 0] - 1.0)


class _OfOrderThree(_OnPower):
    order = 3


class _OnSharedTorque(_OnTorque):
    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.tau + 0.1 * ca.sum1(motion.tau)

    def measured(self, on: Loads, x: Array) -> Array:
        return np.asarray(on.tau + 0.1 * on.tau.sum(axis=1, keepdims=True))


_LIMITS = {
    "torque": (_OnTorque(), 330.0),
    "power": (_OnPower(), 900.0),
    "sum": (_OnSum(), 600.0),
    "place": (_OnPlace(), 0.07),
    "shared": (_OnSharedTorque(), 300.0),
    "order 3": (_OfOrderThree(), 900.0),
}


def own_limits(rng: Generator) -> Attempt:
    """A limit of one's own with a payload range: what is verified keeps it with every payload."""
    name, share = str(rng.choice(list(_LIMITS))), float(rng.uniform(0.75, 1.0))
    heaviest, y = float(rng.uniform(0.5, 4.0)), float(rng.uniform(0.1, 0.25))

    def made() -> str:
        limit, bound = _LIMITS[name]
        _OnTorque.bound = bound * share
        for module in ("deltaopt.scene.known_limits", "deltaopt.verify.verification"):
            vars(import_module(module))["LIMITS"] = (*LIMITS, limit)
        robot = deltaopt.load_robot(PROBLEMS / "robots" / "rl5.yaml")
        ends: dict[str, Any] = {"start": (1.0, -y, 0.0), "goal": (1.0, y, 0.0)}
        scene = deltaopt.Scene(robot=robot, **ends | {"payload": (0.0, heaviest)})
        try:
            plan = deltaopt.plan(scene)
        except ValueError as error:  # of a limit that says what is not so
            return "" if str(error).startswith("the limit own says ") else f"ValueError: {error}"
        if not deltaopt.verify(scene, plan.trajectory).ok:
            return ""  # it is said: nothing wrong was promised
        _, x, v, a = sampled(plan.trajectory)
        for mass in (0.0, heaviest):
            most = float(np.abs(limit.measured(loads(robot, mass, x, v, a), x)).max())
            if most > _OnTorque.bound * (1 + 1e-6):
                return f"verified, with {most:.6g} of {_OnTorque.bound:.6g} at {mass:g} kg"
        return ""

    return Attempt(f"{name}, {share:.3f} of its bound, 0 to {heaviest:.3f} kg, y ± {y:.3f}", made)


def _spring(theta: SX, m1: Any, a2: Any, g: Any) -> Any:
    """Torque of a spring at an arm that is at rest in the middle of the attempt's motions, N·m, by
    parameters that the robot has, so that it has their units."""
    return m1 * g * a2 * _STRENGTH * _shape((theta - _AT_REST) / _WAY)


def _shape(s: Any) -> Any:
    """A torque over an angle, ∓0.8 at ±1, which is where motors hold it, and stronger between."""
    return -s * (3 - 2.2 * s**2)


def _with_springs(parameters: DeltaParameters) -> Mechanism:
    """A Delta with a spring at each arm."""
    plain = delta(parameters)
    p = dict(zip(parameters.named(), ca.vertsplit(plain.parameters), strict=True))
    springs = [_spring(plain.q[3 + 3 * k], p["m1"], p["a2"], p["g"]) for k in range(3)]
    each = zip(plain.efforts, springs, strict=True)
    return replace(plain, efforts=tuple(Effort(own.value + more, own.rate) for own, more in each))


_plain = slender_bars.angle_free_equations


def _sprung(p: DeltaParameters, x: SX, v: SX, a: SX, tau: SX) -> tuple[SX, SX, SX, SX]:
    """The equations of slender bars, with the same springs."""
    theta = inverse_kinematics(p, x)[3::3]
    return _plain(p, x, v, a, tau + _spring(theta, p.m1, p.a2, p.g))


def own_terms(rng: Generator) -> Attempt:
    """A robot with a term of one's own: no verified plan is shorter than its proven bound."""
    y, beyond = float(rng.uniform(0, 1e-3)), float(rng.uniform(2e-4, 8e-4))
    x, other = 0.4 - beyond, 0.46 + beyond

    def made() -> str:
        vars(functions)["delta"] = _with_springs
        vars(functions)["angle_free_equations"] = _sprung
        robot = deltaopt.load_robot(ORSINO).model_copy(update={"gravity": 0.01})
        scene = deltaopt.Scene(robot=robot, start=(x, -y, 0.0), goal=(other, y, 0.0))
        try:
            plan = deltaopt.plan(scene)
        except ValueError as error:  # of a limit that says what is not so
            return "" if str(error).startswith("the limit own says ") else f"ValueError: {error}"
        on = loads(robot, 0.0, *sampled(plan.trajectory)[1:])
        springs = 0.3 * 0.1 * 0.01 * _STRENGTH * _shape((on.theta - _AT_REST) / _WAY)
        most = float(np.abs(on.tau - springs).max())
        found = deltaopt.verify(scene, plan.trajectory)
        if not found.ok or most > 10.0 * (1 + 1e-6):
            return f"{most:.6g} N·m of 10: {found.failures()}"
        low = plan.lower_bound <= plan.duration
        return "" if low else f"{plan.duration:.6f} s, proven: {plan.lower_bound:.6f} s"

    return Attempt(f"springs, from {x:.5f} to {other:.5f} m, y ± {y:.5f} m", made)
