"""Limits that the package does not know: planned, verified at both ends of a payload range, or
refused; and verification of what nothing measures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
import pytest

import deltaopt.scene.known_limits as known
from deltaopt import DeltaModel, Scene, SceneError, load_robot, plan, verify
from deltaopt.limits.constraints import MIXED, Constraints
from deltaopt.limits.joints import TORQUE_LIMIT
from deltaopt.limits.limit import Bounds, Limit
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.flat.constraint_rows import can_be_held
from deltaopt.scene.known_limits import limits_of

RL5 = load_robot("problems/robots/rl5.yaml")
HEAVY = RL5.drive.model_copy(update={"inertia": 5.0})
POWER, DIFFERENCE = 25.0, 30.0
"""W, and N·m. On the path below a plan for the largest payload alone asks for 11.5 % more power
when the robot is empty."""


class Added(Limit):
    """A limit of 3 numbers, none of which a scene gives."""

    unit, subject, order = "1", "motor", 2

    def items(self, scene):
        return [(1.0, POWER, DIFFERENCE)]

    def bounds(self, numbers):
        return Bounds.symmetric(numbers[0])


class MotorPower(Added):
    name, unit = "motor power", "W"

    def bounds(self, numbers):
        return Bounds.symmetric(numbers[1])

    def measure(self, motion, numbers):
        return motion.tau * motion.dtheta


class TorqueDifference(Added):
    name, unit, subject = "torque difference", "N·m", "robot"

    def bounds(self, numbers):
        return Bounds.symmetric(numbers[2])

    def measure(self, motion, numbers):
        return motion.tau[0] - motion.tau[1]


class SizeOfDifference(TorqueDifference):
    """The same with a kink, and with an upper bound alone."""

    name = "size of the torque difference"

    def bounds(self, numbers):
        return Bounds.at_most(numbers[2])

    def measure(self, motion, numbers):
        return ca.fabs(motion.tau[0] - motion.tau[1])


class LeastTorque(Added):
    """|τ| from below, which is kept at two masses and not between, where τ changes its sign."""

    name = "least torque"

    def bounds(self, numbers):
        return Bounds.at_least(numbers[0], 1.0)

    def measure(self, motion, numbers):
        return motion.tau**2


class Jerk(Added):
    name, order = "jerk", 3

    def measure(self, motion, numbers):
        return 3 * motion.x[0]


class Continuous(Added):
    """Like the torque limit itself: a share of each motor's torque."""

    name = "continuous torque"

    def measure(self, motion, numbers):
        return motion.tau


def with_limits(monkeypatch, *limits: Limit):
    monkeypatch.setattr(known, "LIMITS", (*known.LIMITS, *limits))


def scene(name: str, **others: Any) -> Scene:
    """``name``: of the robot, so that no cache takes it for one of another test."""
    robot = RL5.model_copy(update={"name": name, "drive": HEAVY})
    return Scene(
        **{
            "robot": robot,
            "payload": (0.0, 4.0),
            "start": (0.8, -0.1, 0.0),
            "goal": (1.0, 0.1, 0.0),
            "limits": {"torque": 60.0},
            **others,
        }
    )


def sizes(given: Scene, motion: Trajectory, payload: float) -> tuple[float, float]:
    """The largest power, W, and difference, N·m, with a payload, on a dense sampling."""
    at, model = (
        motion.inside_intervals(np.linspace(0, 1, 60)),
        DeltaModel(given.robot, payload or None),
    )
    tau = model.inverse_dynamics(at.x, at.v, at.a)
    rates = model.motion(at.x, at.v, at.a)[1][:, 3::3]
    return float(np.abs(tau * rates).max()), float(np.abs(tau[:, 0] - tau[:, 1]).max())


WAYS = {
    "on a path": {"path": "line", "start": (0.8, -0.02, 0.0), "goal": (1.0, 0.02, 0.0)},
    "past a body": {"keep_out": [{"sphere": {"centre": [0.9, 0.0, 0.0], "radius": 0.03}}]},
}


@pytest.mark.parametrize("way", WAYS)
def test_kept_with_every_payload(monkeypatch, way):
    with_limits(monkeypatch, MotorPower(), TorqueDifference())
    given = scene(way, **WAYS[way])
    found = plan(given, tolerance=1e-2)
    assert verify(given, found.trajectory).failures() == []
    found_sizes = [sizes(given, found.trajectory, mass) for mass in (0.0, 1.0, 2.0, 3.0, 4.0)]
    most = np.max(found_sizes, axis=0) / [POWER, DIFFERENCE]
    assert (most <= 1 + 1e-9).all()
    assert most.max() > 0.99


def test_verified_at_both_ends(monkeypatch):
    """The excess of the least payload is found by the model with that payload, whichever mass asks
    for more."""
    with_limits(monkeypatch, MotorPower(), TorqueDifference())
    given = scene("both ends")
    motion = baseline(given).slowed(0.8)
    found = verify(given, motion)
    for mass, suffix in ((0.0, "_with_the_least_payload"), (4.0, "")):
        power, difference = sizes(given, motion, mass)
        of_power = getattr(found, f"motor_power{suffix}_excess")
        of_difference = getattr(found, f"torque_difference{suffix}_excess")
        assert of_power == pytest.approx(power / POWER - 1, abs=1e-3)
        assert of_difference == pytest.approx(difference / DIFFERENCE - 1, abs=1e-3)
    assert not found.ok


@pytest.mark.parametrize("limit", [SizeOfDifference(), LeastTorque()], ids=lambda each: each.name)
def test_a_range_is_refused_where_masses_between_may_exceed(monkeypatch, limit):
    with_limits(monkeypatch, limit)
    with pytest.raises(SceneError, match=f"one mass, since the limit {limit.name} may be exceeded"):
        plan(scene(f"refused for {limit.name}"))
    assert limits_of(scene(f"one mass for {limit.name}", payload=4.0)).constraints.number


def test_a_curved_lower_bound_is_refused_on_a_path(monkeypatch):
    with_limits(monkeypatch, LeastTorque())
    with pytest.raises(SceneError, match="bounds least torque of motor 1 from below"):
        plan(scene("curved", payload=4.0, path="line"))


def test_an_unknown_order_is_refused(monkeypatch):
    of_jerk = Constraints(((TORQUE_LIMIT, 3), (Jerk(), 3)))
    assert not can_be_held(of_jerk)
    with_limits(monkeypatch, Jerk())
    with pytest.raises(ValueError, match=r"the limit jerk says order 3; .* it is 0"):
        limits_of(scene("jerk", payload=4.0))


def test_the_unit_of_torque_is_that_of_one_limit():
    two = Constraints(((TORQUE_LIMIT, 3), (Continuous(), 3)))
    assert two.is_control.tolist() == [True] * 3 + [False] * 3
    assert can_be_held(Constraints(((TORQUE_LIMIT, 3),)))
    assert not can_be_held(two)


def test_what_a_limit_does_not_declare_is_no_power_of_the_speed():
    kinked = Constraints(((SizeOfDifference(), 3),))
    assert kinked.slowing_exponents.tolist() == [MIXED]
    assert not kinked.are_polynomials


# What is promised and not measured


@dataclass(frozen=True)
class _Case:
    keys: dict[str, Any]
    measure: str


PROMISES = {
    "rotation": _Case(
        {"rotation": {"angle": 1.0, "speed": 9.0, "acceleration": 90.0}}, "rotation_left"
    ),
    "path": _Case({"path": "line"}, "path_distance"),
    "via": _Case({"via": [[0.9, 0.0, 0.0]]}, "via_distance"),
    "duration": _Case({"objective": "effort", "duration": 2.0}, "duration_error"),
}


@pytest.mark.parametrize("key", PROMISES)
def test_a_measure_that_is_missing_is_told(key):
    case = PROMISES[key]
    given = scene("promises", payload=4.0, **case.keys)
    found = verify(given, baseline(scene("promises", payload=4.0)).slowed(1.5))
    missing = f"nothing measures its {case.measure.replace('_', ' ')}"
    assert missing not in found.failures()
    assert missing in replace(found, **{case.measure: None}).failures()


@pytest.mark.parametrize(
    "others",
    [
        {"keep_out": [{"sphere": {"centre": [0.5, 0.3, 0.0], "radius": 0.01}}]},
        {"path": "line", "tube": 0.01},
        {"limits": {"speed": 9.0}},
    ],
    ids=["bodies", "tube", "limit"],
)
def test_a_limit_without_excess_is_told(others):
    given = scene("unmeasured", payload=4.0, **others)
    found = verify(given, baseline(scene("unmeasured", payload=4.0)).slowed(1.5))
    assert found.ok
    for name in found.excesses:
        left = {key: value for key, value in found.excesses.items() if key != name}
        assert not replace(found, excesses=left).ok


def test_a_key_of_a_scene_that_nothing_measures():
    class Warm(Scene):
        temperature: float | None = None

    content = scene("warm", payload=4.0).model_dump(exclude_none=True)
    usual, warm = (Warm(**content, **more) for more in ({}, {"temperature": 30.0}))
    motion = baseline(usual).slowed(1.5)
    assert verify(usual, motion).ok
    assert verify(warm, motion).failures() == ["nothing measures its key temperature"]
