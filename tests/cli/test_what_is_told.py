"""What is told of a file, a table or a word that is nearly right: what is off, where, a remedy."""

from __future__ import annotations

import json
import re

import pytest

from deltaopt.cli import main
from studies.problems import PICK_AND_PLACE, PROBLEMS

INDUSTRIAL = PROBLEMS / "robots" / "industrial.yaml"
MOVE = f"robot: {INDUSTRIAL}\nstart: [0.85, -0.1525, 0.0]\n"
GOAL = "goal: [0.85, 0.1525, 0.0]\n"
HIGH = "{radius: 20 mm, height: 600 mm}"


def told(words, capsys):
    """The exit code of a command, and its only line of complaint."""
    code = main(list(map(str, words)))
    (line,) = capsys.readouterr().err.splitlines()
    return code, line


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (MOVE + "cycle: [{goal: [0.8, 0, 0]}]", r"line 3, .*: cycle has 1 leg; expected two to"),
        (MOVE + "goal: {at: [0.8, 0, 0], belts: [0, 0, 1]}", "belts is not .*; expected belt$"),
        (MOVE + "goal: {at: [0.8, 0, 0], xyz: [0, 0, 1]}", "xyz is not .* acceleration, belt$"),
        (
            MOVE + GOAL + "path: line\nkeep_out: [{sphere: {centre: [0.85, 0, 0], radius: 0.03}}]",
            r"the path: at \[0.85, .*, 0\] m the tool overlaps .*, a sphere, by (30|29.9)",
        ),
        (
            MOVE.replace("0.85", "0.75")
            + GOAL.replace("0.85", "0.75")
            + f"approach: {{start: {HIGH}, goal: {HIGH}}}",
            r"approach.start, the top of the cylinder: .* \[0.\d+, .*\] m",
        ),
        (
            MOVE + GOAL + "objective: {time: 1, effort: 1e-4, jerk: 1e-9}",
            r"line \d+, column .*: objective has effort and jerk; expected .*weights of",
        ),
        (
            MOVE + GOAL + "limits: {rms_torque: 5}",
            r"limits.rms_torque is 5.0; expected none of a single motion or a leg",
        ),
        (
            MOVE + GOAL + "cycle: [{goal: [0.8, 0, 0]}, {goal: [0.85, -0.1, 0]}]",
            r"line \d+, column .*: goal is \[.*\]; expected none: each leg of a cycle has its own",
        ),
    ],
)
def test_of_a_scene(text, said, tmp_path, capsys):
    file = tmp_path / "scene.yaml"
    file.write_text(text, encoding="utf-8")
    _, line = told(["plan", file, "-o", tmp_path / "out", "--no-plot"], capsys)
    assert re.search(said, line)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("base_radius: 0.200", "base_radius: 2.25", "base_radius 2.25, platform_radius 0.045 and"),
        ("torque: 40.0", "torque: -112.00000000000001", "drive.torque is -112.0; expected"),
        ("torque: 40.0", "gear: {ratio: 8}", "gear is of no use without drive.motor"),
        (
            "torque: 40.0, speed: 10.0",
            "motor: {peak_torque: 1}, gear: {ratio: 8, efficiency: 94}",
            "efficiency is 94.0, .*at most 1; % need a unit: 94 %$",
        ),
    ],
)
def test_of_a_robot(old, new, said, tmp_path, capsys):
    file = tmp_path / "robot.yaml"
    text = INDUSTRIAL.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new), encoding="utf-8")
    code, line = told(["check", file], capsys)
    assert code == 2
    assert re.search(said, line)


@pytest.mark.parametrize("command", [["verify"], ["export", "table"]])
def test_of_a_scene_that_is_taken_for_a_plan(command, capsys):
    code, line = told([*command, PICK_AND_PLACE], capsys)
    assert code == 2
    assert line.startswith(f"deltaopt: {PICK_AND_PLACE} is no plan; if it is a scene, run deltaopt")


@pytest.mark.parametrize(
    ("header", "row", "said"),
    [
        ("x,y,z", "800,{},0", r"line 2: \[800, 0, 0\] are no positions in m; are they in mm"),
        ("theta1,theta2,theta3", "20,{},0", r"\[20, 0, 0\] are no motor angles in rad; --unit deg"),
        ("x,y,z", "0.8,{},0", r"the platform cannot be at \[0.8, 1, 0\] m"),
    ],
)
def test_of_a_table(header, row, said, tmp_path, capsys):
    file = tmp_path / "table.csv"
    rows = [f"{k},{row.format(k)}" for k in range(4)]
    file.write_text("\n".join([f"t,{header}", *rows]), encoding="utf-8")
    _, line = told(["verify", file, "--robot", INDUSTRIAL], capsys)
    assert line.startswith(f"deltaopt: {file}")
    assert re.search(said, line)


def test_of_another_robots_plan(picked, tmp_path, capsys):
    """One sentence, not a table without a single number."""
    picked.save(tmp_path, chart=False)
    scene = PROBLEMS / "industrial_cross.yaml"
    code, line = told(["verify", tmp_path, "--scene", scene], capsys)
    assert code == 1
    assert f"{tmp_path}: robot, start, goal, limits" in line
    assert f"differ from those of {scene}; the platform cannot be at" in line


def test_of_each_leg_of_a_cycle(capsys):
    file = PROBLEMS / "cycles" / "there_and_back.yaml"
    assert main(["check", str(file)]) == 0
    found = capsys.readouterr().out
    assert re.findall(r"^leg +(.*)\nverdict +can be done", found, re.MULTILINE) == [
        "1 of 2",
        "2 of 2",
    ]
    assert main(["check", str(file), "--json"]) == 0
    legs = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [(each["leg"], each["scene"].get("payload")) for each in legs] == [(1, 1.0), (2, None)]
    code, line = told(["check", PROBLEMS / "cycles" / "cell.yaml"], capsys)
    assert code == 2
    assert line.endswith("run deltaopt plan")
