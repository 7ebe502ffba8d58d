"""The robot in MuJoCo, all of whose parallelograms have two bars: its torques are ours."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from deltaopt.cli import main
from deltaopt.output.mjcf import mjcf
from deltaopt.robot.model import DeltaModel
from studies.mujoco_replay import torque_difference
from tests.mechanisms.test_terms_beyond_the_paper import PAYLOAD, PLAIN, ROBOT


@pytest.mark.parametrize("name", ROBOT)
def test_torques_of_fast_motions(name):
    assert torque_difference(ROBOT[name], PAYLOAD, 5) < 1e-11


def test_motors_that_hold_the_robot_hold_it_in_mujoco():
    start = (0.85, 0.1, -0.05)
    model = mujoco.MjModel.from_xml_string(mjcf(PLAIN, PAYLOAD, start))
    data = mujoco.MjData(model)
    zero = np.zeros(3)
    data.ctrl[:] = DeltaModel(PLAIN, PAYLOAD).inverse_dynamics(start, zero, zero)
    mujoco.mj_forward(model, data)
    assert np.abs(data.qacc).max() < 1e-2  # of gravity's 9.81, which MuJoCo's soft joints leave
    down, y, z = start
    np.testing.assert_allclose(data.site("tool").xpos, [z, y, -down], atol=1e-12)


def test_file_from_the_command_line(tmp_path, capsys):
    file = tmp_path / "new" / "robot.xml"
    robot = "problems/robots/industrial_drive.yaml"
    assert main(["export", "mjcf", robot, "--payload", "0.5", "-o", str(file)]) == 0
    model = mujoco.MjModel.from_xml_path(str(file))
    assert model.nv == 21
    assert model.neq == 6
    total = 3 * (1.0 + 0.1 + 0.4 + 0.05) + 0.4 + 0.25 + 0.5  # of the file
    assert model.body_mass.sum() == pytest.approx(total, rel=1e-12)
    assert str(file) in capsys.readouterr().out
