"""Robots and motions of every size: the same plan, the same verdict, the same relative figures."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cache

import numpy as np
import pytest
from pydantic import BaseModel

from deltaopt import Robot, Scene, baseline, plan, verify
from deltaopt.mechanisms.delta.arm_loads import FRICTION
from deltaopt.mechanisms.delta.mechanism import DeltaParameters
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.energies import DIMENSIONS
from deltaopt.robot.model import delta_model
from deltaopt.verify.verification import Verification

SCALES = [
    (1e-9, 1, 1),
    (1e-3, 1, 1),
    (1e3, 1, 1),
    (1, 1e-9, 1),
    (1, 1e9, 1),
    (1, 1, 1e-3),
    (1, 1, 1e9),
    (1e-9, 1e-9, 1e-9),
    (1e9, 1e-9, 1e3),
    (1e9, 1, 1e9),
]
"""Of length, mass and time; of torque by length² mass / time²."""


ROBOT = Robot(
    name="scaled",
    base_radius=0.2,
    platform_radius=0.1,
    upper_arm={"length": 0.2, "mass": 0.4},
    forearm={"length": 0.5, "mass": 0.25},
    platform={"mass": 0.3},
    drive={"torque": 10.0, "speed": 15.0},
)


def scaled(length: float, mass: float, time: float) -> Scene:
    """The robot of the paper with 1 kg and a move of 150 mm, in other units: with numbers that no
    file may give."""
    arm, forearm = ROBOT.upper_arm, ROBOT.forearm
    torque = 10 * mass * length**2 / time**2
    robot = unchecked(
        ROBOT,
        base_radius=0.2 * length,
        platform_radius=0.1 * length,
        upper_arm=unchecked(arm, length=0.2 * length, mass=0.4 * mass),
        forearm=unchecked(forearm, length=0.5 * length, mass=0.25 * mass),
        platform=unchecked(ROBOT.platform, mass=0.3 * mass),
        drive=unchecked(ROBOT.drive, torque=torque, speed=15 / time),
        gravity=9.81 * length / time**2,
    )
    return unchecked(
        Scene(robot=ROBOT, payload=1.0, start=(0.45, -0.05, 0.0), goal=(0.45, 0.1, 0.0)),
        robot=robot,
        payload=1.0 * mass,
        start=(0.45 * length, -0.05 * length, 0.0),
        goal=(0.45 * length, 0.1 * length, 0.0),
    )


def unchecked(record, **update):
    """A copy of a record with values that are not looked at."""
    return BaseModel.model_copy(record.model_copy(), update=update)


@cache
def planned(scene: Scene) -> Trajectory:
    return plan(scene).trajectory


@cache
def verified(scene: Scene) -> Verification:
    return verify(scene, planned(scene))


def shares(found: Verification) -> dict[str, float]:
    """Every measure that is judged, as a share of its bound."""
    return {check.measure: check.value / check.at_most for check in found.checks()}


USUAL = scaled(1, 1, 1)


def test_every_parameter_has_a_dimension():
    assert set(DIMENSIONS) == {each.name for each in fields(DeltaParameters)} - {"loads"}
    assert all(set(load.dimensions) == set(load.names()) for load in FRICTION)


@pytest.mark.parametrize("scale", SCALES, ids=str)
def test_a_plan_in_other_units(scale):
    scene, time = scaled(*scale), scale[2]
    usual, motion = planned(USUAL), planned(scene)
    assert baseline(scene).duration == pytest.approx(baseline(USUAL).duration * time, rel=1e-9)
    assert motion.duration == pytest.approx(usual.duration * time, rel=1e-9)
    expected, found = verified(USUAL), verified(scene)
    assert found.failures() == []
    assert found.ok
    for name, share in shares(found).items():
        assert share == pytest.approx(shares(expected)[name], abs=2e-5, rel=1e-6)  # both rounding
    assert found.torque_excess == pytest.approx(expected.torque_excess, abs=1e-12)
    assert found.amplification == pytest.approx(expected.amplification, rel=1e-6)
    for one, other in zip(found.distances, expected.distances, strict=True):
        assert one.least == pytest.approx(other.least, rel=1e-9)


@pytest.mark.parametrize("scale", [(1, 1, 1), (1e-9, 1, 1), (1e9, 1e-9, 1e3)], ids=str)
def test_a_slow_motion_in_other_units(scale):
    """Followed in pieces; a payload of a thousandth more shows in each."""
    scene = scaled(*scale)
    slow = planned(scene).slowed(60.0)
    found = verify(scene, slow)
    assert found.ok
    assert not found.judges_arrival
    heavier = replace(slow, model=delta_model(scene.robot, 1.001 * scale[1]))
    wrong = verify(scene, heavier)
    assert not wrong.ok
    usual = verify(USUAL, replace(planned(USUAL).slowed(60.0), model=heavier_of(USUAL)))
    for name, share in shares(wrong).items():
        if share > 1:
            assert share == pytest.approx(shares(usual)[name], rel=1e-5)


def heavier_of(scene: Scene):
    return delta_model(scene.robot, 1.001)


@pytest.mark.parametrize("scale", [(1, 1, 1), *SCALES], ids=str)
def test_a_goal_missed_by_a_millionth_in_other_units(scale):
    scene, off = scaled(*scale), 1.5e-7 * scale[0]
    position = planned(scene).position
    moved = position.coefficients + np.array([off, 0, 0]) * (np.arange(4) == 0)[:, None]
    found = verify(scene, replace(planned(scene), position=replace(position, coefficients=moved)))
    assert not found.ok
    assert found.goal_distance == pytest.approx(off, rel=1e-5)
    assert len([each for each in found.failures() if "scene's" in each]) == 2  # start and goal
