"""Drives, joints and workspaces: what their keys mean, by hand, and one sentence if bad."""

from __future__ import annotations

import copy
import json
from math import pi
from typing import Any

import pytest

from deltaopt.errors import SceneError
from deltaopt.robot.drive import Drive, Friction
from deltaopt.robot.joints import Joints
from deltaopt.robot.machine import Workspace
from deltaopt.robot.robot import Robot

ROBOT = {
    "name": "test robot",
    "base_radius": 0.2,
    "platform_radius": 0.1,
    "upper_arm": {"length": 0.2, "mass": 0.4},
    "forearm": {"length": 0.5, "mass": 0.25},
    "platform": {"mass": 0.3},
}
RPM = 2 * pi / 60
MOTOR = {
    "peak_torque": 8.0,
    "rated_torque": 2.5,
    "max_speed": 6000 * RPM,
    "inertia": 2.2e-4,
    "curve": [[0.0, 8.0], [4500 * RPM, 8.0], [6000 * RPM, 4.0]],
}
BRAKE = {"inertia": 0.2e-4}
GEAR = {
    "ratio": 33.0,
    "efficiency": 0.94,
    "inertia": 0.5e-4,
    "peak_torque": 300.0,
    "nominal_torque": 150.0,
    "input_speed": 6000 * RPM,
}
CATALOGUE = {"motor": MOTOR, "brake": BRAKE, "gear": GEAR}
AT_THE_ARM = {
    "torque": 350.0,
    "speed": 8.0,
    "inertia": 0.626,
    "friction": {"viscous": 3.0, "coulomb": 8.0, "speed": 0.05},
    "torque_curve": [[0.0, 350.0], [5.0, 350.0], [8.0, 200.0]],
    "rms_torque": [120.0, 110.0, 100.0],
}


def robot(**keys: object) -> Robot:
    return Robot.model_validate(ROBOT | {"drive": {"torque": 10.0}} | keys)


def without(record: dict[str, Any], *keys: str) -> dict[str, Any]:
    return {key: value for key, value in record.items() if key not in keys}


def error_of(drive: object, key: str = "drive") -> SceneError:
    with pytest.raises(SceneError) as caught:
        robot(**{key: drive})
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    assert "pydantic" not in message
    return caught.value


# --- at the arm ---------------------------------------------------------------------------


def test_every_key_of_a_drive_at_the_arm() -> None:
    given = robot(drive=AT_THE_ARM)
    drive = given.drive
    assert given.torque_limits == (350.0, 350.0, 350.0)
    assert given.speed_limits == (8.0, 8.0, 8.0)
    assert given.rms_torque == (120.0, 110.0, 100.0)
    assert drive.inertia == 0.626
    assert drive.friction == Friction(viscous=3.0, coulomb=8.0, speed=0.05)
    assert drive.torque_curve == ((0.0, 350.0), (5.0, 350.0), (8.0, 200.0))
    assert json.loads(json.dumps(drive.model_dump(exclude_none=True))) == AT_THE_ARM
    assert Drive.model_validate(drive.model_dump()) == drive
    assert hash(Drive.model_validate(drive.model_dump())) == hash(drive)


@pytest.mark.parametrize(
    ("speed", "limits"), [(None, (8.0, 8.0, 8.0)), ([9.0, 7.0, 8.0], (8.0, 7.0, 8.0))]
)
def test_the_last_speed_of_a_curve_is_a_limit(speed, limits) -> None:
    assert robot(drive=AT_THE_ARM | {"speed": speed}).speed_limits == limits


@pytest.mark.parametrize(
    ("friction", "meant"),
    [
        ({"viscous": 0.3}, {"viscous": 0.3}),
        ({"coulomb": 2.0, "speed": 0.1}, {"coulomb": 2.0, "speed": 0.1}),
        ({"coulomb": 2.0}, {"coulomb": 2.0, "speed": 0.05}),
        ({"coulomb": 2.0, "speed": None}, {"coulomb": 2.0, "speed": 0.05}),
    ],
)
def test_friction_may_have_one_part_and_coulombs_a_speed_of_its_own(friction, meant) -> None:
    given = robot(drive={"torque": 10.0, "friction": friction}).drive.friction
    assert given is not None
    assert given.model_dump(exclude_none=True) == meant
    assert Friction.model_validate(given.model_dump()) == given


# --- as a catalogue gives it --------------------------------------------------------------


def test_a_catalogues_drive_by_hand() -> None:
    """33 x 0.94 = 31.02; 33² = 1089; 6000 rpm / 33 = 181.818... rpm."""
    given = robot(drive=CATALOGUE)
    drive = given.drive
    assert given.torque_limits == pytest.approx([248.16] * 3, rel=1e-14)
    assert given.rms_torque == pytest.approx([77.55] * 3, rel=1e-14)
    assert given.speed_limits == pytest.approx([19.039955476301776] * 3, rel=1e-14)
    assert drive.inertia == pytest.approx(2.9e-4 * 1089, rel=1e-14)
    assert drive.torque_curve is not None
    speeds, torques = zip(*drive.torque_curve, strict=True)
    assert speeds == pytest.approx([0, 14.279966607226333, 19.039955476301776], rel=1e-14)
    assert torques == pytest.approx([248.16, 248.16, 124.08], rel=1e-14)


def test_the_gear_may_be_what_limits() -> None:
    """Torque 200 instead of 248.16 N·m, to the speed at which the motor gives that, (200 / 31.02
    - 4) / 4 of the way from 6000 to 4500 rpm; 5500 rpm instead of 6000, at which it gives
    31.02 x (4 + 4/3) N·m."""
    drive = robot(
        drive=CATALOGUE | {"gear": GEAR | {"peak_torque": 200.0, "input_speed": 5500 * RPM}}
    ).drive
    assert drive.torque == 200.0
    assert drive.speed == pytest.approx(5500 * RPM / 33, rel=1e-14)
    assert drive.torque_curve is not None
    speeds, torques = zip(*drive.torque_curve, strict=True)
    crossing = (6000 - 1500 * (200 / 31.02 - 4) / 4) * RPM / 33
    assert speeds == pytest.approx([0, crossing, 5500 * RPM / 33], rel=1e-14)
    assert torques == pytest.approx([200, 200, 31.02 * (4 + 4 / 3)], rel=1e-14)


def test_a_catalogues_drive_is_written_as_it_was_given() -> None:
    given = robot(drive=CATALOGUE | {"friction": {"viscous": 0.3}})
    told = json.loads(json.dumps(given.model_dump(mode="json", exclude_none=True)))
    assert told["drive"] == CATALOGUE | {"friction": {"viscous": 0.3}}
    assert Robot.model_validate(told) == given
    assert Robot.model_validate_json(given.model_dump_json()) == given


def test_a_copy_of_a_catalogues_drive_is_reduced_again() -> None:
    drive = robot(drive=CATALOGUE).drive
    assert drive.model_copy(update={"gear": None}).torque == 8.0
    with pytest.raises(SceneError, match="torque is given beside motor"):
        drive.model_copy(update={"torque": 8.0})
    plain = robot(drive=AT_THE_ARM).drive
    assert plain.model_copy(update={"speed": 7}).speed == 7.0


# --- bad drives ---------------------------------------------------------------------------


@pytest.mark.parametrize("key", sorted(without(AT_THE_ARM, "friction")))
def test_the_same_thing_twice(key: str) -> None:
    error = error_of(CATALOGUE | {key: AT_THE_ARM[key]})
    assert str(error) == (
        f"drive.{key} is given beside motor; expected either {key} or motor, since it follows "
        "from motor, brake and gear"
    )


@pytest.mark.parametrize("key", ["brake", "gear"])
def test_gear_and_brake_belong_to_a_motor(key: str) -> None:
    error = error_of({"torque": 10.0, key: CATALOGUE[key]})
    assert (error.key, error.expected) == (f"drive.{key}", "a motor beside it")


@pytest.mark.parametrize(
    "curve",
    [
        [[0.0, 8.0]],
        [[1.0, 8.0], [2.0, 7.0]],  # begins late
        [[0.0, 8.0], [2.0, 7.0], [2.0, 6.0]],  # no function
        [[0.0, 7.0], [2.0, 8.0]],  # rises
        [[0.0, 8.0], [1.0, 6.0], [2.0, 5.0]],  # not concave
        [[0.0, 8.1], [1.0, 6.0]],  # above the peak
        [[0.0, 8.0], [1.0, -1.0]],
        [[0.0, 8.0, 1.0], [1.0, 1.0, 1.0]],
        8.0,
    ],
)
def test_what_is_no_torque_curve(curve: object) -> None:
    for drive, key in [
        ({"torque": 8.0, "torque_curve": curve}, "drive.torque_curve"),
        ({"motor": {"peak_torque": 8.0, "curve": curve}}, "drive.motor.curve"),
    ]:
        error = error_of(drive)
        assert error.key == key
        assert "concave" in error.expected


def test_a_curve_along_a_line_with_rounding_is_concave() -> None:
    curve = [[0.1 * i, 8.0 - 0.7 * (0.1 * i)] for i in range(11)]
    assert robot(drive={"torque": 8.0, "torque_curve": curve}).drive.torque_curve is not None


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("motor", 3.0, "a mapping with the key peak_torque"),
        ("motor.peak_torque", None, "a torque in N·m"),
        ("motor.rated_torque", 8.1, "at most the peak torque, 8 N·m"),
        ("motor.max_speed", 0.0, "an angular speed in rad/s"),
        ("motor.inertia", -1.0, "kg·m², at least 0"),
        ("motor.colour", 1.0, "one of peak_torque"),
        ("brake.inertia", -1.0, "kg·m², at least 0"),
        ("gear", 33.0, "a mapping with the key ratio"),
        ("gear.ratio", 0.0, "greater than 0"),
        ("gear.efficiency", 1.01, "greater than 0 and at most 1"),
        ("gear.inertia", -1.0, "at the motor's side"),
        ("gear.nominal_torque", 301.0, "at most the peak torque, 300 N·m"),
        ("gear.input_speed", float("nan"), "an angular speed in rad/s"),
    ],
)
def test_bad_parts_of_a_drive(key: str, value: object, expected: str) -> None:
    drive = copy.deepcopy(CATALOGUE)
    part, _, inner = key.partition(".")
    if inner:
        drive[part][inner] = value
    error = error_of(drive if inner else drive | {part: value})
    assert error.key == f"drive.{key}"
    assert expected in error.expected


@pytest.mark.parametrize(
    ("friction", "key", "expected"),
    [
        ({}, "friction", "viscous (N·m·s/rad), coulomb (N·m) or both"),
        ({"viscous": -1.0}, "friction.viscous", "at least 0"),
        ({"coulomb": -1.0, "speed": 0.1}, "friction.coulomb", "at least 0"),
        ({"coulomb": 1.0, "speed": 0.0}, "friction.speed", "greater than 0"),
        ({"viscous": 1.0, "speed": 0.1}, "friction.speed", "coulomb beside it"),
        (3.0, "friction", "keys viscous, coulomb, speed"),
    ],
)
def test_bad_friction(friction: object, key: str, expected: str) -> None:
    error = error_of({"torque": 10.0, "friction": friction})
    assert error.key == f"drive.{key}"
    assert expected in error.expected


# --- joints and workspace -----------------------------------------------------------------


def test_joints_and_workspace() -> None:
    given = robot(
        joints={"zero": [0.1, 0.2, 0.3], "sign": -1.0, "arm": [-1.0, 1.5], "ball": 0.9},
        workspace={"depth": [0.6, 1.1], "radius": 0.5},
    )
    assert given.joints == Joints(zero=(0.1, 0.2, 0.3), sign=-1, arm=(-1.0, 1.5), ball=0.9)
    assert given.workspace == Workspace(depth=(0.6, 1.1), radius=0.5)
    assert Robot.model_validate_json(given.model_dump_json()) == given


@pytest.mark.parametrize(
    ("record", "key", "value"),
    [
        ("joints", "zero", [0.1, 0.2]),
        ("joints", "sign", [1.0, 1.0, 2.0]),
        ("joints", "arm", [1.0, -1.0]),
        ("joints", "ball", 0.0),
        ("joints", "ball", pi / 2),
        ("joints", "balls", 1.0),
        ("workspace", "depth", [1.1, 0.6]),
        ("workspace", "radius", 0.0),
    ],
)
def test_bad_joints_and_workspaces(record: str, key: str, value: object) -> None:
    error = error_of({key: value}, record)
    assert error.key == f"{record}.{key}"
    for bad in (3.0, [1.0], "wide"):
        assert error_of(bad, record).key == record
