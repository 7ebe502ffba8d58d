"""Robots and scenes: good files give exact values, bad ones one clear sentence."""

from __future__ import annotations

import copy
import json
import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from pydantic import ValidationError

from deltaopt.errors import SceneError
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.scene.known_limits import Limits, limits_of
from deltaopt.scene.objective import (
    Effort,
    SmoothMotion,
    SmoothTorque,
    Time,
    TimeAndEffort,
    TimeAndJerk,
    TimeAndTorqueRate,
)
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from studies.problems import PROBLEMS

ROBOT = {
    "name": "test robot",
    "source": "made up",
    "base_radius": 0.2,
    "platform_radius": 0.1,
    "upper_arm": {"length": 0.2, "mass": 0.4, "inertia": 1.5e-3},
    "forearm": {"length": 0.5, "mass": 0.25, "inertia": [0.0, 0.005, 0.005]},
    "platform": {"mass": 0.3},
    "drive": {"torque": [10.0, 11.0, 12.0], "speed": 8.0},
    "gravity": 9.8,
}
SCENE = {
    "robot": "robot.yaml",
    "payload": 1.0,
    "start": [0.45, -0.05, 0.0],
    "goal": [0.45, 0.1, 0.0],
    "limits": {"torque": 9.0, "speed": [7.0, 6.0, 5.0]},
    "objective": "time",
}
ABSENT = object()


def changed(record: dict[str, Any], key: str, value: object) -> dict[str, Any]:
    """Return a copy of ``record`` with ``value`` at the dotted ``key``, or without the key."""
    record = copy.deepcopy(record)
    *path, last = key.split(".")
    within = record
    for part in path:
        within = within[part]
    if value is ABSENT:
        del within[last]
    else:
        within[last] = value
    return record


def write(folder: Path, robot: dict[str, Any] = ROBOT, scene: dict[str, Any] = SCENE) -> Path:
    """Write both files into ``folder`` and return the scene's."""
    (folder / "robot.yaml").write_text(yaml.safe_dump(robot), encoding="utf-8")
    (folder / "scene.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    return folder / "scene.yaml"


WEIGHTED = {"time": 1.0, "effort": 0.002}


def error_of(scene_file: Path) -> SceneError:
    """Load a bad scene; check that the error is one sentence that a user can read."""
    with pytest.raises(SceneError) as caught:
        load_scene(scene_file)
    error, message = caught.value, str(caught.value)
    assert message.startswith(f"{error.file}")
    assert error.key in message
    assert message.endswith(f"; expected {error.expected}")
    assert len(message.splitlines()) == 1
    for jargon in ("pydantic", "http", "validation error", "Traceback", "input_", "None"):
        assert jargon not in message
    return error


# --- good files ---------------------------------------------------------------------------


def bounds(scene: Scene, name: str) -> tuple[float, ...] | None:
    """The upper bounds of a limit in a scene."""
    found = limits_of(scene).upper(name)
    return None if found is None else tuple(found.tolist())


OF_THE_SCENE, OF_THE_DRIVE = ((9.0, 9.0, 9.0), (7.0, 6.0, 5.0)), ((10.0, 11.0, 12.0), (8.0,) * 3)


@pytest.mark.parametrize(
    ("drives_speed", "limits", "torque_and_speed"),
    [
        (8.0, SCENE["limits"], OF_THE_SCENE),
        (ABSENT, SCENE["limits"], OF_THE_SCENE),
        (8.0, ABSENT, OF_THE_DRIVE),
        (8.0, {}, OF_THE_DRIVE),
        (8.0, {"torque": [10.0, 11.0, 12.0], "speed": 8.0}, OF_THE_DRIVE),
    ],
)
def test_limits_are_the_scenes_or_the_drives(
    tmp_path: Path, drives_speed: object, limits: object, torque_and_speed: object
) -> None:
    robot, scene = changed(ROBOT, "drive.speed", drives_speed), changed(SCENE, "limits", limits)
    loaded = load_scene(write(tmp_path, robot, scene))
    assert loaded.robot.torque_limits == (10.0, 11.0, 12.0)
    assert (bounds(loaded, "torque"), bounds(loaded, "speed")) == torque_and_speed


@pytest.mark.parametrize(
    ("written", "number"),
    [("1e-3", 1e-3), ("1.e2", 1e2), ("+.5", 0.5), ("2E0", 2.0), ("010", 10.0), ("3", 3.0)],
)
def test_numbers_are_read_as_they_look(tmp_path: Path, written: str, number: float) -> None:
    file = write(tmp_path)
    file.write_text(file.read_text().replace("payload: 1.0", f"payload: {written}"))
    payload = load_scene(file).payload
    assert payload == number
    assert isinstance(payload, float)


def test_a_byte_order_mark_is_ignored(tmp_path: Path) -> None:
    file = write(tmp_path)
    file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())
    assert load_scene(file).payload == 1.0


def test_the_robots_path_is_relative_to_the_scene(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "scenes").mkdir()
    (tmp_path / "robots").mkdir()
    write(tmp_path / "robots")
    write(tmp_path / "scenes", scene=changed(SCENE, "robot", "../robots/robot.yaml"))
    (tmp_path / "scenes" / "robot.yaml").unlink()
    monkeypatch.chdir(tmp_path)
    assert load_scene("scenes/scene.yaml").robot.name == "test robot"


@pytest.mark.parametrize("file", sorted(PROBLEMS.glob("*.yaml")), ids=lambda file: file.stem)
def test_every_shipped_scene_loads(file: Path) -> None:
    assert load_scene(file).objective == Time()


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ({"objective": "effort", "duration": 0.3}, Effort(duration=0.3)),
        ({"objective": "jerk", "duration": "101 %"}, SmoothMotion(of_fastest=1.01)),
        ({"objective": "torque_rate", "duration": "300 ms"}, SmoothTorque(duration=0.3)),
        ({"objective": WEIGHTED}, TimeAndEffort(time=1.0, effort=0.002)),
        ({"objective": {"jerk": 1e-9}}, TimeAndJerk(jerk=1e-9)),
        (
            {"objective": {"time": 2, "torque_rate": "1e-8 s^2/(N^2*m^2)"}},
            TimeAndTorqueRate(time=2.0, torque_rate=1e-8),
        ),
    ],
)
def test_objectives_are_values_and_words_only_in_files(tmp_path: Path, written, meant) -> None:
    scene = load_scene(write(tmp_path, scene=SCENE | written))
    assert scene.objective == meant
    dumped = json.loads(json.dumps(scene.model_dump(mode="json", exclude_none=True)))
    assert Scene.model_validate(dumped) == scene
    assert Scene(robot=scene.robot, start=scene.start, goal=scene.goal, objective=meant).objective


def test_effort_needs_a_duration(tmp_path: Path) -> None:
    error = error_of(write(tmp_path, scene=changed(SCENE, "objective", "effort")))
    assert (error.key, error.value, error.problem) == ("duration", None, "is missing")
    assert error.expected == (
        "a duration in s, greater than 0, or a share of the fastest motion's, 100 % at least, "
        "since the objective is effort"
    )


@pytest.mark.parametrize("duration", [0.0, -0.3, "0.3 m", "-0.3 s", [0.3], "99 %"])
def test_a_bad_duration(tmp_path: Path, duration) -> None:
    scene = SCENE | {"objective": "effort", "duration": duration}
    error = error_of(write(tmp_path, scene=scene))
    assert (error.key, error.value) == ("duration", duration)


# --- records in Python --------------------------------------------------------------------


def test_every_key_is_read_and_a_dump_is_json_that_validates_to_the_same_record(
    tmp_path: Path,
) -> None:
    scene = load_scene(write(tmp_path))
    assert scene.robot == load_robot(tmp_path / "robot.yaml")
    assert scene.limits == Limits(torque=9.0, speed=(7.0, 6.0, 5.0))
    text = json.dumps(scene.model_dump(mode="json"))
    assert Scene.model_validate(json.loads(text)) == scene
    assert Scene.model_validate(scene.model_dump()) == scene
    assert Robot.model_validate(json.loads(text)["robot"]) == scene.robot
    told = json.loads(json.dumps(scene.model_dump(mode="json", exclude_none=True)))
    assert told == changed(SCENE, "robot", ROBOT)


def test_a_bad_scene_in_python_is_a_scene_error_without_a_file() -> None:
    with pytest.raises(SceneError) as caught:
        Scene(robot=Robot.model_validate(ROBOT), start=(0, 0, 1), goal=(0, 0, 1))
    error = caught.value
    assert (error.file, error.key, error.value) == (None, "goal", (0.0, 0.0, 1.0))
    assert str(error) == "goal is (0.0, 0.0, 1.0); expected a point in m other than start"


@pytest.mark.parametrize("value", [True, float("nan"), float("inf"), 10**400])
def test_numbers_are_finite_and_no_booleans(value: float) -> None:
    with pytest.raises(SceneError) as caught:
        Robot.model_validate(changed(ROBOT, "upper_arm.length", value))
    assert caught.value.key == "upper_arm.length"


def test_records_are_frozen(tmp_path: Path) -> None:
    scene = load_scene(write(tmp_path))
    with pytest.raises(ValidationError, match="frozen"):
        scene.payload = 2.0
    with pytest.raises(ValidationError, match="frozen"):
        scene.robot.platform.mass = 2.0
    assert hash(scene) == hash(load_scene(tmp_path / "scene.yaml"))


def test_an_error_survives_pickling() -> None:
    error = SceneError(Path("a.yaml"), "payload", -1.0, "a mass in kg")
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error) == "a.yaml: payload is -1.0; expected a mass in kg"
    assert (again.file, again.key, again.value) == (Path("a.yaml"), "payload", -1.0)


def test_a_copy_has_valid_fields(tmp_path: Path) -> None:
    scene = load_scene(write(tmp_path))
    assert scene.model_copy(update={"limits": {"speed": 5}}).limits == Limits(speed=5.0)
    assert scene.model_copy(update={"limits": None}).limits is None
    weighted = scene.model_copy(update={"objective": {"effort": 0.01}})
    assert weighted.objective == TimeAndEffort(effort=0.01)
    for key, value, words in [
        ("limits", {"sped": 5.0}, "limits.sped is not a known key; expected speed"),
        (
            "payload",
            -1.0,
            "payload is -1.0; expected a mass in kg, greater than 0, or [least, largest]; leave "
            "the key out for none",
        ),
        ("goul", (0.4, 0.0, 0.0), "goul is not a known key; expected goal"),
    ]:
        with pytest.raises(SceneError) as caught:
            scene.model_copy(update={key: value})
        assert str(caught.value) == words


# --- bad values ---------------------------------------------------------------------------

BAD_IN_ROBOT = [
    ("name", 3.0, "name"),
    ("source", [1.0], "text"),
    ("base_radius", -0.1, "m, at least 0"),
    ("platform_radius", "-0.1 m", "m, at least 0"),
    ("upper_arm", [0.2, 0.4], "keys length and mass"),
    ("upper_arm.length", 0.0, "m, greater than 0"),
    ("upper_arm.mass", {"kg": 0.4}, "kg, at least 0"),
    ("upper_arm.inertia", -1e-3, "kg·m², at least 0"),
    ("forearm.mass", -0.25, "kg (of the pair of bars), at least 0"),
    ("forearm.inertia", [0.0, 0.005], "three principal moments of inertia in kg·m²"),
    ("platform", [], "key mass"),
    ("platform.mass", 0.0, "kg, greater than 0"),
    ("drive", "strong", "key torque"),
    ("drive.torque", [10.0, 10.0], "N·m, greater than 0, or three"),
    ("drive.torque", [10.0, 10.0, 0.0], "N·m, greater than 0, or three"),
    ("drive.speed", [1.0, "fast", 1.0], "rad/s, greater than 0, or three"),
    ("gravity", -9.81, "m/s², at least 0"),
]
BAD_IN_SCENE = [
    ("robot", 3.0, "path of a robot file"),
    ("robot", "nowhere.yaml", "path of a robot file"),
    ("robot", ".", "path of a robot file"),
    ("robot", {"name": "inline"}, "path of a robot file"),
    ("payload", -1.0, "kg, greater than 0"),
    ("payload", "heavy", "kg, greater than 0"),
    ("start", [0.45, 0.0], "three coordinates [x, y, z] in m"),
    ("start", 0.45, "three coordinates [x, y, z] in m"),
    ("goal", [0.45, "left", 0.0], "three coordinates [x, y, z] in m"),
    ("limits", 9.0, "some of the keys torque, speed"),
    ("limits.torque", [9.0], "N·m, greater than 0, or three"),
    ("limits.speed", 0.0, "rad/s, greater than 0, or three"),
    ("objective", "energy", "the word time"),
    ("objective", ["time", "effort"], "the word time"),
    ("duration", 0.3, "objective: effort, jerk or torque_rate beside it"),
    ("objective.effort", 0.0, "a weight of the effort in 1/(N²m²), greater than 0"),
    ("objective.time", "1 s", "a weight of the duration, greater than 0"),
]


OF_A_DRIVE = "a mapping with the key torque (N·m) and, if speeds are limited, speed (rad/s)"
MISSING = [
    ("robot", "name", "the robot's name"),
    ("robot", "base_radius", "a length in m"),
    ("robot", "upper_arm", "a mapping with the keys length"),
    ("robot", "forearm.mass", "a mass in kg"),
    ("robot", "drive", OF_A_DRIVE),
    ("robot", "drive.torque", "one torque in N·m"),
    ("scene", "robot", "the path of a robot file"),
    ("scene", "goal", "three coordinates"),
]
SCENE_KEYS = (
    "one of robot, payload, start, goal, via, approach, limits, rotation, path, tube, objective, "
    "keep_out, clearance, robot_keeps_clear, duration, tool"
)
UNKNOWN = [
    ("robot", "platfrom", "platform"),
    ("robot", "forearm.lenght", "length"),
    ("robot", "upper_arm.colour", "one of length, mass, inertia, centre, radius"),
    ("scene", "limits.sped", "speed"),
    *(("scene", key, SCENE_KEYS) for key in ("mesh", "<<", "5")),
]


@pytest.mark.parametrize(
    ("file", "key", "value", "problem", "expected"),
    [("robot", key, value, f"is {value!r}", told) for key, value, told in BAD_IN_ROBOT]
    + [("scene", key, value, f"is {value!r}", told) for key, value, told in BAD_IN_SCENE]
    + [(file, key, ABSENT, f"is missing; expected {told}", told) for file, key, told in MISSING]
    + [
        (file, key, 1.0, f"is not a known key; expected {told}", told)
        for file, key, told in UNKNOWN
    ],
)
def test_a_bad_value(
    tmp_path: Path, file: str, key: str, value: object, problem: str, expected: str
) -> None:
    """At a key of one of both files, which the error names."""
    if file == "robot":
        written = write(tmp_path, robot=changed(ROBOT, key, value))
    else:
        weighted = SCENE | {"objective": WEIGHTED} if key.startswith("objective.") else SCENE
        written = write(tmp_path, scene=changed(weighted, key, value))
    error = error_of(written)
    assert (error.file, error.key) == (tmp_path / f"{file}.yaml", key)
    assert error.value == (None if value is ABSENT else value)
    assert expected in error.expected
    assert error.expected == expected or "not a known key" not in problem
    assert f": {key} {problem}" in str(error)


@pytest.mark.parametrize(
    "written", ["", "null", "yes", ".nan", "1:30", "1_0", "0x10", "1,5", "1e999"]
)
def test_what_only_yaml_takes_for_a_number_is_text(tmp_path: Path, written: str) -> None:
    """And what is too large for a float is infinite."""
    file = write(tmp_path)
    file.write_text(file.read_text().replace("payload: 1.0", f"payload: {written}"))
    error = error_of(file)
    value = float("inf") if written == "1e999" else written
    assert (error.file, error.key, error.value) == (file, "payload", value)


def test_a_long_value_is_shortened_in_the_message_only(tmp_path: Path) -> None:
    value = [1.0] * 1000
    error = error_of(write(tmp_path, scene=changed(SCENE, "start", value)))
    assert error.value == value
    assert len(str(error)) < 250 + len(str(tmp_path))


# --- keys ---------------------------------------------------------------------------------


def test_a_misspelt_key_is_named_rather_than_the_key_it_leaves_missing(tmp_path: Path) -> None:
    robot = changed(changed(ROBOT, "forearm.mass", ABSENT), "forearm.masss", 0.25)
    error = error_of(write(tmp_path, robot=robot))
    assert (error.key, error.value, error.expected) == ("forearm.masss", 0.25, "mass")


def test_a_key_given_twice(tmp_path: Path) -> None:
    file = write(tmp_path)
    text = file.read_text().replace("torque: 9.0", "torque: 9.0\n  torque: 8.0")
    file.write_text(text)
    line = text.splitlines().index("  torque: 8.0") + 1
    error = error_of(file)
    assert (error.file, error.key, error.value) == (file, "limits.torque", 8.0)
    assert f": limits.torque is given again in line {line}; expected each key once" in str(error)


# --- files that are no scene --------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "is empty"),
        (b"robot: [1, 2\npayload: 3\n", "is not valid YAML (line 2, column 8: "),
        (b"robot: a\n---\nrobot: b\n", "is not valid YAML (line 2, column 1: "),
        (b"robot: \x01\n", "is not valid YAML (it contains a control character)"),
        (b"robot: caf\xe9\n", "is not UTF-8 text (byte 10)"),
        (b"robot: &here a\nstart: *here\n", "uses an alias or a tag (line 2)"),
        (b"robot: !!python/name:os.system a\n", "uses an alias or a tag (line 1)"),
        (b"robot: a\nstart: " + 50_000 * b"[", "is nested too deeply (line 2)"),
        (b"? [1, 2]\n: 3\n", "has a key that is no word (line 1)"),
        (b'robot: a\n"two\\nlines": 3\n', "has a key that is no word (line 2)"),
    ],
)
@pytest.mark.parametrize("name", ["scene.yaml", "robot.yaml"])
def test_a_file_that_cannot_be_parsed(
    tmp_path: Path, name: str, content: bytes, problem: str
) -> None:
    scene_file = write(tmp_path)
    (tmp_path / name).write_bytes(content)
    error = error_of(scene_file)
    assert (error.file, error.key, error.value) == (tmp_path / name, "", None)
    assert str(error).startswith(f"{tmp_path / name} {problem}")


@pytest.mark.parametrize(("content", "value"), [("- a\n- 1\n", ["a", 1.0]), ("0\n", 0.0)])
def test_a_file_that_is_no_mapping(tmp_path: Path, content: str, value: object) -> None:
    scene_file = write(tmp_path)
    scene_file.write_text(content)
    error = error_of(scene_file)
    assert (error.file, error.key, error.value) == (scene_file, "", value)
    assert error.expected == "a mapping of keys to values"
    assert str(error).startswith(
        f"{scene_file} is {'a list' if value else 'a single value'}; expected"
    )


def test_a_robot_file_in_place_of_a_scene_file_and_the_reverse(tmp_path: Path) -> None:
    scene_file = write(tmp_path)
    robot_file = tmp_path / "robot.yaml"
    with pytest.raises(SceneError, match=r"is a robot file; expected a scene file"):
        load_scene(robot_file)
    with pytest.raises(SceneError, match=r"is a scene file; expected the robot file"):
        load_robot(scene_file)


@pytest.mark.parametrize(("name", "kind"), [("design/gear", "design"), ("sweeps/higher", "sweep")])
def test_a_file_of_another_kind_names_its_command(name: str, kind: str) -> None:
    with pytest.raises(SceneError, match=rf"is a {kind} file; expected .*deltaopt {kind} takes"):
        load_scene(PROBLEMS / f"{name}.yaml")


@pytest.mark.parametrize(
    ("name", "reason"),
    [("nowhere.yaml", "No such file"), (".", "Is a directory"), ("scene.yaml/x", "Not a dir")],
)
def test_a_file_that_cannot_be_read(tmp_path: Path, name: str, reason: str) -> None:
    write(tmp_path)
    error = error_of(tmp_path / name)
    assert error.file == tmp_path / name
    assert f"{tmp_path / name} cannot be read ({reason}" in str(error)


def test_a_huge_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text("a: 1\n" * 200_001)
    assert "scene.yaml is larger than 1 MB; expected" in str(error_of(file))


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        ("a: [" + "1," * 400_000 + "]", "has too many values (line 1)"),
        ("".join(f"k{i}: 1\n" for i in range(19_000)), "has too many values (line "),
        ("a: |\n" + " x\n" * 300_000, "has more than 20000 lines"),
    ],
)
def test_a_long_file_is_refused_soon(tmp_path: Path, content: str, problem: str) -> None:
    """Parsing these took 10 s to a minute, though they have less than 1 MB."""
    file = tmp_path / "robot.yaml"
    file.write_text(content, encoding="utf-8")
    assert len(content) < 1e6
    with pytest.raises(SceneError) as told:
        load_robot(file)
    assert problem in str(told.value)


@pytest.mark.parametrize("key", ["a\nb", "\x1e", "\u2028"])
def test_a_key_with_a_line_break_is_quoted(key: str) -> None:
    with pytest.raises(SceneError) as told:
        Scene(**{key: 1.0})
    assert str(told.value).startswith(f"{key!r} is not a known key")


def test_a_file_with_a_line_break_is_quoted(tmp_path: Path) -> None:
    with pytest.raises(SceneError) as told:
        load_scene(tmp_path / "a\nb.yaml")
    assert len(str(told.value).splitlines()) == 1


def test_an_array_is_no_objective() -> None:
    """It compares by elements, which was an error of pydantic's."""
    scene = {"start": (0.45, 0.0, 0.0), "goal": (0.45, 0.1, 0.0)}
    with pytest.raises(SceneError, match=r"^objective is array"):
        Scene(robot=Robot.model_validate(ROBOT), **scene, objective=np.zeros(0))


def test_a_pipe_is_refused_at_once(tmp_path: Path) -> None:
    """Opening it would wait for ever."""
    os.mkfifo(tmp_path / "pipe.yaml")
    assert "pipe.yaml is not a regular file; expected" in str(error_of(tmp_path / "pipe.yaml"))


# --- what single values cannot tell -------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("limits.torque", 10.5, "at most what the drive gives, 10, 11, 12 N·m"),
        ("limits.speed", (7.0, 9.0, 7.0), "at most what the drive gives, 8 rad/s"),
    ],
)
def test_a_scene_cannot_exceed_the_drive(
    tmp_path: Path, key: str, value: float | tuple[float, ...], expected: str
) -> None:
    written = list(value) if isinstance(value, tuple) else value
    error = error_of(write(tmp_path, scene=changed(SCENE, key, written)))
    assert (error.file, error.key, error.value) == (tmp_path / "scene.yaml", key, value)
    assert error.expected == expected


@pytest.mark.parametrize(
    "inertia", [[0.005, 0.005, 0.0101], [0.0101, 0.005, 0.005], [0.0, 0.005, 0.0051]]
)
def test_no_body_has_such_moments_of_inertia(tmp_path: Path, inertia: list[float]) -> None:
    error = error_of(write(tmp_path, robot=changed(ROBOT, "forearm.inertia", inertia)))
    assert (error.file, error.key) == (tmp_path / "robot.yaml", "forearm.inertia")
    assert error.value == tuple(inertia)
    assert "kg·m²" in error.expected


@pytest.mark.parametrize("inertia", [[0.001, 0.009, 0.01], [0.0, 0.005, 0.005], [0.0, 0.0, 0.0]])
def test_flat_bodies_and_points_have_moments_of_inertia(inertia: list[float]) -> None:
    # In floats 2 × 0.01 exceeds 0.001 + 0.009 + 0.01.
    robot = Robot.model_validate(changed(ROBOT, "forearm.inertia", inertia))
    assert robot.forearm.inertia == tuple(inertia)


def closes_somewhere(robot: Robot) -> bool:
    """Search the workspace for a point where each chain's end is within reach of its elbow."""
    arm, forearm = robot.upper_arm.length, robot.forearm.length
    offset = robot.base_radius - robot.platform_radius
    across, down = np.linspace(-1.5, 1.5, 61), np.linspace(0.0, 1.5, 61)
    x, y, z = np.meshgrid(down, across, across, indexing="ij")
    within = np.full(x.shape, True)
    for azimuth in (0, 2 * np.pi / 3, -2 * np.pi / 3):
        radial = y * np.cos(azimuth) + z * np.sin(azimuth) - offset
        lateral = z * np.cos(azimuth) - y * np.sin(azimuth)
        distance = np.hypot(radial, x)  # from the motor's axis, in the arm's plane
        within &= np.hypot(distance - arm, lateral) <= forearm
        within &= np.hypot(distance + arm, lateral) >= forearm
    return bool(within.any())


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(("forearm", "closes"), [(0.25, False), (0.29, False), (0.31, True)])
def test_the_forearm_must_bridge_the_gap(swapped: bool, forearm: float, closes: bool) -> None:
    base, platform = (0.1, 0.6) if swapped else (0.6, 0.1)  # gap 0.5 − 0.2 = 0.3
    good = Robot.model_validate(ROBOT | {"base_radius": base, "platform_radius": platform})
    lengths = good.forearm.model_copy(update={"length": forearm})
    assert closes_somewhere(good.model_copy(update={"forearm": lengths})) is closes
    content = changed(good.model_dump(), "forearm.length", forearm)
    if closes:
        assert Robot.model_validate(content).forearm.length == forearm
        return
    with pytest.raises(SceneError) as caught:
        Robot.model_validate(content)
    assert (caught.value.key, caught.value.value) == ("forearm.length", forearm)
    assert "a length in m greater than 0.3," in caught.value.expected


def test_a_robot_that_closes_only_stretched_flat_cannot_move() -> None:
    radii = {"base_radius": 0.75, "platform_radius": 0.25}  # exact in binary
    content = changed(ROBOT | radii, "upper_arm.length", 0.25)
    with pytest.raises(SceneError, match=r"^forearm\.length is 0\.25; "):
        Robot.model_validate(changed(content, "forearm.length", 0.25))


# Where it stands


@pytest.mark.parametrize(
    ("text", "place", "problem"),
    [
        ("robot: {robot}\nstart: [0, 0, 0]\npayload:   -1\n", "line 3, column 12", "payload is -1"),
        ("robot: {robot}\nlimits:\n  torque: 5\n  speed: x\n", "line 4, column 10", "limits.speed"),
        ("robot: {robot}\nlimits: {{torqe: 5}}\n", "line 2, column 17", "limits.torqe is not a"),
        ("payload: 1\nrobot: nowhere.yaml\n", "line 2, column 8", "robot is 'nowhere.yaml', which"),
    ],
)
def test_errors_say_where_in_the_file(text, place, problem, tmp_path):
    robot = PROBLEMS / "robots/orsino.yaml"
    file = tmp_path / "scene.yaml"
    ends = "start: [0.45, -0.05, 0]\ngoal: [0.45, 0.1, 0]\n"
    lines = text.format(robot=robot)
    file.write_text(lines + (ends if "start" not in lines else ends.splitlines()[1]))
    with pytest.raises(SceneError) as told:
        load_scene(file)
    assert str(told.value).startswith(f"{file}, {place}: {problem}")


def test_a_scene_made_of_a_scene_is_the_same():
    """Also after what is computed once was asked for."""
    scene = load_scene("problems/keep_out/wall_25_305_25.yaml")
    assert scene.obstacles
    assert scene.task.is_at_rest
    assert hash(scene) == hash(scene.model_copy())
    assert Scene(**dict(scene)) == scene


def test_what_is_missing_is_missing_in_its_mapping(tmp_path):
    file = tmp_path / "robot.yaml"
    text = (PROBLEMS / "robots/orsino.yaml").read_text(encoding="utf-8")
    file.write_text(text.replace("{length: 0.20, mass: 0.40}", "{length: 0.20}"), encoding="utf-8")
    line = next(i for i, each in enumerate(text.splitlines(), 1) if each.startswith("upper_arm"))
    with pytest.raises(SceneError, match=f"line {line}, column 12: upper_arm.mass is missing"):
        load_robot(file)
    file.write_text(text.replace("platform:  {mass: 0.30}", ""), encoding="utf-8")
    with pytest.raises(SceneError, match=r"robot.yaml: platform is missing"):
        load_robot(file)


@pytest.mark.parametrize(
    ("body", "key", "place"),
    [
        ("box: {from: [1, 2, 3], to: [1, 5, 6]}", "keep_out[2].box.to", "line 4, column 32"),
        ("sphere: {centre: [1, 2, 3]}", "keep_out[2].sphere.radius", "line 4, column 13"),
        ("hull: {file: none.stl}", "keep_out[2].hull.file", "line 4, column 18"),
        ("{}", "keep_out[2]", "line 4, column 5"),
    ],
)
def test_a_body_that_cannot_be_used_is_named_by_its_place_in_the_list(
    tmp_path: Path, body: str, key: str, place: str
) -> None:
    file, good = write(tmp_path), "  - sphere: {centre: [2, 0, 0], radius: 0.1}\n"
    rest = file.read_text(encoding="utf-8")
    file.write_text(f"keep_out:\n{good}{good}  - {body}\n{rest}", encoding="utf-8")
    error = error_of(file)
    assert (error.key, error.place) == (key, place)


@pytest.mark.parametrize(
    "name", ["moving/belt.yaml", "paths/industrial_25_305_25.yaml", "via/onto_a_belt.yaml"]
)
def test_what_is_written_of_a_scene_is_the_same_after_planning(name):
    """Caches compute hashes of its records, which pydantic counts as fields where it has to choose
    between kinds of records."""
    scene = load_scene(PROBLEMS / name)
    written = scene.model_dump(mode="json")
    for record in (scene.goal, scene.path, *(scene.via or ())):
        hash(record)
    assert scene.model_dump(mode="json") == written
