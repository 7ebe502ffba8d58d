"""Plans replayed in MuJoCo: the right torques lead to the goal as steps become shorter."""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import numpy as np
import pytest

import deltaopt
from deltaopt.cli import main
from deltaopt.output.mujoco_replay import InMujoco, MujocoReplay, mean_torques, replay_in_mujoco
from deltaopt.robot.model import delta_model

COUNTS = (500, 1000)


def test_torques_lead_to_the_goal(picked):
    found = replay_in_mujoco(picked.trajectory, COUNTS)
    assert found.converges
    assert found.order == pytest.approx(1.0, abs=0.1)
    assert found.misses[-1] < 1e-5
    assert found.steps == tuple(picked.duration / count for count in COUNTS)


def test_torques_of_another_payload_do_not(picked):
    scene = picked.scene
    heavier = replace(picked.trajectory, model=delta_model(scene.robot, 1.01 * scene.payload))
    model = picked.trajectory.model
    there = InMujoco(model.robot, model.payload, scene.start)
    other = MujocoReplay((1.0, 0.5), tuple(there.miss(heavier, count) for count in COUNTS))
    assert not other.converges
    assert min(other.misses) > 1e-4


def test_a_motion_that_begins_at_a_speed_and_has_friction():
    """The second half of a motion, whose time does not begin at zero."""
    line = deltaopt.baseline(deltaopt.load_scene("problems/industrial_drive.yaml"))
    knots = np.linspace(0.4, 1.0, 40) * line.duration
    x, v = line.position.with_rate_at(knots)
    half = replace(line, position=line.position.hermite(knots, x, v))
    found = replay_in_mujoco(half, COUNTS)
    assert found.converges
    assert found.misses[-1] < 1e-3 * np.linalg.norm(x[-1] - x[0])


def test_mean_torques_count_jumps_for_as_long_as_they_last(picked):
    motion, count = picked.trajectory, 7
    t = np.linspace(0, motion.duration, 140_001)
    middle = (t[1:] + t[:-1]) / 2
    dense = motion(middle).tau.reshape(count, -1, 3).mean(axis=1)
    np.testing.assert_allclose(mean_torques(motion, count), dense, atol=1e-3)


def test_from_the_command_line(picked, tmp_path, capsys, monkeypatch):
    picked.save(tmp_path, chart=False)
    right = MujocoReplay((2e-4, 1e-4), (2e-5, 1e-5))
    monkeypatch.setattr("deltaopt.cli.verify.replay_in_mujoco", lambda trajectory: right)
    assert main(["verify", str(tmp_path), "--with", "mujoco"]) == 0
    told = capsys.readouterr().out
    assert "replayed in MuJoCo:\n  steps of 200 µs: 0.02 mm from the goal\n" in told
    assert "it converges to the goal" in told
    monkeypatch.undo()
    monkeypatch.setattr("deltaopt.output.mujoco_replay.STEPS", COUNTS)
    assert main(["verify", str(tmp_path), "--with", "mujoco", "--json"]) == 0
    content = json.loads(capsys.readouterr().out)["mujoco"]
    assert content["converges"]
    assert len(content["misses"]) == len(content["steps"]) == len(COUNTS)


def test_a_replay_that_fails_is_exit_1(picked, tmp_path, capsys, monkeypatch):
    picked.save(tmp_path, chart=False)
    wrong = MujocoReplay((2e-4, 1e-4), (1e-3, 1e-3))
    monkeypatch.setattr("deltaopt.cli.verify.replay_in_mujoco", lambda trajectory: wrong)
    assert main(["verify", str(tmp_path), "--with", "mujoco"]) == 1
    assert "in MuJoCo the torques do not lead to the goal" in capsys.readouterr().err


def test_without_mujoco_one_sentence(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert main(["verify", str(tmp_path), "--with", "mujoco"]) == 1
    said = capsys.readouterr().err
    in_clone = "pip install -e '.[mujoco]' in the clone"
    with_wheel = "pip install 'deltaopt[mujoco]' with a wheel"
    assert said == f"deltaopt: mujoco is not installed: {in_clone}, or {with_wheel}\n"


def test_a_table_has_no_torques(tmp_path, capsys):
    assert main(["verify", str(tmp_path / "t.csv"), "--with", "mujoco"]) == 2
    assert "has none" in capsys.readouterr().err
