"""The controller's angles: zero and sign of each motor, and a robot whose references are public."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from deltaopt.output.controller_c import export_c
from deltaopt.robot.joints import Joints
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import load_robot

ROOT = Path(__file__).parents[2]
RL5 = load_robot(ROOT / "problems/robots/rl5.yaml")
POINTS = np.loadtxt(ROOT / "tests/data/rl5_points.csv", delimiter=",", skiprows=4)


def platform() -> np.ndarray:
    """Centre of RL5's platform, (9, 3), m, in our frame: its tool's point less the wrist."""
    q4, q5 = POINTS[:, 4], POINTS[:, 5]
    wrist = np.stack(
        [
            0.0632 * np.cos(q4) + 0.135 * np.cos(q4) * np.sin(q5),
            0.0632 * np.sin(q4) + 0.135 * np.sin(q4) * np.sin(q5),
            -0.132 - 0.135 * np.cos(q5),
        ],
        axis=1,
    )
    X, Y, Z = (POINTS[:, 6:9] - wrist).T
    return np.stack([-Z, X, Y], axis=1)


def test_rl5s_references_lead_to_its_tool_positions():
    """Forward kinematics of the joints' references, to 1e-7 mm; and back, to 1e-10 rad."""
    assert RL5.joints is not None
    model = DeltaModel(RL5)
    theta = RL5.joints.angle_from_controller(POINTS[:, 1:4])
    assert np.abs(model.forward_kinematics(theta) - platform()).max() < 1e-10
    back = RL5.joints.angle_to_controller(model.inverse_kinematics(platform())[:, 3::3])
    assert np.abs(back - POINTS[:, 1:4]).max() < 1e-10


def test_a_zero_that_is_forgotten_costs_centimetres():
    """41 mm on the average: the elbow is 0.42 m x 0.093 rad = 39 mm off."""
    wrong = DeltaModel(RL5).forward_kinematics(POINTS[:, 1:4])
    away = np.linalg.norm(wrong - platform(), axis=1)
    assert away.mean() == pytest.approx(0.041, abs=5e-4)
    assert away.min() > 0.037


@pytest.mark.parametrize(
    "joints",
    [
        Joints(),
        Joints(zero=0.3),
        Joints(sign=-1),
        Joints(zero=(0.1, -0.2, 0.3), sign=(1, -1, -1)),
    ],
)
def test_there_and_back(joints):
    rng = np.random.default_rng(3)
    theta, rate = rng.uniform(-1, 1, (2, 7, 3))
    angle, turned = joints.angle_to_controller(theta), joints.rate_to_controller(rate)
    np.testing.assert_allclose(joints.angle_from_controller(angle), theta, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(joints.rate_from_controller(turned), rate)
    signs = np.broadcast_to(joints.sign or 1.0, 3)
    zeros = np.broadcast_to(joints.zero or 0.0, 3)
    np.testing.assert_allclose(theta, signs * angle - zeros, rtol=0, atol=1e-15)


def test_motion_and_power_are_the_same_on_both_sides():
    """The controller's speed is the rate of its angle; power is the same number on both sides."""
    joints = Joints(zero=(0.1, -0.2, 0.3), sign=(1, -1, -1))
    rng = np.random.default_rng(4)
    theta, speed, torque = rng.uniform(-1, 1, (3, 5, 3))
    h = 1e-6
    ahead, behind = (joints.angle_to_controller(theta + s * h * speed) for s in (1, -1))
    turned = joints.rate_to_controller(speed)
    np.testing.assert_allclose((ahead - behind) / (2 * h), turned, atol=1e-9)
    power = joints.rate_to_controller(torque) * turned
    np.testing.assert_array_equal(power, torque * speed)


def test_c_says_how_the_controller_counts(tmp_path):
    export_c(RL5, tmp_path)
    header = (tmp_path / "delta.h").read_text(encoding="utf-8")
    assert f"motor 3: theta = +1 * angle - {RL5.joints.zero!r}; speed" in header
    export_c(load_robot(ROOT / "problems/robots/orsino.yaml"), tmp_path)
    assert "counts its angles" not in (tmp_path / "delta.h").read_text(encoding="utf-8")
