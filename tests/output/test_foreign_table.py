"""Tables that someone else made: read, interpolated, measured."""

from __future__ import annotations

import re

import numpy as np
import pytest

import deltaopt
from deltaopt.cli import main
from deltaopt.output.foreign_table import UnreadableTable, read_foreign_table
from deltaopt.output.joint_table import Cubic, Cycles, Quintic, checked_table
from deltaopt.output.table_files import DEGREES, of_controller, write_table
from deltaopt.robot.model import delta_model
from studies.problems import ORSINO, PROBLEMS

SCENE = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
ROBOT = SCENE.robot.model_copy(update={"joints": {"zero": 0.09, "sign": (1.0, -1.0, 1.0)}})
MODEL = delta_model(ROBOT, SCENE.payload)


@pytest.fixture(scope="module")
def plan():
    return deltaopt.plan(SCENE)


def write(file, columns):
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(repr(float(v)) for v in row) for row in rows)]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


@pytest.mark.parametrize("interpolation", [Cubic(), Quintic()], ids=lambda i: i.name)
def test_our_own_table_asks_for_what_the_export_said(plan, tmp_path, capsys, interpolation):
    """Through a file in the controller's degrees: the same peak as of the joint polynomials."""
    checked = checked_table(SCENE, plan.trajectory, Cycles(1e-3), interpolation)
    write_table(tmp_path / "table.csv", of_controller(checked.table, ROBOT), DEGREES)
    content = ROBOT.model_dump(mode="json", exclude_none=True)
    robot = tmp_path / "robot.yaml"
    robot.write_text(str(content), encoding="utf-8")  # YAML's flow style
    words = ["--robot", str(robot), "--payload", str(SCENE.payload), "--unit", "deg"]
    words += ["--controller", interpolation.name, "--controller-angles"]
    assert main(["verify", str(tmp_path / "table.csv"), *words]) == 1
    said = capsys.readouterr().out
    line = next(line for line in said.splitlines() if line.startswith("  torque:"))
    assert "beyond its limit" in line
    percent = float(line.split("(")[1].split(" %")[0])
    assert percent / 100 == pytest.approx(checked.demand.share - 1, rel=0.01)
    assert f"{checked.demand.subject} at t = {checked.demand.t:.3g}"[:18] in line
    assert "RMS torque" in said
    assert "parallel singularity" in said


def test_angles_are_the_models_unless_said_and_that_is_said(plan, tmp_path, capsys):
    """A robot whose controller counts otherwise, and its own table taken for the model's."""
    robot, table = tmp_path / "robot.yaml", tmp_path / "table.csv"
    robot.write_text(str(ROBOT.model_dump(mode="json", exclude_none=True)), encoding="utf-8")
    checked = checked_table(SCENE, plan.trajectory, Cycles(1e-3), Quintic())
    write_table(table, checked.table, DEGREES)
    words = ["verify", str(table), "--robot", str(robot), "--unit", "deg"]
    main([*words, "--payload", "1000 g"])
    in_grams = capsys.readouterr()
    assert "with --controller-angles as the controller's" in in_grams.err
    main([*words, "--payload", "1"])
    assert capsys.readouterr().out == in_grams.out
    main([*words, "--controller-angles"])
    assert "--controller-angles" not in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main([*words, "--payload", "1 m"])
    assert "'1 m' cannot be converted to kg" in capsys.readouterr().err


def test_positions_alone_are_the_motion_they_were_sampled_from(tmp_path):
    """The spline of a smooth motion from rest to rest converges with the fourth power of steps."""
    line = deltaopt.baseline(SCENE)
    errors = []
    for count in (20, 40, 80):
        t = np.linspace(0, line.duration, count + 1)
        x = line(t).x
        file = write(tmp_path / "x.csv", {"t": t, "x": x[:, 0], "y": x[:, 1], "z": x[:, 2]})
        found = read_foreign_table(file).trajectory(MODEL)
        between = np.linspace(0, line.duration, 501)
        errors.append(np.abs(found(between).x - line(between).x).max())
    assert errors[0] / errors[1] > 8
    assert errors[1] / errors[2] > 8
    assert errors[2] < 1e-6


def test_angles_with_all_rates_are_followed_exactly(tmp_path):
    line = deltaopt.baseline(SCENE)
    t = np.linspace(0, line.duration, 101)
    motion = line(t)
    columns = {"t": t}
    for name in ("theta", "dtheta", "ddtheta"):
        columns |= {f"{name}{k + 1}": getattr(motion, name)[:, k] for k in range(3)}
    found = read_foreign_table(write(tmp_path / "t.csv", columns)).trajectory(MODEL)
    between = np.linspace(0, line.duration, 777)
    np.testing.assert_allclose(found(between).x, line(between).x, atol=1e-10)
    np.testing.assert_allclose(found(between).tau, line(between).tau, atol=1e-4)


BAD = {
    "nothing": ("", "no t with"),
    "other columns": ("a,b\n1,2\n", "no t with theta1"),
    "short": ("t,x,y,z\n0,1,2,3\n", "has 1 rows"),
    "backwards": ("t,x,y,z\n0,1,2,3\n1,1,2,3\n0.5,1,2,3\n2,1,2,3\n", "from row 3 to row 4"),
    "ragged": ("t,x,y,z\n0,1,2,3\n1,1,2\n", "row 3 has 3 columns, the header 4"),
    "not finite": ("t,x,y,z\n0,1,2,nan\n1,1,2,3\n2,1,2,3\n3,1,2,3\n", "column z"),
    "no text": ("t,x,y,z\n\x00\n", "row 2|cannot be read"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_table_is_one_sentence(tmp_path, name):
    text, expected = BAD[name]
    file = tmp_path / "bad.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(UnreadableTable, match=expected) as error:
        read_foreign_table(file)
    assert "\n" not in str(error.value)


def test_a_plan_is_verified_again(plan, tmp_path, capsys):
    plan.save(tmp_path)
    assert main(["verify", str(tmp_path)]) == 0
    assert "torque excess" in capsys.readouterr().out
    assert main(["verify", str(tmp_path), "--robot", str(ORSINO)]) == 2
    assert "--robot is for a TABLE.csv" in capsys.readouterr().err
    assert main(["verify", str(tmp_path / "trajectory.csv")]) == 2
    assert "--robot ROBOT" in capsys.readouterr().err


MOVES = "{t},0.45,0.0,0.0\n0.1,0.45,0.01,0.0\n0.2,0.45,0.02,0.0\n0.3,0.45,0.03,0.0\n"
TINY = {
    "steps of 1e-300 s": ("t,x,y,z\n0,0.45,0,0\n" + MOVES.format(t=1e-300), 1, "rows 2 and 3 are"),
    "the least number": ("t,x,y,z\n0,0.45,0,0\n" + MOVES.format(t=5e-324), 1, "less than 1e-12 s"),
    "all times the same": (
        "t,x,y,z,vx,vy,vz\n" + "1,0.45,0,0,0,0,0\n" * 4,
        1,
        "does not increase at all",
    ),
    "a motion of 1e-300 m": (
        "t,x,y,z\n0,0.45,0,0\n1,0.45,1e-300,0\n2,0.45,0,0\n3,0.45,0,0\n",
        1,
        "nothing moves in it",
    ),
    "a motion of 1e-160 m": (
        "t,x,y,z\n0,0.45,0,0\n1,0.45,1e-160,0\n2,0.45,0,0\n3,0.45,1e-160,0\n",
        0,
        "",
    ),
    "rates of 1e-300": (
        "t,x,y,z,vx,vy,vz\n0,.45,0,0,1e-300,0,0\n1,.45,0,0,0,1e-300,0\n2,.45,.01,0,0,0,0\n3,.45,0,0,0,0,0\n",
        0,
        "",
    ),
    "rates of 1e12": (
        "t,theta1,theta2,theta3,dtheta1,dtheta2,dtheta3\n0,0,0,0,0,0,1e12\n1e10,0,0,0,1e10,1e10,1e12\n"
        "2e10,0,0,0,1e10,1e10,0\n3e10,0,0,0,1e10,1e10,0\n",
        1,
        "the platform cannot be at|bars do not meet there",
    ),
}


@pytest.mark.parametrize("name", TINY)
def test_numbers_at_the_end_of_doubles(tmp_path, capsys, name):
    """A verdict or one sentence; a warning of overflow would fail the test."""
    text, code, sentence = TINY[name]
    file = tmp_path / "tiny.csv"
    file.write_text(text, encoding="utf-8")
    assert main(["verify", str(file), "--robot", str(ORSINO)]) == code
    captured = capsys.readouterr()
    assert re.search(sentence, captured.err)
    assert captured.err.count("\n") == bool(sentence)
    assert ("torque" in captured.out) == (not sentence)


def test_a_table_that_does_not_move(tmp_path, capsys):
    t = np.linspace(0, 1, 5)
    columns = {"t": t} | {axis: 0 * t + v for axis, v in zip("xyz", (0.45, 0, 0), strict=True)}
    file = write(tmp_path / "still.csv", columns)
    assert main(["verify", str(file), "--robot", str(ORSINO)]) == 1
    assert "nothing moves" in capsys.readouterr().err
