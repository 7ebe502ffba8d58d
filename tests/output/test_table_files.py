"""Joint tables in files, read back by others' programs."""

from __future__ import annotations

import csv
import errno
import json
import re
import shutil

import numpy as np
import pytest
import yaml
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

import deltaopt
from deltaopt.cli import main
from deltaopt.files.csv_table import read_csv
from deltaopt.output.cycle_files import verified
from deltaopt.output.plan_files import checksums
from deltaopt.report.folders import Drawn, save_cycle
from studies.problems import PROBLEMS

ZERO = 0.0929912


def at_controller(theta, *, rate=False):
    """θ = sign · angle - zero, solved for the angle."""
    return np.array([1, -1, 1]) * (theta if rate else theta + ZERO)


def test_csv_in_degrees(saved_otherwise, tmp_path, capsys):
    file = tmp_path / "table.csv"
    words = ["--controller", "cubic", "--cycle", "2ms", "--unit", "deg", "-o", str(file)]
    assert main(["export", "table", str(saved_otherwise), *words, "--anyway"]) == 0
    with file.open(encoding="utf-8") as lines:
        assert next(lines).startswith("# cubic interpolation asks for 1.")
        rows = list(csv.DictReader(lines))
    plan = deltaopt.load_plan(saved_otherwise)
    assert len(rows) == int(np.ceil(plan.duration / 2e-3)) + 1
    slowed = plan.trajectory.slowed(2e-3 * (len(rows) - 1) / plan.duration)
    t = np.array([float(row["t"]) for row in rows])
    motion = slowed(t)
    for name, rate in (("theta", False), ("dtheta", True), ("ddtheta", True)):
        found = np.array([[float(row[f"{name}{k}_deg"]) for k in "123"] for row in rows])
        expected = np.rad2deg(at_controller(getattr(motion, name), rate=rate))
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    assert "cubic interpolation asks for 1." in capsys.readouterr().out


def table_of(plan, file, *words):
    return main(["export", "table", str(plan), "-o", str(file), *words])


def test_a_moving_end_is_not_met_more_slowly_without_a_word(tmp_path, capsys):
    scene, folder = deltaopt.load_scene(PROBLEMS / "moving" / "belt.yaml"), tmp_path / "plan"
    deltaopt.plan(scene).save(folder, chart=False)
    file = tmp_path / "table.csv"
    assert table_of(folder, file) == 0
    assert "too slowly" not in capsys.readouterr().out
    assert table_of(folder, file, "--cycle", "1ms") == 1
    assert "meets it too late or too slowly" in capsys.readouterr().err
    assert not file.read_text(encoding="utf-8").startswith("#")
    assert table_of(folder, file, "--cycle", "1ms", "--keep-limits") == 0
    assert "meets it too late" in capsys.readouterr().out
    assert file.read_text(encoding="utf-8").startswith("# an end moves, and slowed")


def test_a_leg_at_rest_keeps_its_time_before_one_to_a_belt(tmp_path, capsys):
    """It was slowed unasked, after which the belt was met too late. Asked for, that is said of the
    legs on the belt."""
    scene = deltaopt.load_scene(PROBLEMS / "moving" / "belt.yaml")
    beside, start, part = (0.75, 0.0, 0.0), scene.start, scene.goal
    leaves = deltaopt.State(at=part.at, velocity=part.belt)
    ends = ((beside, start), (start, part), (leaves, beside))
    legs = [scene.model_copy(update={"start": a, "goal": b}) for a, b in ends]
    found = deltaopt.plan_cycle(deltaopt.Cycle(legs=legs), tolerance=1e-2)
    file, folder = tmp_path / "table.csv", tmp_path / "plan"
    save_cycle(folder, found, verified(found), 1000.0, Drawn(chart=False))
    assert table_of(folder, file) == 0
    assert read_csv(file).columns(["t"])[-1, 0] == pytest.approx(found.period, rel=1e-12)
    assert "too late" not in capsys.readouterr().out
    assert table_of(folder, file, "--cycle", "1ms") == 1
    assert "too late" in capsys.readouterr().err
    assert table_of(folder, file, "--cycle", "1ms", "--keep-limits") == 0
    assert capsys.readouterr().out.count("too late") == 2


@pytest.mark.parametrize("velocity", [(0.0, 2.0, -1.0), (0.0, 1.25, 0.0)])
def test_a_goal_that_is_passed_is_met_by_more_rows(velocity, tmp_path):
    """Rows at the knots alone ask for 1.00006 of the torque, and slowed the motion would pass the
    goal too slowly. Read back and measured by verification, and the goal is met."""
    industrial = PROBLEMS / "robots" / "industrial.yaml"
    goal = deltaopt.State(at=(0.85, 0.1, 0.05), velocity=velocity)
    robot, start = deltaopt.load_robot(industrial), (0.85, -0.1525, 0.0)
    plan = deltaopt.plan(deltaopt.Scene(robot=robot, payload=1.0, start=start, goal=goal))
    plan.save(tmp_path / "plan", chart=False)
    file = tmp_path / "table.csv"
    assert table_of(tmp_path / "plan", file) == 0
    measured = ["--robot", str(industrial), "--payload", "1", "--controller-angles"]
    assert main(["verify", str(file), *measured]) == 0
    last = np.genfromtxt(file, delimiter=",", names=True)[-1]
    assert last["t"] == pytest.approx(plan.duration, rel=1e-12)
    end = plan.trajectory(plan.duration)
    rates = [last[f"dtheta{k}"] for k in "123"]
    np.testing.assert_allclose(rates, end.dtheta, rtol=1e-12)


@pytest.mark.parametrize(
    ("controller", "cycle"),
    [("cubic", "own-knots"), ("cubic", "1ms"), ("quintic", "own-knots"), ("quintic", "4ms")],
)
def test_what_is_written_keeps_the_limits(controller, cycle, saved_otherwise, tmp_path, capsys):
    """Read back and measured by verification. What is not written has remedies that do it, and of
    which none is dearer than slowing this table."""
    file = tmp_path / "table.csv"
    words = ["--controller", controller, "--cycle", cycle]
    code = table_of(saved_otherwise, file, *words)
    said = capsys.readouterr().err
    assert code == ((controller, cycle) != ("quintic", "own-knots"))
    assert file.exists() == (code == 0)
    if code:
        found = re.findall(
            r"(--controller \S+ --cycle \S+ --keep-limits) \(.*?, (\S+) % slower", said
        )
        prices = [float(price) for _, price in found]
        assert prices == sorted(prices)
        assert found[0][0] == "--controller quintic --cycle own-knots --keep-limits"
        assert found[-1][0] == " ".join([*words, "--keep-limits"])
        words = found[0][0].split()
        assert table_of(saved_otherwise, file, *words) == 0
        duration = np.genfromtxt(file, delimiter=",", names=True)["t"][-1]
        slower = duration / deltaopt.load_plan(saved_otherwise).duration - 1
        assert 100 * slower == pytest.approx(prices[0], rel=0.05)
    robot = tmp_path / "robot.yaml"
    scene = deltaopt.load_plan(saved_otherwise).scene
    robot.write_text(str(scene.robot.model_dump(mode="json", exclude_none=True)), encoding="utf-8")
    measured = [str(file), "--robot", str(robot), "--payload", "1", "--controller-angles"]
    capsys.readouterr()
    assert main(["verify", *measured, "--controller", words[1]]) == 0


@pytest.fixture(scope="module")
def hurried(saved_otherwise, tmp_path_factory):
    """The folder of a plan that takes four fifths of its time."""
    content = json.loads((saved_otherwise / "plan.json").read_text(encoding="utf-8"))
    del content["checksums"]
    content["verification"]["ok"] = False
    motion = content["motion"]
    motion["knots"] = [0.8 * t for t in motion["knots"]]
    motion["position"] = [
        [[x / 0.8**power for x in row] for power, row in enumerate(piece)]
        for piece in motion["position"]
    ]
    content["duration"] = motion["knots"][-1] - motion["knots"][0]
    content["checksums"] = checksums(content)
    folder = tmp_path_factory.mktemp("hurried")
    (folder / "plan.json").write_text(json.dumps(content), encoding="utf-8")
    return folder


TARGETS = {
    "table": ("table.csv", "# "),
    "ros2": ("joints.yaml", "# "),
    "cam": ("twincat.st", "(* "),
    "c": ("plan.h", "/* "),
}


@pytest.mark.parametrize("target", TARGETS)
def test_a_plan_beyond_its_limits_is_for_those_who_insist(target, hurried, tmp_path, capsys):
    name, comment = TARGETS[target]
    file = tmp_path / name
    output = tmp_path if target in ("cam", "c") else file
    words = ["export", target, str(hurried), "-o", str(output)]
    assert main(words) == 1
    said = capsys.readouterr().err
    assert "exceeds its limit by" in said
    assert "--keep-limits (25 % slower)" in said
    assert not list(tmp_path.iterdir())
    assert main([*words, "--anyway"]) == 0
    assert file.read_text(encoding="utf-8").startswith(f"{comment}torque of motor ")
    for enough in ("--keep-limits",), ("--slower", "1.3"):
        assert main([*words, *enough]) == 0
        assert "exceeds" not in file.read_text(encoding="utf-8")[:400]


def test_a_plan_that_misses_its_goal_is_cured_by_no_slowing(saved_otherwise, tmp_path, capsys):
    content = json.loads((saved_otherwise / "plan.json").read_text(encoding="utf-8"))
    content["scene"]["goal"][1] -= 0.01
    plan, file = tmp_path / "plan.json", tmp_path / "table.csv"
    plan.write_text(json.dumps(content), encoding="utf-8")
    for words in (), ("--keep-limits",), ("--slower", "3"):
        assert table_of(plan, file, *words) == 1
        assert "it ends 0.01 m from the scene's goal" in capsys.readouterr().err
        assert not file.exists()
    assert table_of(plan, file, "--anyway") == 0
    assert "# it ends 0.01 m from the scene's goal" in file.read_text(encoding="utf-8")


@pytest.mark.parametrize("target", TARGETS)
def test_a_scene_that_was_edited_by_hand_is_told(target, saved_otherwise, tmp_path, capsys):
    """With more torque the motion keeps its limits all the more: the checksums alone tell."""
    content = json.loads((saved_otherwise / "plan.json").read_text(encoding="utf-8"))
    content["scene"]["robot"]["drive"]["torque"] *= 2
    plan, output = tmp_path / "plan.json", tmp_path / "out"
    plan.write_text(json.dumps(content), encoding="utf-8")
    words = ["export", target, str(plan), "-o", str(output / TARGETS[target][0])]
    for more in (), ("--keep-limits",):
        assert main([*words, *more]) == 1
        said = capsys.readouterr().err
        assert f"{plan}: changed since it was written: scene; nothing is written" in said
        assert not output.exists()
    assert main([*words, "--anyway"]) == 0


def test_a_slower_plan_for_a_first_run(saved_otherwise, tmp_path, capsys):
    """The same angles at three times the time; a third of the speed."""
    tables = []
    for factor in ("1", "3"):
        file = tmp_path / f"{factor}.csv"
        words = ["--slower", factor, "-o", str(file)]
        assert main(["export", "table", str(saved_otherwise), *words]) == 0
        tables.append(np.genfromtxt(file, delimiter=",", names=True))
    plain, slow = tables
    assert "3 times the plan's duration" in capsys.readouterr().out
    assert plain["t"][-1] == pytest.approx(deltaopt.load_plan(saved_otherwise).duration, rel=1e-3)
    np.testing.assert_allclose(slow["t"], 3 * plain["t"], rtol=1e-3)  # plain: as slow as limits ask
    np.testing.assert_allclose(slow["theta1"], plain["theta1"], rtol=1e-12)
    np.testing.assert_allclose(3 * slow["dtheta2"], plain["dtheta2"], rtol=1e-3, atol=1e-9)


def test_a_bag_that_does_not_fit_is_named(saved_otherwise, tmp_path, monkeypatch, capsys):
    def full(source, _):  # as shutil does, which names the file that it reads
        raise OSError(errno.ENOSPC, "no space", str(source))

    monkeypatch.setattr(shutil, "copyfile", full)
    bag = tmp_path / "bag"
    assert main(["export", "ros2", str(saved_otherwise), "-o", str(bag)]) == 2
    assert capsys.readouterr().err == f"deltaopt: {bag / 'bag.mcap'}: no space\n"


def test_ros2_yaml_and_bag_are_the_same_message(saved_otherwise, tmp_path):
    file, bag = tmp_path / "joints.yaml", tmp_path / "bag"
    for output in (file, bag):
        words = ["-o", str(output), "--joints", "j1", "j2", "j:3"]
        assert main(["export", "ros2", str(saved_otherwise), *words]) == 0
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
    plan = deltaopt.load_plan(saved_otherwise)
    assert times[0] == 0
    assert times[-1] == pytest.approx(1e9 * plan.duration, rel=1e-4)
    first = at_controller(plan.trajectory(0.0).theta)
    np.testing.assert_allclose(content["points"][0]["positions"], first, rtol=1e-12)


@pytest.mark.parametrize("cycle", ["1", "ms", "0ms", "1e9s", "-1ms", "own", "1ns", ""])
def test_a_cycle_that_is_none_is_refused(saved_otherwise, capsys, cycle):
    with pytest.raises(SystemExit) as end:
        main(["export", "table", str(saved_otherwise), "--cycle=" + cycle])
    assert end.value.code == 2
    assert "such as 1ms" in capsys.readouterr().err
