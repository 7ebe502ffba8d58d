"""Plans that are read back are the plans that were saved."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

import deltaopt
from deltaopt.cli import main
from deltaopt.output.plan_files import write_motion
from deltaopt.output.saved_plan import UnreadablePlan, record_differences, table_difference
from studies.problems import ORSINO, PROBLEMS


@pytest.fixture(scope="module")
def saved(picked, tmp_path_factory):
    """A plan and the folder it was saved to."""
    folder = tmp_path_factory.mktemp("plan")
    picked.save(folder, chart=False)
    return picked, folder


def test_to_the_last_bit(saved):
    plan, folder = saved
    for path in (folder, str(folder), folder / "plan.json"):
        again = deltaopt.load_plan(path)
        assert again.scene == plan.scene
        assert again.duration == plan.duration
        assert again.record["gap"] == plan.gap
        np.testing.assert_array_equal(again.trajectory.knots, plan.trajectory.knots)
        t = np.linspace(0, plan.duration, 101)
        for name in ("x", "v", "a", "theta", "tau"):
            mine, given = (getattr(p.trajectory(t), name) for p in (again, plan))
            np.testing.assert_array_equal(mine, given)
    assert deltaopt.verify(again.scene, again.trajectory).ok


BROKEN = {
    "no file": (lambda c: None, "no such file"),
    "no JSON": (lambda c: "{", "cannot be read"),
    "a list": (lambda c: "[1]", "no record of a plan"),
    "another format": (
        lambda c: json.dumps(c | {"format": 2}),
        "its format is 2; .* reads format 1",
    ),
    "no format": (lambda c: json.dumps({k: c[k] for k in c if k != "format"}), "has no format"),
    "a word for numbers": (
        lambda c: json.dumps(c | {"motion": c["motion"] | {"position": [[[0, 0, "x"]], "y"]}}),
        "its coefficients are not 3 numbers for each power in each interval",
    ),
    "an older plan": (lambda c: json.dumps(c | {"motion": None}), "its motion cannot be used"),
    "no motion": (lambda c: json.dumps({k: c[k] for k in c if k != "motion"}), "has no 'motion'"),
    "another scene": (
        lambda c: json.dumps(c | {"scene": c["scene"] | {"start": [0, "x", 0]}}),
        "its scene cannot be used: start",
    ),
    "a knot too few": (
        lambda c: json.dumps(c | {"motion": c["motion"] | {"knots": c["motion"]["knots"][1:]}}),
        "do not fit",
    ),
    "text": (lambda c: json.dumps(c | {"motion": {"knots": ["a"], "position": []}}), "motion"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_plan_that_is_not_whole_is_one_sentence(saved, tmp_path, name):
    change, expected = BROKEN[name]
    text = change(json.loads((saved[1] / "plan.json").read_text(encoding="utf-8")))
    if text is not None:
        (tmp_path / "plan.json").write_text(text, encoding="utf-8")
    with pytest.raises(UnreadablePlan, match=expected) as error:
        deltaopt.load_plan(tmp_path)
    assert "\n" not in str(error.value)
    assert "plan.json" in str(error.value)


RECORDS = {
    "duration": (
        lambda c: c.update(duration=0.1),
        "its duration is 0.1, but its motion takes 0.14",
    ),
    "gap": (lambda c: c.update(gap=0.0), "changed since it was written: gap$"),
    "ok": (lambda c: c["verification"].update(ok=False), "ok is False, and verification now True"),
    "a key more": (lambda c: c.update(note="by hand"), "changed since it was written: note$"),
    "motion": (
        lambda c: c["motion"]["knots"].__setitem__(2, c["motion"]["knots"][2] * (1 + 1e-15)),
        "changed since it was written: motion$",
    ),
    "no checksums": (lambda c: c.pop("checksums"), "nothing else tells whether its gap is right"),
}


@pytest.mark.parametrize("name", RECORDS)
def test_what_was_changed_in_plan_json_is_named(saved, tmp_path, name):
    change, expected = RECORDS[name]
    content = json.loads((saved[1] / "plan.json").read_text(encoding="utf-8"))
    file = tmp_path / "plan.json"
    file.write_text(json.dumps(content), encoding="utf-8")  # laid out otherwise
    assert record_differences(deltaopt.load_plan(file), ok=True) == []
    change(content)
    file.write_text(json.dumps(content), encoding="utf-8")
    found = record_differences(deltaopt.load_plan(file), ok=True)
    assert any(re.search(expected, each) for each in found), found


def replaced(lines, row, column, text):
    cells = lines[row].split(",")
    cells[column] = text
    return [*lines[:row], ",".join(cells), *lines[row + 1 :]]


TABLES = {
    "a torque": (lambda rows: replaced(rows, 50, 20, "3.3"), "tau2 is 3.3 in line 51"),
    "a time": (lambda rows: replaced(rows, 50, 0, "0.0495"), "t is 0.0495 in line 51"),
    "an angle, hardly": (
        lambda rows: replaced(rows, 9, 10, repr(float(rows[9].split(",")[10]) + 1e-7)),
        "theta1 is .* in line 10",
    ),
    "no number": (lambda rows: replaced(rows, 50, 4, "n/a"), "vx is 'n/a' in line 51"),
    "cut off": (lambda rows: rows[:70], "has 69 rows in 0.068 s; the motion has 142 at 1000 Hz"),
    "in ms": (
        lambda rows: [
            rows[0],
            *(f"{1e3 * float(t)!r},{x}" for t, x in (r.split(",", 1) for r in rows[1:])),
        ],
        "has 142 rows in 140.9.* s; the motion .* in 0.1409",
    ),
    "no rows": (lambda rows: rows[:1], "has 0 rows"),
    "backwards": (lambda rows: [rows[0], *rows[:0:-1]], "in equal steps"),
    "names exchanged": (
        lambda rows: [rows[0].replace("x,y", "y,x", 1), *rows[1:]],
        "x is -0.05 in line 2; the motion has 0.45",
    ),
}


@pytest.mark.parametrize("name", TABLES)
def test_what_was_changed_in_trajectory_csv_is_named(saved, tmp_path, name):
    change, expected = TABLES[name]
    rows = (saved[1] / "trajectory.csv").read_text(encoding="utf-8").splitlines()
    file = tmp_path / "trajectory.csv"
    file.write_text("\n".join(change(rows)), encoding="utf-8")
    assert re.search(expected, table_difference(file, saved[0].trajectory))


def test_trajectory_csv_is_the_motion_at_any_rate(saved, tmp_path):
    """Also where rows fall on knots, at which torques jump, and through a spreadsheet."""
    trajectory, file = saved[0].trajectory, tmp_path / "trajectory.csv"
    knots = trajectory.knots
    rates = [1e-3, 1 / trajectory.duration, 10 / trajectory.duration, *1 / knots[1:6], 333.3, 2e4]
    for rate in rates:
        write_motion(file, trajectory, rate)
        assert table_difference(file, trajectory) is None
    text = file.read_text(encoding="utf-8").replace(",", ";").replace(".", ",")
    file.write_text("\ufeff" + text, encoding="utf-8")
    assert table_difference(file, trajectory) is None


def test_a_folder_with_files_of_two_plans(saved, tmp_path, capsys):
    plan, folder = saved
    assert main(["verify", str(folder)]) == 0
    assert capsys.readouterr().err == ""
    for name in ("plan.json", "trajectory.csv"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    write_motion(tmp_path / "trajectory.csv", deltaopt.baseline(plan.scene))
    assert main(["verify", str(tmp_path), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert not told["ok"]
    assert "trajectory.csv: has " in told["differences"][0]
    assert main(["verify", str(tmp_path / "plan.json")]) == 0  # of which it says nothing


def test_a_plan_against_a_scene_of_ones_own(saved, tmp_path, capsys):
    """Nine tenths of the torque, one and a half times the payload, another goal."""
    text = (PROBLEMS / "pick_and_place.yaml").read_text(encoding="utf-8")
    text = text.replace("robots/", f"{PROBLEMS}/robots/")
    scene = tmp_path / "scene.yaml"
    for change, code, words in (
        (("", ""), 0, "^$"),
        (("torque: 10", "torque: 9"), 1, "torque of motor 1 exceeds its limit by 11.1"),
        (("payload: 1.0", "payload: 1.5"), 1, "torque"),
        (("0.10, 0.0]", "0.09, 0.0]"), 1, "it ends 0.01 m from the scene's goal"),
    ):
        scene.write_text(text.replace(*change), encoding="utf-8")
        assert main(["verify", str(saved[1]), "--scene", str(scene)]) == code
        assert re.search(words, capsys.readouterr().err)
    table = str(saved[1] / "trajectory.csv")
    assert main(["verify", table, "--robot", str(ORSINO), "--scene", str(scene)]) == 2
