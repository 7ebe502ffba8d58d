"""Tables that someone else made: read, interpolated, measured."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import deltaopt
from deltaopt.cli import main
from deltaopt.output.foreign_table import UnreadableTable, read_foreign_table
from deltaopt.output.joint_table import CUBIC, QUINTIC, Rows, checked_table, table_within_limits
from deltaopt.output.table_files import COLUMNS, of_controller, write_table
from deltaopt.robot.model import delta_model
from studies.problems import ORSINO, PROBLEMS

SCENE = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
ROBOT = SCENE.robot.model_copy(update={"joints": {"zero": 0.09, "sign": (1.0, -1.0, 1.0)}})
MODEL = delta_model(ROBOT, SCENE.payload)


@pytest.fixture
def robot(tmp_path):
    """The file of the robot, in YAML's flow style."""
    file = tmp_path / "robot.yaml"
    file.write_text(str(ROBOT.model_dump(mode="json", exclude_none=True)), encoding="utf-8")
    return file


def write(file, columns):
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(repr(float(v)) for v in row) for row in rows)]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


@pytest.mark.parametrize("interpolation", [CUBIC, QUINTIC], ids=lambda i: i.name)
def test_our_own_table_asks_for_what_the_export_said(
    picked, robot, tmp_path, capsys, interpolation
):
    """Through a file in the controller's degrees: the same peak as of the joint polynomials."""
    checked = checked_table(SCENE, picked.trajectory, Rows(1e-3), interpolation)
    write_table(tmp_path / "table.csv", of_controller(checked.table, ROBOT), "deg")
    words = ["--robot", str(robot), "--payload", str(SCENE.payload)]  # columns name the unit
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


def test_angles_are_the_models_unless_said_and_that_is_said(picked, robot, tmp_path, capsys):
    """A robot whose controller counts otherwise, and its own table taken for the model's."""
    table = tmp_path / "table.csv"
    checked = checked_table(SCENE, picked.trajectory, Rows(1e-3), QUINTIC)
    write_table(table, checked.table, "deg")
    words = ["verify", str(table), "--robot", str(robot), "--unit", "deg"]
    main([*words, "--payload", "1000 g"])
    in_grams = capsys.readouterr()
    assert "with --controller-angles as the controller's" in in_grams.err
    main([*words, "--payload", "1"])
    assert capsys.readouterr().out == in_grams.out
    main([*words, "--controller-angles"])
    assert "--controller-angles" not in capsys.readouterr().err
    main([word.replace("deg", "rad") for word in words])
    assert f"--unit is rad, but columns of {table} are in deg" in capsys.readouterr().err
    text = table.read_text(encoding="utf-8")
    table.write_text(text.replace("_deg", ""), encoding="utf-8")  # as before columns named it
    main([*words, "--payload", "1"])
    assert capsys.readouterr().out == in_grams.out
    table.write_text(text.replace("theta2_deg", "theta2"), encoding="utf-8")
    main(words)
    assert "has a column theta2 beside theta1_deg" in capsys.readouterr().err
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


@pytest.mark.parametrize("change", ["place", "speed", "creeping"])
def test_rows_of_one_time_agree_but_for_accelerations(change, picked, tmp_path):
    """A robot is not 50 mm away, nor 0.4 m/s quicker, within no time, nor by many small steps."""
    m = picked.trajectory.inside_intervals([0.0, 1.0])
    t = np.repeat(picked.trajectory.knots, 2)[1:-1]
    columns = {"t": t}
    for name in ("x", "v", "a"):
        axes = zip("xyz", getattr(m, name).T.copy(), strict=True)
        columns |= {(axis if name == "x" else name + axis): values for axis, values in axes}
    assert (np.diff(columns["ay"])[1::2] != 0).any()
    read_foreign_table(write(tmp_path / "good.csv", columns))
    later = np.arange(len(t)) >= 16
    if change == "place":
        columns["y"] += 0.05 * later
    elif change == "speed":
        columns["vy"] += 0.4 * later
    else:
        columns["y"] += 1e-6 * (np.arange(len(t)) // 2)
    with pytest.raises(UnreadableTable, match="have the same time, but"):
        read_foreign_table(write(tmp_path / "bad.csv", columns))


PLAIN = "t,x,y,z\n0,0.45,0,0\n0.1,0.45,0.01,0\n0.2,0.45,0.02,0\n0.3,0.45,0.03,0\n"
EXCEL = {
    "byte order mark": "\ufeff" + PLAIN,
    "decimal commas": PLAIN.replace(",", ";").replace(".", ","),
    "tabs": PLAIN.replace(",", "\t"),
    "quotes and lines without entries": PLAIN.replace("0.1,", '"0.1",') + ",,,\n\n",
    "capitals and a remark": "# by hand\n" + PLAIN.replace("t,x", "T,X").replace("\n", "\r\n"),
}


@pytest.mark.parametrize("name", EXCEL)
def test_a_table_as_spreadsheets_write_it(name, tmp_path):
    file = tmp_path / "table.csv"
    file.write_bytes(EXCEL[name].encode())
    found = read_foreign_table(file)
    np.testing.assert_array_equal(found.t, [0, 0.1, 0.2, 0.3])
    np.testing.assert_array_equal(found.values[:, 1], [0, 0.01, 0.02, 0.03])
    assert found.rates is None


def test_columns_that_are_not_used_are_named(tmp_path, capsys):
    rows = [line + end for line, end in zip(PLAIN.split(), (",tau1", *",,,,"), strict=True)]
    file = tmp_path / "table.csv"
    file.write_text("\n".join(rows), encoding="utf-8")
    main(["verify", str(file), "--robot", str(ORSINO)])
    assert "columns that are not used: tau1\n" in capsys.readouterr().err


DAMAGES = {
    "time in ms": (lambda t, rows: (1e3 * t, rows), "speeds of theta1 over times give 1e\\+03 of"),
    "exchanged": (lambda t, rows: (t, rows[:, [1, 0, *range(2, 9)]]), "speeds of theta1 .* order"),
    "other signs": (lambda t, rows: (t, rows * np.repeat([1, -1, 1], 3)), "give -1 of the way"),
    "missing": (
        lambda t, rows: (np.delete(t, [50, 51]), np.delete(rows, [50, 51], axis=0)),
        "from line 51 to line 52 it is 0.003 s, elsewhere 0.001 s; are rows missing",
    ),
    "none": (lambda t, rows: (t, rows), ""),
}
CONTRADICT = ("time in ms", "exchanged", "other signs")


@pytest.mark.parametrize("name", DAMAGES)
def test_a_table_that_was_damaged_says_so(name, picked, robot, tmp_path, capsys):
    change, expected = DAMAGES[name]
    table = checked_table(SCENE, picked.trajectory, Rows(1e-3), QUINTIC).table
    t, rows = change(table.t, np.hstack([table.theta, table.dtheta, table.ddtheta]))
    columns = dict(zip(COLUMNS, np.column_stack([t, rows]).T, strict=True))
    file = write(tmp_path / "table.csv", columns)
    code = main(
        [
            "verify",
            str(file),
            "--robot",
            str(robot),
            "--payload",
            "1",
            "--json",
            "--controller",
            "cubic",
        ]
    )
    out, err = capsys.readouterr()
    said = [line for line in err.splitlines() if "table.csv" in line]
    assert re.search(expected, said[0]) if expected else not said
    told = json.loads(out) if out else {"ok": False, "doubts": None, "limits": []}
    assert not out or [f"{file}: {each}" for each in told["doubts"]] == said
    kept = all(each["value"] <= 1e-9 for each in told["limits"])
    assert told["ok"] == (kept and name not in CONTRADICT) == (code == 0)


@pytest.mark.parametrize(("first", "last"), [(40, None), (None, -40), (40, -40)])
def test_a_table_that_begins_or_ends_in_motion_says_so(
    first, last, picked, robot, tmp_path, capsys
):
    """Which is no failure: tables onto belts do."""
    table = table_within_limits(SCENE, picked.trajectory, Rows(1e-3), QUINTIC, in_time=False).table
    rows = np.column_stack([table.t, table.theta, table.dtheta, table.ddtheta])[first:last]
    file = write(tmp_path / "table.csv", dict(zip(COLUMNS, rows.T, strict=True)))
    assert main(["verify", str(file), "--robot", str(robot), "--payload", "1"]) == 0
    fast = np.abs(rows[[0, -1], 4:7]).max(axis=1)
    told = [
        f"{end} at {v:.3g} rad/s" for end, v in zip(("begins", "ends"), fast, strict=True) if v > 1
    ]
    expected = f"{file}: it {' and '.join(told)}; is it cut off, or meets it a belt?"
    assert expected in capsys.readouterr().err.splitlines()


def beside(names, entries):
    """A table with more columns, of the same entries in every row."""
    header, *rows = PLAIN.splitlines()
    return "\n".join([header + names, *(row + entries for row in rows)])


BAD = {
    "no names": ("0,1,2,3\n1,1,2,3\n", "names no columns in its first line"),
    "other columns": ("a,b\n1,2\n", "no t with theta1"),
    "short": ("t,x,y,z\n0,1,2,3\n", "has 1 rows"),
    "backwards": ("t,x,y,z\n0,1,2,3\n1,1,2,3\n0.5,1,2,3\n2,1,2,3\n", "from line 3 to line 4"),
    "ragged": ("t,x,y,z\n0,1,2,3\n1,1,2\n", "line 3 has 3 columns, the first line 4"),
    "not finite": ("t,x,y,z\n0,1,2,nan\n1,1,2,3\n2,1,2,3\n3,1,2,3\n", "z is 'nan' in line 2"),
    "no text": ("t,x,y,z\n\x00\n", "line 2|cannot be read"),
    "no number in a rate": (beside(",vx,vy,vz", ",0,0,n/a"), "vz is 'n/a' in line 2"),
    "a rate is missing": (beside(",vx,vy", ",0,0"), "names 0 columns vz in its first line"),
    "a column twice": (beside(",Y", ",0"), "2 columns y"),
    "digits in groups": (beside(",vx,vy,vz", ",0,0,1_0"), "vz is '1_0'"),
    "a quote left open": (beside(",note", ',"'), "cannot be read as CSV|in quotes"),
    "1.234 or 1234": (PLAIN.replace(",", ";").replace("0.01", "0,01"), "decimal commas in some"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_table_is_one_sentence(tmp_path, name):
    text, expected = BAD[name]
    file = tmp_path / "bad.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(UnreadableTable, match=expected) as error:
        read_foreign_table(file)
    assert "\n" not in str(error.value)


MOVES = "{t},0.45,0.0,0.0\n0.1,0.45,0.01,0.0\n0.2,0.45,0.02,0.0\n0.3,0.45,0.03,0.0\n"
TINY = {
    "the least number": ("t,x,y,z\n0,0.45,0,0\n" + MOVES.format(t=5e-324), 2, "less than 1e-12 s"),
    "all times the same": (
        "t,x,y,z,vx,vy,vz\n" + "1,0.45,0,0,0,0,0\n" * 4,
        2,
        "does not increase at all",
    ),
    "a motion of 1e-300 m": (
        "t,x,y,z\n0,0.45,0,0\n1,0.45,1e-300,0\n2,0.45,0,0\n3,0.45,0,0\n",
        2,
        "nothing moves in it",
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


def test_a_plan_is_verified_again(picked, tmp_path, capsys):
    picked.save(tmp_path, chart=False)
    assert main(["verify", str(tmp_path)]) == 0
    assert "torque excess" in capsys.readouterr().out
    assert main(["verify", str(tmp_path), "--robot", str(ORSINO)]) == 2
    assert "--robot is for a TABLE.csv" in capsys.readouterr().err
    assert main(["verify", str(tmp_path / "trajectory.csv")]) == 2
    assert "--robot ROBOT" in capsys.readouterr().err
