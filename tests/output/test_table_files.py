"""Joint tables in files, read back by others' programs."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
import yaml
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

import deltaopt
from deltaopt.cli import main
from studies.problems import PROBLEMS

ZERO = 0.0929912


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """The folder of a plan, of a robot whose controller counts motor 2 backwards."""
    folder = tmp_path_factory.mktemp("plan")
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    joints = {"zero": ZERO, "sign": [1, -1, 1]}
    robot = scene.robot.model_copy(update={"joints": joints})
    deltaopt.plan(scene.model_copy(update={"robot": robot})).save(folder)
    return folder


def at_controller(theta, *, rate=False):
    """θ = sign · angle - zero, solved for the angle."""
    return np.array([1, -1, 1]) * (theta if rate else theta + ZERO)


def test_csv_in_degrees(saved, tmp_path, capsys):
    file = tmp_path / "table.csv"
    words = ["--controller", "cubic", "--cycle", "2ms", "--unit", "deg", "-o", str(file)]
    assert main(["export", "table", str(saved), *words]) == 0
    with file.open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    plan = deltaopt.load_plan(saved)
    assert len(rows) == int(np.ceil(plan.duration / 2e-3)) + 1
    slowed = plan.trajectory.slowed(2e-3 * (len(rows) - 1) / plan.duration)
    t = np.array([float(row["t"]) for row in rows])
    motion = slowed(t)
    for name, rate in (("theta", False), ("dtheta", True), ("ddtheta", True)):
        found = np.array([[float(row[name + k]) for k in "123"] for row in rows])
        expected = np.rad2deg(at_controller(getattr(motion, name), rate=rate))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    said = capsys.readouterr().out
    assert "cubic interpolation asks for 1." in said
    assert "remedy: --controller quintic --cycle own-knots" in said


def test_a_moving_end_is_not_met_more_slowly_without_a_word(saved, tmp_path, capsys, monkeypatch):
    scene = deltaopt.load_scene(PROBLEMS / "moving" / "belt.yaml")
    plan = replace(deltaopt.load_plan(saved), scene=scene)
    monkeypatch.setattr("deltaopt.cli.export.load_plan", lambda folder: plan)
    words = ["export", "table", "plan", "-o", str(tmp_path / "table.csv")]
    assert main(words) == 0
    assert "too slowly" not in capsys.readouterr().out
    assert main([*words, "--cycle", "1ms"]) == 0
    assert "meets it too late and too slowly" in capsys.readouterr().out


def test_a_slower_plan_for_a_first_run(saved, tmp_path, capsys):
    """The same angles at three times the time; a third of the speed."""
    tables = []
    for factor in ("1", "3"):
        file = tmp_path / f"{factor}.csv"
        words = ["--slower", factor, "-o", str(file)]
        assert main(["export", "table", str(saved), *words]) == 0
        tables.append(np.genfromtxt(file, delimiter=",", names=True))
    plain, slow = tables
    assert "3 times the plan's duration" in capsys.readouterr().out
    np.testing.assert_allclose(slow["t"], 3 * plain["t"], rtol=1e-12)
    np.testing.assert_allclose(slow["theta1"], plain["theta1"], rtol=1e-12)
    np.testing.assert_allclose(3 * slow["dtheta2"], plain["dtheta2"], rtol=1e-9, atol=1e-9)


def test_limits_kept_are_said_without_a_remedy(saved, tmp_path, capsys):
    words = ["--keep-limits", "-o", str(tmp_path / "table.csv")]
    assert main(["export", "table", str(saved), *words]) == 0
    assert "remedy" not in capsys.readouterr().out


def test_ros2_yaml_and_bag_are_the_same_message(saved, tmp_path):
    file, bag = tmp_path / "joints.yaml", tmp_path / "bag"
    for output in (file, bag):
        words = ["-o", str(output), "--joints", "j1", "j2", "j:3"]
        assert main(["export", "ros2", str(saved), *words]) == 0
    content = yaml.safe_load(file.read_text(encoding="utf-8"))
    with Reader(bag) as reader:
        ((connection, _, raw),) = reader.messages()
    assert connection.topic == "/joint_trajectory"
    message = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr(raw, connection.msgtype)
    assert message.joint_names == content["joint_names"] == ["j1", "j2", "j:3"]
    assert len(message.points) == len(content["points"])
    times = []
    for mine, theirs in zip(content["points"], message.points, strict=True):
        for name in ("positions", "velocities", "accelerations"):
            np.testing.assert_array_equal(mine[name], getattr(theirs, name))
        since = mine["time_from_start"]
        assert (since["sec"], since["nanosec"]) == (
            theirs.time_from_start.sec,
            theirs.time_from_start.nanosec,
        )
        times.append(since["sec"] * 10**9 + since["nanosec"])
    assert (np.diff(times) > 0).all()  # a controller of ROS refuses others
    plan = deltaopt.load_plan(saved)
    assert times[0] == 0
    assert times[-1] == pytest.approx(1e9 * plan.duration, abs=2)
    first = at_controller(plan.trajectory(0.0).theta[0])
    np.testing.assert_allclose(content["points"][0]["positions"], first, rtol=1e-12)


@pytest.mark.parametrize("cycle", ["1", "ms", "0ms", "1e9s", "-1ms", "own", "1ns", ""])
def test_a_cycle_that_is_none_is_refused(saved, capsys, cycle):
    with pytest.raises(SystemExit) as end:
        main(["export", "table", str(saved), "--cycle=" + cycle])
    assert end.value.code == 2
    assert "such as 1ms" in capsys.readouterr().err


def test_a_folder_without_a_plan(tmp_path, capsys):
    assert main(["export", "ros2", str(tmp_path)]) == 1
    assert "no such file" in capsys.readouterr().err
