"""The example of one's own mechanism, held to energy."""

import runpy
from pathlib import Path

import numpy as np
import pytest

SCRIPT = Path(__file__).parents[2] / "examples" / "11_own_mechanism.py"


@pytest.fixture(scope="module")
def example():
    return runpy.run_path(str(SCRIPT))


def test_no_work_is_done_in_a_turn_at_constant_speed(example):
    angle, torque, _ = example["one_turn"](example["setup"](), 2000)
    assert abs(np.trapezoid(torque, angle)) < 1e-9 * np.abs(torque).max()


def test_without_gravity_torque_grows_with_the_square_of_the_speed(example):
    slow, fast, faster = (example["one_turn"](example["setup"](), n) for n in (1000, 2000, 3000))
    for i in (1, 2):  # a + b n²: gravity drops out of differences
        np.testing.assert_allclose(
            (faster[i] - slow[i]) / 8, (fast[i] - slow[i]) / 3, atol=1e-12 * abs(faster[i]).max()
        )
