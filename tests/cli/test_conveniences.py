"""Help, version, machines' output, several scenes, and that nothing is replaced without a word."""

from __future__ import annotations

import json
from importlib.metadata import version

import numpy as np
import pytest

import deltaopt
from deltaopt.cli import main
from deltaopt.cli.streams import present, print_written
from deltaopt.output.in_words import table
from deltaopt.output.saved_plan import load_plan
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.verification import verify
from studies.problems import PROBLEMS

SCENE_FILE = PROBLEMS / "pick_and_place.yaml"


def plan(*words: object) -> int:
    return main(["plan", *map(str, words), "--no-plot"])


def test_version(capsys):
    assert deltaopt.__version__ == version("deltaopt")
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert end.value.code == 0
    assert capsys.readouterr().out == f"deltaopt {deltaopt.__version__}\n"


def test_without_a_command_there_is_help(capsys):
    assert main([]) == 0
    without = capsys.readouterr()
    with pytest.raises(SystemExit):
        main(["--help"])
    assert without.out == capsys.readouterr().out
    assert without.err == ""


def test_a_baseline_has_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert plan(SCENE_FILE) == 0
    found = (tmp_path / "out/pick_and_place/plan.json").read_bytes()
    assert plan(SCENE_FILE, "--baseline") == 0
    assert (tmp_path / "out/pick_and_place/plan.json").read_bytes() == found
    line = load_plan(tmp_path / "out/pick_and_place/baseline")
    assert line.duration == baseline(load_scene(SCENE_FILE)).duration


def test_what_is_replaced_is_said(tmp_path, capsys):
    assert plan(SCENE_FILE, "--baseline", "-o", tmp_path) == 0
    first = capsys.readouterr().out
    assert f"written: {tmp_path / 'trajectory.csv'}, {tmp_path / 'plan.json'}" in first
    assert "replaced:" not in first
    assert plan(SCENE_FILE, "--baseline", "-o", tmp_path) == 0
    assert f"replaced: {tmp_path / 'trajectory.csv'}" in capsys.readouterr().out
    for times in ("written: ", "replaced: "):
        arguments = ["export", "table", str(tmp_path), "-o", str(tmp_path / "table.csv")]
        assert main(arguments) == 0
        assert f"{times}{tmp_path / 'table.csv'}\n" in capsys.readouterr().out


def test_no_page_of_an_earlier_motion_stays_beside_a_plan(tmp_path, capsys):
    words = ["plan", str(SCENE_FILE), "--baseline", "-o", str(tmp_path)]
    assert main([*words, "--report", "--plot-limits"]) == 0
    (tmp_path / "notes.txt").touch()
    capsys.readouterr()
    assert main([*words, "--no-plot"]) == 0
    gone = ", ".join(str(tmp_path / name) for name in ("limits.png", "plan.png", "report.html"))
    assert f"removed: {gone}\n" in capsys.readouterr().out
    left = sorted(file.name for file in tmp_path.iterdir())
    assert left == ["notes.txt", "plan.json", "trajectory.csv"]


def test_of_many_files_their_number_is_said(tmp_path, capsys):
    legs = [tmp_path / f"leg_{number}" for number in range(1, 8)]
    files = [leg / name for leg in legs for name in ("plan.json", "trajectory.csv")]
    print_written(files, present(tmp_path))
    assert capsys.readouterr().out == f"written: {tmp_path} (14 files)\n"
    for leg in legs:
        leg.mkdir()
        (leg / "plan.json").touch()
    print_written(files[2:], present(tmp_path))
    told = capsys.readouterr().out
    assert told == f"written: {tmp_path} (6 files)\nreplaced: {tmp_path} (6 files)\n"


def test_replaced_figures_are_said(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("deltaopt.compare.model_terms.effects_of_terms", lambda *_: [])
    drawn = "deltaopt.plots.model_terms.draw_terms"
    monkeypatch.setattr(drawn, lambda file, *_: file.write_text("new", encoding="utf-8"))
    mine = tmp_path / "terms.png"
    mine.write_text("mine", encoding="utf-8")
    assert main(["check", str(SCENE_FILE), "--terms", "-o", str(tmp_path)]) == 0
    assert f"replaced: {mine}\n" in capsys.readouterr().out
    assert mine.read_text(encoding="utf-8") == "new"


def test_one_hopeless_scene_of_several(tmp_path, capsys):
    hopeless, other = tmp_path / "hopeless.yaml", PROBLEMS / "industrial_cross.yaml"
    text = SCENE_FILE.read_text(encoding="utf-8").replace("payload: 1.0", "payload: 10")
    hopeless.write_text(text.replace("robots/", f"{PROBLEMS}/robots/"), encoding="utf-8")
    assert plan(hopeless, SCENE_FILE, other, "--baseline", "-o", tmp_path / "out") == 1
    assert len(list((tmp_path / "out").iterdir())) == 2
    for file in (SCENE_FILE, other):
        assert load_plan(tmp_path / "out" / file.stem).scene == load_scene(file)
    assert f"deltaopt: {hopeless}: " in capsys.readouterr().err


def test_two_scenes_do_not_share_a_folder(tmp_path, capsys):
    (tmp_path / "a").mkdir()
    same = tmp_path / "a" / SCENE_FILE.name
    same.write_text("", encoding="utf-8")
    assert plan(SCENE_FILE, same, "-o", tmp_path / "out") == 2
    assert "would both be written to" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


# For machines


def test_plans_as_json(tmp_path, capsys):
    scene = load_scene(SCENE_FILE)
    assert plan(SCENE_FILE, "--json", "-o", tmp_path) == 0
    content = json.loads(capsys.readouterr().out)
    saved = load_plan(tmp_path)
    assert (content["ok"], content["scene"]) == (True, str(SCENE_FILE))
    assert content["duration"] == saved.duration
    assert content["gap"] == saved.record["gap"] <= content["tolerance"] == 1e-3
    assert content["verification"] == saved.record["verification"]
    assert content["files"] == [str(tmp_path / name) for name in ("trajectory.csv", "plan.json")]
    t = np.linspace(0, saved.duration, 20_001)[1:-1]
    at = (np.abs(saved.trajectory(t).tau) >= 0.99 * 10.0).mean(axis=0)
    told = {each["subject"]: each["share_of_time"] for each in content["active_limits"]}
    assert told == pytest.approx({f"motor {k + 1}": at[k] for k in range(3)}, abs=3e-3)
    assert main(["verify", str(tmp_path), "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again.pop("plan") == str(tmp_path)
    assert again.pop("differences") == []
    assert again == json.loads(json.dumps(verify(scene, saved.trajectory).as_dict()))


def test_tables_and_checks_as_json(tmp_path, capsys):
    assert plan(SCENE_FILE, "--baseline", "-o", tmp_path) == 0
    robot = str(PROBLEMS / "robots/orsino.yaml")
    capsys.readouterr()
    table = str(tmp_path / "trajectory.csv")
    assert main(["verify", table, "--robot", robot, "--payload", "1", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["ok"]
    assert content["rows"] == 198
    assert {each["limit"] for each in content["limits"]} == {"torque"}
    assert main(["check", str(SCENE_FILE), "--json"]) == 0
    content = json.loads(capsys.readouterr().out)
    torque = next(each for each in content["limits"] if each["limit"] == "torque")
    assert (torque["lower"], torque["upper"]) == ([-10.0] * 3, [10.0] * 3)
    assert content["scene"]["payload"] == 1.0
    assert main(["check", robot, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["robot"]["drive"]["torque"] == 10.0


# What is said when all is well


def test_pontryagins_condition_is_told_where_it_was_asked_for():
    line = baseline(load_scene(SCENE_FILE))
    found = verify(load_scene(SCENE_FILE), line)
    assert "Pontryagin" not in table(found)
    assert "not met" in table(found, asked_for=1e-9)


def test_the_journal_of_a_hard_scene_is_told_if_asked_for(tmp_path, capsys):
    """Ways past bodies: each with what came of it, and the one that is taken among them."""
    wall = "problems/keep_out/wall_25_305_25.yaml"
    assert plan(wall, "-o", tmp_path) == 0
    assert capsys.readouterr().err == ""
    assert plan(wall, "-v", "-o", tmp_path) == 0
    journal = capsys.readouterr().err
    assert "a straight line, " in journal
    assert "the way above keep_out[0], " in journal
    assert f"{load_plan(tmp_path).duration:.6g} s, gap " in journal


@pytest.mark.parametrize("solver", ["interior-point", "ipopt"])
def test_every_iteration_is_told_if_asked_for(solver, tmp_path, capsys, caplog):
    words = (SCENE_FILE, "--solver", solver, "--tolerance", "1e-2", "-o", tmp_path)
    assert plan(*words) == 0
    assert "complementarity" not in (quiet := capsys.readouterr()).err
    assert "infeasibility" not in quiet.err
    first = load_plan(tmp_path)
    assert plan(*words, "-vv") == 0
    assert load_plan(tmp_path).trajectory.knots.tolist() == first.trajectory.knots.tolist()
    told = [line.split() for line in capsys.readouterr().err.splitlines()]
    iterations = [words for words in told if words and words[0].isdigit() and len(words) >= 5]
    numbers = [words for words in iterations if words[1] != "intervals,"]
    meshes = sum(words[0] == "0" for words in numbers)
    assert len(numbers) == first.record["iterations"] + meshes
    if solver == "interior-point":  # in units of the straight line's duration
        last = float(numbers[-1][1]) * baseline(load_scene(SCENE_FILE)).duration
        assert last == pytest.approx(first.duration, rel=1e-2)
