"""Changes by dotted keys, and how a cell is moved."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import deltaopt
from deltaopt.errors import SceneError
from deltaopt.scene.scene_file import content_with_files, made_of
from deltaopt.sensitivity.keys import changed, in_si, unit_of
from deltaopt.sweeps.sweep_file import load_sweep

MOVED = (0.01, -0.02, 0.03)
SCENES = [
    "problems/pick_and_place.yaml",
    "problems/keep_out/into_a_box.yaml",
    "problems/keep_out/beside_a_column.yaml",
    "problems/moving/belt.yaml",
    "problems/via/within.yaml",
    "problems/paths/safe_lane.yaml",
    "problems/cycles/cell.yaml",
]


def elsewhere(scene):
    """A scene whose robot stands elsewhere: all points of it, (N, 3), m."""
    content = scene.model_dump(mode="json", exclude={"robot"}, exclude_none=True)
    found = []

    def look(node, key):
        if isinstance(node, dict):
            for name, each in node.items():
                look(each, name)
        elif (
            isinstance(node, list) and len(node) == 3 and key not in ("velocity", "belt", "normal")
        ):
            if all(isinstance(each, int | float) for each in node):
                found.append(node)
                return
            for each in node:
                look(each, key)
        elif isinstance(node, list) and key not in ("velocity", "belt", "normal"):
            for each in node:
                look(each, key)

    look(content, "")
    return np.array(found)


@pytest.mark.parametrize("name", SCENES)
def test_who_changes_the_place_moves_all_points_of_the_cell(name):
    content = content_with_files(name)
    changes = {f"place.{axis} plus": by for axis, by in zip("xyz", MOVED, strict=True)}
    before, after = (made_of(each, Path(name)) for each in (content, changed(content, changes)))
    legs = ([each] if isinstance(each, deltaopt.Scene) else each.legs for each in (before, after))
    for one, other in zip(*legs, strict=True):
        assert elsewhere(other) - elsewhere(one) == pytest.approx(
            np.tile(MOVED, (len(elsewhere(one)), 1))
        )
        assert other.robot == one.robot
        assert other.limits == one.limits


def test_a_content_with_files_is_the_scene_of_the_file():
    for name in SCENES[:-1]:
        assert made_of(content_with_files(name), Path(name)) == deltaopt.load_scene(name)
    assert made_of(content_with_files(SCENES[-1]), Path()) == deltaopt.load_cycle(SCENES[-1])


def test_units_are_known_and_several_keys_change_together():
    curve = [["0 rpm", "20 N*m"], ["3000 rpm", "10 N*m"]]
    content = {
        "payload": "315 g",
        "robot": {"base_radius": "10 cm", "drive": {"torque_curve": curve}},
        "start": ["10 cm", 0, 0],
        "goal": [0.3, 0, 0],
    }
    times = "robot.base_radius robot.drive.torque_curve times"
    found = changed(content, {"payload plus": 0.02, times: 3.0, "d.e": "word", "place.x": 1.0})
    assert found["payload"] == pytest.approx(0.335)
    assert found["robot"]["base_radius"] == pytest.approx(0.3)
    speeds = np.pi * np.array([0.0, 300.0])
    assert np.array(found["robot"]["drive"]["torque_curve"]) == pytest.approx(
        np.column_stack([speeds, [60.0, 30.0]])
    )
    assert found["d"] == {"e": "word"}
    assert np.ravel([found["start"], found["goal"]]) == pytest.approx([0.9, 0, 0, 1.1, 0, 0])
    assert content["payload"] == "315 g"


def test_shares_and_lists_stay_what_the_file_makes_of_them(tmp_path):
    """The torques of this scene are a share of the drive's; a row of a curve has no unit."""
    file, values = tmp_path / "sweep.yaml", ["80 %", 6.0]
    file.write_text(f"{SCENE}grid: {{limits.torque: [80 %, 6 N*m]}}\n", encoding="utf-8")
    _, points = load_sweep(file)
    assert [change["limits.torque"] for change in points.axes[0]] == values
    row = "robot.drive.torque_curve.2"
    assert in_si(row, ["3000 rpm", "10 N*m"]) == pytest.approx([100 * np.pi, 10.0])
    assert unit_of(row) == ""


SCENE = f"scene: {Path('problems/pick_and_place.yaml').resolve()}\n"
WRONG = [
    ("grid: {robot.drive.torqe: [1, 2]}", "robot.drive.torqe is not a known key; expected torque"),
    ("grid: {robot.drive.speed times: [1, 2]}", "robot.drive.speed is not given in the file"),
    ("grid: {payload: [heavy, light]}", "payload is 'light'; expected a mass in kg"),
    ("grid: {goal.3: [1]}", "goal.3 has no part 3; expected a place in a list of 3"),
    ("grid: {payload: 1}", "grid.payload is 1.0; expected a list of values, or {from, to, steps}"),
    ("grid: {payload: {from: 1, to: 2, steps: 1}}", "grid.payload.steps is 1.0; expected a whole"),
    ("grid: {payload: {from: 2, to: 1, steps: 3}}", "grid.payload is .*the first the lesser"),
    (
        "grid: {robot.upper_arm.length: [300 mm, 310 g]}",
        "robot.upper_arm.length is '310 g', which cannot be converted to m; expected a number in m",
    ),
    (
        "points: [{robot.forearm.mass robot.forearm.length plus: 20 g}]",
        "which cannot be converted to m",
    ),
    (
        "samples: {number: 3, ranges: {payload times: {from: 1 kg, to: 2 kg}}}",
        "which cannot be converted to a number without unit",
    ),
    ("grid: {robot.upper_arm.length: [300]}", "mm need a unit: 300 mm"),
    ("gird: {payload: [1]}", "gird is not a known key; expected grid"),
    ("column: durations", "column is 'durations'; expected one of duration"),
    ("column: limited_by", "column is 'limited_by'; expected one of duration"),
    ("pareto: [duration, duration]", "pareto is .*; expected two columns that differ"),
    ("grid: {payload: [1, 2], payload times: [1, 2]}", "payload is changed twice; expected one"),
    ("grid: {payload: [1, 2]}\npoints: [{payload: 3}]", "payload is changed twice; expected one"),
    (
        "points: [{payload: 3}]\nsamples: {number: 3, ranges: {payload: {from: 1, to: 2}}}",
        "payload is changed twice; expected one change of each key",
    ),
    (
        "grid: {'goal[1]': [0.1, 0.12], goal.01 plus: [0.01]}",
        r"goal\[1\] is changed by goal.01 too; expected one change of each key",
    ),
    ("grid: {'goal[1]': [0.1], goal: [[0.45, 0.1, 0]]}", r"goal\[1\] is changed by goal too"),
    (
        "grid: {robot.drive: [{}]}\npoints: [{robot.drive.torque: 9}]",
        "is changed by robot.drive.tor",
    ),
    ("grid: {goal.²: [1]}", "goal.² has no part ²; expected a place in a list of 3"),
    (
        "scene: []",
        r"scene is \[\]; expected the path of a file .* or a list of one of them at least",
    ),
    ("robot: []", r"robot is \[\]; expected the path of a file"),
    ("tolerance: 1e-20", "tolerance is 1e-20; expected a number from 1e-09 to 1"),
    ("tolerance: 2", "tolerance is 2.0; expected a number from 1e-09 to 1"),
    (
        "column: limits.torque\ngrid: {limits.torque: [85 %, 9]}",
        "column is 'limits.torque'; expected one of duration, .*, columns of numbers",
    ),
    ("pareto: [duration, goal]\npoints: [{goal: [0.45, 0.1, 0]}]", "pareto is 'goal'; expected"),
    ("samples: {number: 3}", "samples.ranges is missing; expected a mapping of keys"),
    (
        "samples: {number: 0, ranges: {payload: {from: 1, to: 2}}}",
        "samples.number is 0.0; expected",
    ),
    ("robot: nowhere.yaml", "nowhere.yaml"),
    ("grid: {robot: [nowhere.yaml]}", "robot is 'nowhere.yaml'; expected keys of a robot; a sweep"),
    ("points: [{robot: 3}]", "robot is 3.0; expected keys of a robot; a sweep names files"),
    ("grid: {payload times: [[1, 2]]}", r"payload times is \[1.0, 2.0\]; expected one number, by"),
    (
        "points: [{payload plus: [1, 2]}]",
        r"payload plus is \[1.0, 2.0\]; expected one number in kg",
    ),
    ("grid: {payload times: [abc, 1.0]}", "payload times is 'abc'; expected one number, by which"),
    (
        "grid: {limits.torque plus: [10 %, 5]}",
        r"limits.torque plus is '10 %'; expected one .* N\*m",
    ),
    ("points: [{place.x: abc}, {place.x: 1}]", "place.x is 'abc'; expected one number in m, by"),
    ("grid: {times: [1, 2]}", "times names no key to change; expected a key, such as payload"),
    ("points: [{plus: 1}]", "plus names no key to change"),
    ("points: [{payload: 1, place.w: 2}]", "place.w is not a known key; expected place.x"),
]


@pytest.mark.parametrize(("text", "told"), WRONG)
def test_what_a_sweep_cannot_use_is_told_in_a_sentence(text, told, tmp_path):
    file = tmp_path / "sweep.yaml"
    file.write_text(f"{'' if 'scene' in text else SCENE}{text}\n")
    with pytest.raises(SceneError, match=told) as raised:
        load_sweep(file)
    assert "\n" not in str(raised.value)
    assert raised.value.file is not None


def test_samples_are_spread_evenly_and_always_the_same(tmp_path):
    file = tmp_path / "sweep.yaml"
    ranges = "{payload: {from: 500 g, to: 1 kg}, robot.drive.torque: {from: 8, to: 12}}"
    for method in ("sobol", "latin_hypercube"):
        file.write_text(SCENE + f"samples: {{number: 16, method: {method}, ranges: {ranges}}}\n")
        points = [[*task.changes.values()] for task in load_sweep(file)[1]]
        assert points == [[*task.changes.values()] for task in load_sweep(file)[1]]
        sixteenths = (np.array(points) - [0.5, 8]) / [0.5, 4] * 16
        for column in sixteenths.T:
            assert sorted(column.astype(int)) == list(range(16))


def test_keys_of_lists_are_those_of_sensitivities():
    content = content_with_files(SCENES[1])
    named = changed(content, {"keep_out[0].box.from[1] plus": -0.01, "goal[2]": 0.02})
    assert named == changed(content, {"keep_out.0.box.from.1 plus": -0.01, "goal.2": 0.02})
    scene = made_of(named, Path(SCENES[1]))
    assert scene.goal[2] == 0.02
    keys = {one.number.key: one.number.value for one in deltaopt.plan(scene).sensitivity()}
    assert keys["keep_out[0].box.from[1]"] == pytest.approx(0.07)


def test_keys_of_lists_may_stand_in_files(tmp_path):
    scene = Path("problems/keep_out/wall_25_305_25.yaml").absolute()
    file = tmp_path / "sweep.yaml"
    file.write_text(f"scene: {scene}\ngrid:\n  keep_out[0].box.from[0] plus: [-5 mm, 5 mm]\n")
    _, points = load_sweep(file)
    assert points.keys == ["keep_out[0].box.from[0] plus"]
    assert len(points) == 2
