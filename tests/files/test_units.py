"""Numbers with units: what they are in SI, by definition, and one sentence for every wrong unit."""

from __future__ import annotations

import copy
import json
import subprocess
import sys
from math import pi
from pathlib import Path

import pytest
import yaml

from deltaopt.errors import SceneError
from deltaopt.files.units import LENGTH, Misread, Quantity
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene

ROOT = Path(__file__).parents[2]
ROBOT = {
    "name": "with units",
    "base_radius": "200 mm",
    "platform_radius": "0.1 m",
    "upper_arm": {"length": "20 cm", "mass": "400 g", "inertia": "15 kg*cm^2"},
    "forearm": {"length": "0.5", "mass": "250 g", "inertia": [0, "50 kg cm²", "50 kgcm²"]},
    "platform": {"mass": "3e-4 t"},
    "drive": {"torque": ["10 N*m", "1100 N·cm", "12 J"], "speed": "75 rpm"},
    "gravity": "9.8 m/s²",
    "joints": {"zero": "5.328 deg", "sign": -1, "arm": ["−60 deg", "90°"], "ball": "55 deg"},
    "workspace": {"depth": ["600 mm", 1.1], "radius": "50 cm"},
}
IN_SI = {
    "name": "with units",
    "base_radius": 0.2,
    "platform_radius": 0.1,
    "upper_arm": {"length": 0.2, "mass": 0.4, "inertia": 1.5e-3},
    "forearm": {"length": 0.5, "mass": 0.25, "inertia": [0.0, 0.005, 0.005]},
    "platform": {"mass": 0.3},
    "drive": {"torque": [10.0, 11.0, 12.0], "speed": 2.5 * pi},
    "gravity": 9.8,
    "joints": {
        "zero": 0.0929911425462578872,
        "sign": -1,
        "arm": [-1.04719755119659774615, pi / 2],  # -pi/3 to 21 digits: pi / 3 is rounded twice
        "ball": 0.95993108859688126731,
    },
    "workspace": {"depth": [0.6, 1.1], "radius": 0.5},
}
SCENE = {
    "payload": "500 g",
    "start": ["450 mm", "-5 cm", 0.0],
    "goal": [0.45, "10 cm", "0 m"],
    "limits": {"torque": "85 %", "speed": "1 rev/s", "acceleration": "10 standard_gravity"},
    "objective": "effort",
    "duration": "300 ms",
}


def error_of(record: dict[str, object], key: str, value: object, kind: type = Robot) -> SceneError:
    """The error for a value at a dotted key; one sentence that names both."""
    record = copy.deepcopy(record)
    *path, last = key.split(".")
    within = record
    for part in path:
        within = within[part]  # type: ignore[assignment]
    within[last] = value
    with pytest.raises(SceneError) as caught:
        kind.model_validate(record)
    message = str(caught.value)
    assert caught.value.key == key
    assert message.startswith(key)
    assert message.endswith(f"; expected {caught.value.expected}")
    assert len(message.splitlines()) == 1
    return caught.value


def test_every_number_of_a_robot_may_have_a_unit(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(ROBOT, allow_unicode=True), "utf-8")
    for robot in (load_robot(tmp_path / "robot.yaml"), Robot.model_validate(ROBOT)):
        written = json.loads(json.dumps(robot.model_dump(mode="json", exclude_none=True)))
        assert written == IN_SI
        assert Robot.model_validate(written) == robot


def test_every_number_of_a_scene_may_have_a_unit(tmp_path: Path) -> None:
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(ROBOT, allow_unicode=True), "utf-8")
    text = yaml.safe_dump(SCENE | {"robot": "robot.yaml"})
    (tmp_path / "scene.yaml").write_text(text, "utf-8")
    loaded = load_scene(tmp_path / "scene.yaml")
    robot = load_robot(tmp_path / "robot.yaml")
    made = Scene(robot=robot, **SCENE)
    for scene in (loaded, made, Scene(**SCENE, robot=IN_SI)):
        told = json.loads(json.dumps(scene.model_dump(mode="json", exclude_none=True)))
        assert told == {
            "robot": IN_SI,
            "payload": 0.5,
            "start": [0.45, -0.05, 0.0],
            "goal": [0.45, 0.1, 0.0],
            "limits": {
                "torque": [0.85 * 10, 0.85 * 11, 0.85 * 12],
                "speed": 2 * pi,
                "acceleration": 98.0665,
            },
            "objective": "effort",
            "duration": 0.3,
        }
        assert Scene.model_validate(told) == scene


@pytest.mark.parametrize(
    ("unit", "text", "number"),
    [
        ("m", "350mm", 0.35),
        ("m", " 350  mm ", 0.35),
        ("m", "2 µm", 2e-6),  # the micro sign
        ("m", "2 μm", 2e-6),  # the Greek letter
        ("m", "1.5 ft", 0.4572),
        ("rad", "180 degrees", pi),
        ("rad/s", "4500 rpm", 150 * pi),
        ("rad/s", "60 °/s", pi / 3),
        ("rad/s", "3 rad s⁻¹", 3.0),
        ("N*m", "8 Nm", 8.0),
        ("N*m", "8 N m", 8.0),
        ("N*m", "1 lbf in", 0.45359237 * 9.80665 * 0.0254),
        ("kg*m**2", "2.2 kg·cm²", 2.2e-4),
        ("kg*m**2", "2.2 kg*(cm)^2", 2.2e-4),
        ("kg*m**2", "1 oz*in^2", 0.45359237 / 16 * 0.0254**2),
        ("m/s**2", "9.81 m s⁻²", 9.81),
        ("", "94 %", 0.94),
        ("", "33", 33.0),
    ],
)
def test_units_as_people_write_them(unit: str, text: str, number: float) -> None:
    assert Quantity(unit, "a number").in_si(text) == pytest.approx(number, rel=2.3e-16, abs=0)
    same = Quantity(unit, "a number").in_si(text)
    assert Quantity(unit, "a number").in_si([text, 1, [text]]) == (same, 1, (same,))


@pytest.mark.parametrize(
    ("text", "number"),
    [("3 N*m*s", 3.0), ("3 Nms/rad", 3.0), ("3 Nm/(rad/s)", 3.0), ("3 Nm/rpm", 90 / pi)],
)
def test_viscous_friction_is_by_radian_or_without(text: str, number: float) -> None:
    drive = {"torque": 10.0, "friction": {"viscous": text}}
    given = Robot.model_validate(ROBOT | {"drive": drive}).drive.friction
    assert given is not None
    assert given.viscous == pytest.approx(number, rel=2.3e-16)


def test_a_decimal_number_is_rounded_once() -> None:
    """0.001 x 350 is 0.35000000000000003 in floats."""
    for millimetres in range(1, 2000):
        assert LENGTH.in_si(f"{millimetres} mm") == millimetres / 1000


@pytest.mark.parametrize(
    ("unit", "text"),
    [
        ("m", "3 kg"),
        ("m", "3 parsnip"),
        ("m", "0,35 m"),
        ("rad", "85 %"),
        ("rad/s", "6000 1/min"),  # by 2π another number than 6000 rpm
        ("rad/s", "100 Hz"),
        ("N*m", "8 N"),
        ("N*m", "8 Nm/rad"),
        ("m/s**2", "2 g"),  # grams
        ("", "3 rad"),
        ("m", "3 °C"),
        ("m", "3 m/"),
        ("m", "3 ****"),
        ("m", "3 m m1"),
        ("m", "3 m**9**9**9"),
        ("m", "3 m^0.5"),
        ("m", "3 __import__('os').system('true')"),
        ("m", "3 m.__class__"),
    ],
)
def test_what_is_no_such_unit(unit: str, text: str) -> None:
    with pytest.raises(Misread):
        Quantity(unit, "a number").in_si(text)


@pytest.mark.parametrize(
    "text", ["heavy", "", "m", "nan m", "inf m", "٣ m", "1e-9999 m", "3 " + "m*" * 40 + "m"]
)
def test_what_is_no_quantity_is_left_for_the_field_to_refuse(text: str) -> None:
    try:
        assert LENGTH.in_si(text) == text
    except Misread:
        assert text == "1e-9999 m"
    assert error_of(IN_SI, "base_radius", text).value == text


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        (
            "forearm.length",
            "1.2 kg",
            "forearm.length is '1.2 kg', which cannot be converted to m; expected a length in m, "
            "greater than 0",
        ),
        (
            "drive.torque",
            [10.0, "11 N", 12.0],
            "drive.torque is [10.0, '11 N', 12.0], of which '11 N' cannot be converted to N*m; "
            "expected one torque in N·m, greater than 0, or three",
        ),
        (
            "base_radius",
            "1e99 m",
            "base_radius is '1e99 m', which would be 1e+99 m, where at most 10 is plausible; "
            "expected a length in m, at least 0",
        ),
    ],
)
def test_a_wrong_unit_is_one_sentence(key: str, value: object, message: str) -> None:
    assert str(error_of(IN_SI, key, value)) == message


@pytest.mark.parametrize(
    ("given", "torque"),
    [
        ("50 %", (5.0, 5.5, 6.0)),
        (["50 %", 11.0, "100%"], (5.0, 11.0, 12.0)),
        ("600 N·cm", 6.0),
    ],
)
def test_a_limit_may_be_a_share_of_the_drives(given: object, torque: object) -> None:
    content = SCENE | {"robot": IN_SI, "limits": {"torque": given}}
    scene = Scene.model_validate(content)
    assert scene.limits is not None
    assert scene.limits.torque == torque
    full = Scene.model_validate(content | {"limits": {}})
    assert full.model_copy(update={"limits": {"torque": given}}) == scene
    even = full.robot.model_copy(update={"drive": {"torque": 20.0}})
    if given == "50 %":
        copied = full.model_copy(update={"robot": even, "limits": {"torque": given}})
        assert copied.limits is not None
        assert copied.limits.torque == 10.0


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("torque", "0 %", "a share of what the drive gives, greater than 0 and at most 100 %"),
        ("torque", "101 %", "a share of what the drive gives, greater than 0 and at most 100 %"),
        ("speed", "50 %", "since the robot's drive names no speed"),
        ("acceleration", "50 %", "an acceleration in m/s², greater than 0"),
    ],
)
def test_a_share_of_nothing(key: str, value: str, expected: str) -> None:
    scene = SCENE | {"robot": IN_SI | {"drive": {"torque": 10.0}}, "limits": {}}
    error = error_of(scene, f"limits.{key}", value, Scene)
    assert error.value == value
    assert error.expected.endswith(expected)


def test_pint_is_loaded_when_a_unit_is_met(tmp_path: Path) -> None:
    """Its import takes a good part of a second."""
    for name, unit in (("si", ""), ("metre", " m")):
        content = yaml.safe_dump(IN_SI | {"base_radius": f"0.2{unit}"})
        (tmp_path / f"{name}.yaml").write_text(content, "utf-8")
    code = (
        "import sys; from deltaopt.robot.robot import load_robot\n"
        f"for name in ('si', 'metre'): load_robot({str(tmp_path)!r} + f'/{{name}}.yaml'); "
        "print('pint' in sys.modules)"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert run.stdout.split() == ["False", "True"]
