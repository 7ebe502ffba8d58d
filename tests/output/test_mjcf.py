"""The robot in MuJoCo, all of whose parallelograms have two bars: its torques are ours."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from deltaopt.cli import main
from deltaopt.output.mjcf import mjcf
from deltaopt.output.mujoco_replay import InMujoco, of_joints
from deltaopt.robot.model import DeltaModel
from studies.bench.random_scenes import random_scenes
from tests.mechanisms.test_terms_beyond_the_paper import PAYLOAD, PLAIN, ROBOT


@pytest.mark.parametrize("name", ROBOT)
def test_torques_of_fast_motions(name):
    rng = np.random.default_rng(5)
    model, found = DeltaModel(ROBOT[name], PAYLOAD), []
    for scene in random_scenes(ROBOT[name], PAYLOAD, 5, seed=5):
        v, a = 2.0 * rng.normal(size=3), 100.0 * rng.normal(size=3)
        start, goal = scene.given_points
        there = InMujoco(ROBOT[name], PAYLOAD, start)
        other = torques(there, *model.motion(goal, v, a))
        found.append((other, model.inverse_dynamics(goal, v, a)))
    theirs, ours = (np.array(each) for each in zip(*found, strict=True))
    assert np.abs(theirs - ours).max() < 1e-11 * np.abs(ours).max()


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


def torques(there, q, dq, ddq):
    """Motor torques, (3,), N·m, that a motion of the twelve coordinates needs in MuJoCo.

    MuJoCo's forces on all 21 coordinates are what the three motors and eighteen forces in the
    joints of the platform must give together.
    """
    data, model = there.data, there.model
    there.put(q, dq)
    data.qacc[:3] = ddq[:3]
    for k in range(3):
        data.qacc[6 + 5 * k : 11 + 5 * k] = of_joints(ddq[3 + 3 * k : 6 + 3 * k])
    acceleration = np.array(data.qacc)
    mujoco.mj_forward(model, data)
    force = np.zeros(model.nv)
    mujoco.mj_mulM(model, data, force, acceleration)
    force += data.qfrc_bias - data.qfrc_passive
    joints = np.array(data.efc_J).reshape(data.nefc, model.nv)
    shafts = np.eye(model.nv)[6::5]
    share, *_ = np.linalg.lstsq(np.vstack([shafts, joints]).T, force, rcond=None)
    return share[:3] + there.coulomb(dq[3::3])
