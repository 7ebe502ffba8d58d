"""The command line: what it prints and writes, and how it fails."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import deltaopt
import deltaopt.cli.plan
from deltaopt.cli import COMMANDS, main
from deltaopt.output.plan_files import COLUMNS, instants, write_motion
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.plan import Plan
from deltaopt.scene.scene_file import load_scene
from studies.problems import PROBLEMS

SCENE_FILE = PROBLEMS / "pick_and_place.yaml"
SCENE = load_scene(SCENE_FILE)
HEADER = (
    "t,x,y,z,vx,vy,vz,ax,ay,az,theta1,theta2,theta3,dtheta1,dtheta2,dtheta3,"
    "ddtheta1,ddtheta2,ddtheta3,tau1,tau2,tau3"
)
PNG = b"\x89PNG\r\n\x1a\n"


def scene_file(folder: Path, **changes: str) -> Path:
    """The pick-and-place scene with some lines replaced."""
    lines = {
        "robot": str(PROBLEMS / "robots/orsino.yaml"),
        "payload": "1.0",
        "start": "[0.45, -0.05, 0.0]",
        "goal": "[0.45, 0.10, 0.0]",
    } | changes
    file = folder / "scene.yaml"
    file.write_text("".join(f"{key}: {value}\n" for key, value in lines.items()), encoding="utf-8")
    return file


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


# What is written


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("out")
    assert main(["plan", str(SCENE_FILE), "--baseline", "-o", str(folder)]) == 0
    return folder


def test_csv_is_the_motion_to_the_last_digit(written):
    assert names(written) == ["plan.json", "plan.png", "trajectory.csv"]
    assert (written / "plan.png").read_bytes().startswith(PNG)
    text = (written / "trajectory.csv").read_text(encoding="utf-8")
    header, *rows = text.splitlines()
    assert header == HEADER
    assert header == ",".join(COLUMNS)
    table = np.array([[float(number) for number in row] for row in csv.reader(rows)])
    line = baseline(SCENE)
    assert table[-1, 0] == line.duration
    np.testing.assert_array_equal(table[:-1, 0], np.arange(len(rows) - 1) / 1000)
    motion = line(table[:, 0])
    np.testing.assert_array_equal(table[:, 1:4], motion.x)
    np.testing.assert_array_equal(table[:, 10:13], motion.theta)
    np.testing.assert_array_equal(table[:, 19:], motion.tau)


@pytest.mark.parametrize("rate", [333.0, 1 / 0.196, 1e-3])
def test_instants(rate):
    line = baseline(SCENE)
    t = instants(line, rate)
    assert (t[0], t[-1]) == (0, line.duration)
    assert (np.diff(t) > 0).all()
    np.testing.assert_allclose(np.diff(t)[:-1], 1 / rate)
    assert t[-1] - t[-2] <= 1 / rate * (1 + 1e-12)


def test_plan_made_by_hand(tmp_path):
    """Whatever a gap is, JSON can say it."""
    line = baseline(SCENE)
    plan = Plan(SCENE, line, "L_E, flat", "test", 40, "solved", 7, gap=float("inf"), tolerance=1e-3)
    plan.save(tmp_path / "new" / "folder", chart=False)
    content = json.loads((tmp_path / "new/folder/plan.json").read_text(encoding="utf-8"))
    assert (content["formulation"], content["intervals"]) == ("L_E, flat", 40)
    assert content["gap"] is None


# What is printed


def test_plan(tmp_path, capsys):
    words = ["plan", str(SCENE_FILE), "--no-plot", "-o", str(tmp_path)]
    assert main(words) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    record = json.loads((tmp_path / "plan.json").read_text(encoding="utf-8"))
    duration, line = record["duration"], deltaopt.timed_line(SCENE).duration
    assert 0.140869 < duration < 0.140870 * 1.001
    assert printed.out.splitlines() == [
        "verified: 0.141 s, 213 parts per minute there and back",
        f"at most {100 * record['gap']:.2g} % longer than the fastest near it (estimated); a local "
        "optimum, others may be better",
        f"{100 * (1 - duration / line):.1f} % less than the line, timed optimally: {line:.4f} s",
        "limited by torque (100 % of the time, 10 % more would save 5.1 %)",
        f"written: {tmp_path / 'trajectory.csv'}, {tmp_path / 'plan.json'}",
    ]
    assert main([*words, "--details"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[:4] == printed.out.splitlines()[:4]
    assert f"duration {duration:.6f} s, effort {record['verification']['effort']:.6g} N²m²s" in out
    assert sum(line.endswith(" ok") for line in out) == 11


def test_research_options_are_apart(capsys):
    with pytest.raises(SystemExit):
        main(["plan", "--help"])
    everyday, research = capsys.readouterr().out.split("\nresearch:\n")
    for option in ("formulation", "closure", "transcription", "solver", "intervals"):
        assert f"  --{option} " in research
        assert f"  --{option} " not in everyday
    assert "  --details " in everyday


def test_failed_verification_is_exit_1(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(deltaopt.cli.plan, "baseline", lambda scene: baseline(scene).slowed(0.99))
    words = ["--baseline", "--no-plot", "--rate", "100", "-o", str(tmp_path)]
    assert main(["plan", str(SCENE_FILE), *words]) == 1
    assert len((tmp_path / "trajectory.csv").read_text().splitlines()) == 1 + 20 + 1
    printed = capsys.readouterr()
    assert printed.out.startswith("NOT VERIFIED: 0.195 s, 154 parts per minute there and back\n")
    assert "verification failed: torque of motor 1 exceeds its limit by 1.7" in printed.err
    content = json.loads((tmp_path / "plan.json").read_text(encoding="utf-8"))
    assert content["verification"]["ok"] is False


def test_check_names_what_a_scene_leaves_out(capsys, tmp_path):
    assert main(["check", str(PROBLEMS / "light_and_fast.yaml")]) == 0
    assert "left out     payload" in capsys.readouterr().out
    line_too_high = scene_file(
        tmp_path, start="[0.22, 0.442, -0.135]", goal="[0.163, 0.129, 0.427]"
    )
    assert main(["check", str(line_too_high)]) == 0
    assert "baseline     none: the straight line" in capsys.readouterr().out


def test_inverse(tmp_path, capsys):
    (tmp_path / "motion.png").write_text("mine", encoding="utf-8")
    arguments = ["inverse", str(SCENE_FILE), "-o", str(tmp_path), "--duration", "0.4"]
    assert main(arguments) == 0
    assert names(tmp_path) == ["inverse.csv", "motion.png", "torques.png"]
    assert (tmp_path / "torques.png").read_bytes().startswith(PNG)
    assert len((tmp_path / "inverse.csv").read_text().splitlines()) == 1 + 400 + 1
    told = capsys.readouterr().out
    assert "motor 1 " in told
    assert f"written: {tmp_path / 'inverse.csv'}, {tmp_path / 'torques.png'}\n" in told
    assert f"replaced: {tmp_path / 'motion.png'}\n" in told


@pytest.mark.parametrize("arguments", [[], *([name] for name in COMMANDS)])
def test_help(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        main([*arguments, "--help"])
    assert end.value.code == 0
    assert "usage: deltaopt" in capsys.readouterr().out


# How it fails: one sentence, no traceback, nothing half-written


def failure(arguments: list[str], capsys) -> tuple[int, str]:
    code = main(arguments)
    printed = capsys.readouterr()
    assert printed.err.startswith("deltaopt: ")
    assert printed.err.count("\n") == 1
    return code, printed.err


@pytest.mark.parametrize("command", ["plan", "check", "inverse"])
@pytest.mark.parametrize(
    ("changes", "code", "words"),
    [
        ({"payload": "-1"}, 2, "payload is -1"),
        ({"robot": "none.yaml"}, 2, "which is no file"),
        ({"goal": "[0.45, 0.9, 0.0]"}, 1, "goal: the platform cannot be at [0.45, 0.9, 0] m"),
        ({"payload": "10"}, 1, "the torque of motor 1 is 13 N·m"),
    ],
)
def test_hopeless_scenes(command, changes, code, words, tmp_path, capsys):
    scene = str(scene_file(tmp_path, **changes))
    output = [] if command == "check" else ["-o", str(tmp_path / "out")]
    found, sentence = failure([command, scene, *output], capsys)
    assert found == code
    assert words in sentence
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", ["plan", "inverse"])
@pytest.mark.parametrize("inside", ["", "/deeper"])
def test_output_that_is_a_file(command, inside, tmp_path, capsys):
    file = tmp_path / "file"
    file.write_text("mine", encoding="utf-8")
    code, sentence = failure([command, str(SCENE_FILE), "-o", f"{file}{inside}"], capsys)
    assert code == 2
    assert "directory" in sentence
    assert file.read_text(encoding="utf-8") == "mine"


def test_output_file_that_is_a_directory(tmp_path, capsys):
    (tmp_path / "trajectory.csv").mkdir()
    assert main(["plan", str(SCENE_FILE), "--baseline", "--no-plot", "-o", str(tmp_path)]) == 2
    assert "Traceback" not in capsys.readouterr().err
    assert names(tmp_path) == ["trajectory.csv"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--formulation", "flat", "--closure", "baumgarte"], "--closure is baumgarte; with"),
        (["--closure", "knots"], "with --formulation flat no loops can drift open"),
        (["--formulation", "forward", "--closure", "knots"], "with --formulation forward no loops"),
        (["--formulation", "explicit", "--solver", "interior-point"], "it may be ipopt"),
        (["--baseline", "--solver", "ipopt"], "--solver is for a plan, which --baseline"),
        (["--baseline", "--starts", "1"], "--starts is for a plan"),
    ],
)
def test_contradictory_options(options, words, tmp_path, capsys):
    code, sentence = failure(["plan", str(SCENE_FILE), "-o", str(tmp_path / "o"), *options], capsys)
    assert code == 2
    assert words in sentence
    assert not (tmp_path / "o").exists()


@pytest.mark.parametrize(
    ("limits", "rate", "duration"), [({}, "1e12", 0.196573), ({"speed": 1e-9}, "1000", 8.56706e8)]
)
def test_too_many_rows(limits, rate, duration, tmp_path, capsys):
    scene = scene_file(tmp_path, limits=f"{limits}".replace("'", ""))
    out = tmp_path / "out"
    arguments = ["plan", str(scene), "--baseline", "--rate", rate, "-o", str(out)]
    code, sentence = failure(arguments, capsys)
    assert code == 2
    assert f"--rate is {float(rate):g} Hz; the motion takes {duration:g} s and" in sentence
    assert not out.exists()
    possible = float(sentence.split()[-4])
    assert len(instants(baseline(load_scene(scene)), possible)) < 1_000_001


def test_csv_of_too_many_rows(tmp_path):
    with pytest.raises(ValueError, match=r"^rate is 1e\+09 Hz; for 1000000 rows it may be"):
        write_motion(tmp_path / "a.csv", baseline(SCENE), rate=1e9)


def test_inverse_in_years(tmp_path, capsys):
    arguments = ["inverse", str(SCENE_FILE), "-o", str(tmp_path), "--duration", "1e9"]
    code, sentence = failure(arguments, capsys)
    assert code == 2
    assert sentence.startswith("deltaopt: --duration is 1e+09 s; with 1000 rows a second")
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    "words",
    [
        ["plot"],
        ["plan"],
        ["plan", "a.yaml", "--start", "1"],
        ["plan", "a.yaml", "--base"],
        ["export", "table", "out/a", "--keep"],
        ["export", "c", "out/a", "--slower", "0.5"],
        ["plan", "a.yaml", "--rate", "0"],
        ["plan", "a.yaml", "--tolerance", "-1e-3"],
        ["plan", "a.yaml", "--intervals", "2.5"],
        ["inverse", "a.yaml", "--duration", "nan"],
        ["plan", "a.yaml", "--seed", "-1"],
    ],
)
def test_wrong_usage_is_exit_2(words, capsys):
    with pytest.raises(SystemExit) as end:
        main(words)
    assert end.value.code == 2
    assert "Traceback" not in capsys.readouterr().err


def test_how_near_a_line_comes_to_each_limit(tmp_path, capsys):
    """Of two bounds, of a largest value and of a least one, from the table that is written."""
    box = np.array([(0.47, -0.02, -0.02), (0.6, 0.0, 0.02)])
    bodies = str([{"box": {"from": box[0].tolist(), "to": box[1].tolist()}}])
    file = scene_file(tmp_path, keep_out=bodies, limits="{platform_speed: 5.0, torque: 10.0}")
    assert main(["inverse", str(file), "--duration", "0.5", "-o", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    with (tmp_path / "out" / "inverse.csv").open(encoding="utf-8") as lines:
        table = np.array([[float(cell) for cell in row] for row in list(csv.reader(lines))[1:]])
    x, v, tau = (table[:, HEADER.split(",").index(name) :][:, :3] for name in ("x", "vx", "tau1"))
    away = np.linalg.norm(x - np.clip(x, *box), axis=1).min()
    fastest, largest = np.linalg.norm(v, axis=1).max(), tau.flat[np.abs(tau).argmax()]
    assert f"clearance, {away:.4g} m at" in said
    assert "it may be at least 0\n" in said
    assert f"platform speed, {fastest:.4g} m/s at t = 0.2500 s; it may be at most 5\n" in said
    assert f", {largest:.4g} N·m at" in said
    assert "it may be ± 10\n" in said
