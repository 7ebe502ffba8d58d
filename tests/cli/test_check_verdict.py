"""The first line of `deltaopt check`: whether a scene can be done; bodies; x that points down."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from deltaopt.cli import main
from deltaopt.errors import Infeasible, SceneError, Unreachable
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene import Scene
from studies.problems import PROBLEMS

INDUSTRIAL = load_robot(PROBLEMS / "robots/industrial.yaml")


def checked(capsys, file: Path | str, *words: str) -> tuple[int, list[str], str]:
    code = main(["check", str(PROBLEMS / file), *words])
    printed = capsys.readouterr()
    return code, printed.out.splitlines(), printed.err


def test_what_no_line_does_is_planned_and_bodies_are_listed(capsys):
    code, lines, _ = checked(capsys, "keep_out/into_a_box.yaml")
    assert code == 0
    assert lines[0].startswith("verdict      can be done: a motion of 0.18")
    assert lines[0].endswith("s that was planned keeps all limits")
    assert "keep_out[0]  box, from [0.82, 0.08, -0.11], to [0.96, 0.09, 0.11] m" in lines
    assert "keep_out[4]  half-space, point [0.96, 0, 0], normal [1, 0, 0] m" in lines
    assert not [line for line in lines if "inf" in line]


def test_the_line_shows_that_a_move_can_be_done(capsys):
    code, lines, _ = checked(capsys, "pick_and_place.yaml")
    told = "verdict      can be done: the straight line in 0.1966 s keeps all limits"
    assert (code, lines[0]) == (0, told)
    main(["check", str(PROBLEMS / "pick_and_place.yaml"), "--json"])
    assert json.loads(capsys.readouterr().out)["verdict"] == told.removeprefix("verdict      ")


def test_what_cannot_be_done_is_said_first_and_why(capsys, tmp_path):
    scene = yaml.safe_load((PROBLEMS / "pick_and_place.yaml").read_text(encoding="utf-8"))
    scene |= {"robot": str(PROBLEMS / "robots/orsino.yaml"), "payload": 10.0}
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    code, lines, error = checked(capsys, tmp_path / "scene.yaml")
    assert (code, lines) == (1, ["verdict      cannot be done"])
    assert "the torque of motor 1 is 13 N·m, where at most 10 N·m is allowed" in error


@pytest.mark.parametrize(
    ("given", "name", "meant"),
    [
        ({"start": (-0.2, 0.0, -0.8)}, "start", "[0.8, -0.2, 0]"),  # z up
        ({"goal": (0.15, 0.0, 0.9)}, "goal", "[0.9, 0.15, 0]"),  # z down, but last
        ({"start": (-0.8, -0.2, 0.0)}, "start", "[0.8, -0.2, 0]"),  # x up
        ({"via": [(-0.1, 0.0, -0.85)]}, "via 1", "[0.85, -0.1, 0]"),
        ({"via": [{"at": (-0.1, 0, -0.85), "within": 0.01}]}, "via 1", "[0.85, -0.1, 0]"),
    ],
)
def test_a_point_of_another_frame_is_told_so(given, name, meant):
    points = {"start": (0.8, -0.2, 0.0), "goal": (0.9, 0.15, 0.0)} | given
    with pytest.raises((Unreachable, Infeasible), match=f"^{name}: ") as caught:
        check_feasible(Scene(robot=INDUSTRIAL, **points))
    assert f"x points down from the base's centre, as in {meant} m" in str(caught.value)


def test_of_all_frames_in_which_a_point_is_in_reach_the_lowest_place_is_told():
    arms = {"upper_arm": {"length": 0.315, "mass": 1.2}, "forearm": {"length": 0.825, "mass": 0.5}}
    robot = INDUSTRIAL.model_copy(update=arms)
    points = {"start": (-0.8, -0.15, 0.0), "goal": (-0.8, 0.15, 0.0)}  # x up; level with z up
    with pytest.raises(Unreachable, match=r"as in \[0\.8, -0\.15, 0\] m$"):
        check_feasible(Scene(robot=robot, **points))


def test_a_point_that_is_far_in_any_frame_is_not():
    with pytest.raises(Unreachable) as caught:
        check_feasible(Scene(robot=INDUSTRIAL, start=(3.0, 0.0, 0.0), goal=(0.9, 0.15, 0.0)))
    assert "x points down" not in str(caught.value)


def test_a_body_and_a_workspace_of_another_frame_are_told_so(capsys, tmp_path):
    scene = {
        "robot": str(PROBLEMS / "robots/industrial.yaml"),
        "start": [0.8, -0.2, 0.0],
        "goal": [0.9, 0.15, 0.0],
        "keep_out": [{"sphere": {"centre": [0.1, 0.3, -0.85], "radius": 0.03}}],
    }
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    _, lines, _ = checked(capsys, tmp_path / "scene.yaml")
    body = "keep_out[0]  sphere, centre [0.1, 0.3, -0.85], radius 0.03 m"
    assert f"{body}; x points down from the base's centre, as in [0.85, 0.1, 0.3] m" in lines
    with pytest.raises(SceneError, match="x points down from its centre"):
        Robot.model_validate({**INDUSTRIAL.model_dump(), "workspace": {"depth": [-1.0, -0.5]}})


@pytest.mark.parametrize("name", ["belt", "passed_state"])
def test_a_scene_whose_end_moves_is_planned(name, capsys):
    assert main(["check", f"problems/moving/{name}.yaml"]) == 0
    assert capsys.readouterr().out.startswith("verdict      can be done: a motion of ")
