"""Every number of a robot or scene that has a dimension takes a unit, and none is taken that can
only be millimetres, grams, degrees or the like read as SI units."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import inf, pi
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import pytest
import yaml

from deltaopt.errors import SceneError
from deltaopt.files.units import Quantity
from deltaopt.files.validated_record import Record
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene

ROOT = Path(__file__).parents[2]
BARE = {
    "Joints.sign",  # 1 or -1
    "Curve.s",  # a parameter whose unit is free
    "Curve.dx",
    "Curve.ddx",
    "Scene.planned_links",  # no key of a file
}
WRITTEN = {
    "m": ("500 mm", 0.5),
    "kg": ("500 g", 0.5),
    "s": ("500 ms", 0.5),
    "rad": ("45 deg", pi / 4),
    "m/s": ("500 mm/s", 0.5),
    "rad/s": ("60 rpm", 2 * pi),
    "m/s^2": ("500 mm/s^2", 0.5),
    "rad/s^2": ("45 deg/s^2", pi / 4),
    "m/s^3": ("500 mm/s^3", 0.5),
    "rad/s^3": ("45 deg/s^3", pi / 4),
    "N*m/s": ("500 N*mm/s", 0.5),
    "kg*m^2": ("500 kg*cm^2", 0.05),
    "N*m": ("500 N*mm", 0.5),
    "N*m*s/rad": ("500 N*mm*s/rad", 0.5),
    "1/(N^2*m^2)": ("2 1/(N*m)^2", 2.0),
    "s^6/m^2": ("2 s^6/m^2", 2.0),
    "s^2/(N^2*m^2)": ("2 s^2/(N*m)^2", 2.0),
    "": ("100 %", 1.0),
}
Leaf = Callable[[Quantity | None], Any]


def parts(kind: Any) -> tuple[Any, Quantity | None]:
    """A type without its marks, and the quantity that one of them names."""
    quantity = None
    while get_origin(kind) is Annotated:
        kind, *marks = get_args(kind)
        quantity = next((each for each in marks if isinstance(each, Quantity)), quantity)
    return kind, quantity


def inside(kind: Any, quantity: Quantity | None = None) -> Iterator[tuple[Any, Quantity | None]]:
    """The plain types in a type, each with the quantity that it is."""
    plain, own = parts(kind)
    own = own or quantity
    if get_args(plain):
        for each in get_args(plain):
            yield from inside(each, own)
    else:
        yield plain, own


def records() -> list[type[Record]]:
    """The records of robots and scenes, and all in them, with their keys and kinds."""
    found: list[type[Record]] = [Robot, Scene]
    for record in found:
        for field in record.model_fields.values():
            kinds = [kind for kind, _ in inside(field.annotation)]
            records = (k for k in kinds if isinstance(k, type) and issubclass(k, Record))
            found += [kind for kind in dict.fromkeys(records) if kind not in found]
    return found


def annotation(record: type[Record], key: str) -> Any:
    field = record.model_fields[key]
    return Annotated[(field.annotation, *field.metadata)] if field.metadata else field.annotation


def value_of(kind: Any, leaf: Leaf, quantity: Quantity | None = None) -> Any:
    """What may stand for a type: lists, and of each number the leaf of its quantity; else None."""
    kind, own = parts(kind)
    own = own or quantity
    if kind in (float, int):
        return leaf(own)
    if get_origin(kind) is tuple:
        each = get_args(kind)
        each = (each[0], each[0]) if each[-1] is Ellipsis else each
        values = [value_of(one, leaf, own) for one in each]
        return None if None in values else values
    if get_origin(kind) in (Union, UnionType):
        found = (value_of(one, leaf, own) for one in get_args(kind))
        return next((value for value in found if value is not None), None)
    return None


NUMBERS = [
    (record, key)
    for record in records()
    for key in record.model_fields
    if any(kind in (float, int) for kind, _ in inside(annotation(record, key)))
]
QUANTITIES = [each for each in NUMBERS if f"{each[0].__name__}.{each[1]}" not in BARE]


def flat(value: Any) -> list[Any]:
    if not isinstance(value, list | tuple):
        return [value]
    return [one for each in value for one in flat(each)]


def refused(record: type[Record], key: str, value: Any) -> str:
    with pytest.raises(SceneError) as caught:
        record._valid(key, value)
    assert caught.value.key == key
    return str(caught.value)


def test_the_walk_finds_the_keys_that_there_are():
    names = {f"{record.__name__}.{key}" for record, key in NUMBERS}
    assert names >= BARE | {"PickAndPlace.height", "Near.within", "Gear.ratio", "Effort.duration"}
    assert len(names) > 60


@pytest.mark.parametrize(("record", "key"), QUANTITIES)
def test_every_number_with_a_dimension_takes_a_unit_and_refuses_a_wrong_one(record, key):
    quantities = [q for kind, q in inside(annotation(record, key)) if kind in (float, int)]
    assert None not in quantities, "a number whose quantity nothing names"
    kind = annotation(record, key)
    written = WRITTEN | ({"": ("50 %", 0.5)} if "singularity" in key else {})  # below 1
    given = value_of(kind, lambda quantity: written[quantity.unit][0])
    expected = value_of(kind, lambda quantity: written[quantity.unit][1])
    assert flat(record._valid(key, given)) == pytest.approx(flat(expected), rel=1e-15)
    wrong = value_of(kind, lambda quantity: "1 m" if quantity.unit == "kg" else "1 kg")
    assert "cannot be converted to" in refused(record, key, wrong)


@pytest.mark.parametrize(("record", "key"), QUANTITIES)
def test_what_is_beyond_any_robot_is_one_sentence(record, key):
    kind = annotation(record, key)
    if value_of(kind, lambda quantity: quantity.most) in (inf, [inf] * 3):
        shares = {"Effort", "SmoothMotion", "SmoothTorque"}  # of the fastest motion's duration
        weights = {"TimeAndEffort", "TimeAndEfforts", "TimeAndJerk", "TimeAndTorqueRate"}
        assert record.__name__ in {"Gear", "HalfSpace", "Time", "Limits", *shares, *weights}
        return
    told = refused(record, key, value_of(kind, lambda quantity: 1.01 * quantity.most))
    assert "is plausible; expected " in told
    assert " need a unit: " in told


MOVE = {"start": [0.8, -0.15, 0.0], "goal": [0.8, 0.15, 0.0]}
ROBOT = yaml.safe_load((ROOT / "problems/robots/industrial.yaml").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("key", "value", "meant"),
    [
        ("upper_arm.length", 350, "mm need a unit: 350 mm"),
        ("forearm.mass", 250, "g need a unit: 250 g"),
        ("drive.speed", 3000, "deg/s need a unit: 3000 deg/s"),
        ("drive.inertia", 59, "kg*cm^2 need a unit: 59 kg*cm^2"),
        ("drive.torque", [40, 40, 9550], "N*mm need a unit: 9550 N*mm"),
        ("joints.arm", [-60, 90], "deg need a unit: -60 deg"),
        ("joints.ball", 55, "deg need a unit: 55 deg"),
        ("drive.motor.max_speed", 6000, "rpm need a unit: 6000 rpm"),
        ("workspace.depth", [600, 1100], "mm need a unit: 600 mm"),
        ("gravity", 9810, "mm/s^2 need a unit: 9810 mm/s^2"),
    ],
)
def test_numbers_of_a_datasheet_are_one_sentence_that_names_the_unit(key, value, meant):
    first, _, last = key.partition(".")
    inner = {last: value} if "." not in last else {"motor": {"peak_torque": 1, "max_speed": value}}
    content = ROBOT | {first: {**ROBOT.get(first, {}), **inner} if last else value}
    if "motor" in inner:
        content["drive"] = inner
    with pytest.raises(SceneError) as caught:
        Robot.model_validate(content)
    assert (caught.value.key, str(caught.value).endswith(meant)) == (key, True)


def test_a_rotor_in_kg_cm2_is_told_at_the_motor_though_it_shows_at_the_arm():
    drive = {"motor": {"peak_torque": 1.0, "inertia": 1.5}, "gear": {"ratio": 33}}
    with pytest.raises(SceneError, match=r"gives inertia at the arm that is 1633\.5, which would"):
        Robot.model_validate(ROBOT | {"drive": drive})


def test_lengths_of_a_path_take_units():
    up = {"pick_and_place": {"height": "25 mm", "blend": "2 cm"}}
    path = Scene(robot=ROBOT, **MOVE, path=up).path
    assert (path.height, path.blend) == (0.025, 0.02)
    through = {"points": [["780 mm", 0, "1 cm"]], "blend": "20 mm", "speeds": ["500 mm/s", 0]}
    path = Scene(robot=ROBOT, **MOVE, path=through).path
    assert (path.points, path.blend, path.speeds) == (((0.78, 0.0, 0.01),), 0.02, (0.5, 0.0))


def test_a_hull_in_millimetres_is_told_so(tmp_path):
    corners = ((0, 0, 0), (200, 0, 0), (0, 80, 0), (0, 0, 60))
    faces = ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3))
    lines = (f"vertex {' '.join(map(str, corners[i]))}" for face in faces for i in face)
    (tmp_path / "part.stl").write_text("solid part\n" + "\n".join(lines), encoding="utf-8")
    (tmp_path / "robot.yaml").write_text(yaml.safe_dump(ROBOT), encoding="utf-8")
    scene = MOVE | {"robot": "robot.yaml", "keep_out": [{"hull": {"file": "part.stl"}}]}
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        load_scene(tmp_path / "scene.yaml")
    assert caught.value.key == "keep_out[0].hull.file"
    assert "part.stl" in str(caught.value)
    assert "would be 200 m" in str(caught.value)


@pytest.mark.parametrize("size", [0.05, 10.0])
def test_robots_of_20_mm_and_of_2_m_are_plausible(size):
    """With lengths scaled by k, masses and torques by k²."""
    robot = load_robot(ROOT / "problems/robots/orsino.yaml")
    power = {"base_radius": 1, "platform_radius": 1, "length": 1, "mass": 2, "torque": 2}

    def scaled(content: Any) -> Any:
        if isinstance(content, dict):
            return {key: times(scaled(value), power.get(key, 0)) for key, value in content.items()}
        return content

    def times(value: Any, exponent: int) -> Any:
        return value * size**exponent if isinstance(value, float) else value

    found = Robot.model_validate(scaled(robot.model_dump(exclude_none=True)))
    assert found.upper_arm.length == pytest.approx(0.2 * size)
