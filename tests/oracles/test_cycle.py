"""The oracle of cycles, another transcription of all legs together, against motions alone."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import Effort, Scene, TimeAndEffort, load_robot, plan, verify
from studies.problems import PROBLEMS
from tests.oracles.cycle import Asked, Leg, best_cycle

INDUSTRIAL, HORNET = (
    load_robot(PROBLEMS / "robots" / f"{name}.yaml") for name in ("industrial", "hornet_565")
)
WEIGHT = 5e-4
"""Of the effort beside the duration, 1/(N²m²)."""
HERE, THERE = (0.85, -0.1525, 0.0), (0.85, 0.1525, 0.0)


def fastest(start, goal, payload=None, robot=INDUSTRIAL, **more):
    scene = Scene(robot=robot, start=start, goal=goal, payload=payload, **more)
    return plan(scene, tolerance=1e-5)


def of_oracle(start, *legs, robot=INDUSTRIAL, **asked):
    """With 16 intervals of a leg, divided once where torques jump: durations are too long by 5e-5
    at most."""
    return best_cycle(Asked(robot, start, legs, **asked), 16, 1)


def rms_torques(found):
    motors = verify(found.scene, found.trajectory).duty.motors
    return np.array([motor.rms_torque for motor in motors])


def test_without_a_limit_of_the_whole_a_leg_is_the_fastest_motion():
    """The dwell changes nothing. The drive's torque falls with speed."""
    found = of_oracle(HERE, Leg(THERE, 1.0, dwell=0.05), robot=HORNET)
    assert found.durations == pytest.approx([fastest(HERE, THERE, 1.0, HORNET).duration], rel=1e-4)
    assert found.period == pytest.approx(sum(found.durations) + 0.05, rel=1e-12)


def test_the_heat_of_a_motion_in_a_given_time_is_its_effort():
    found = of_oracle(HERE, Leg(THERE, 1.0), rated=20.0, is_limited=False, period=0.2)
    alone = fastest(HERE, THERE, 1.0, objective=Effort(duration=0.2))
    assert found.heat == pytest.approx(alone.cost / 20.0**2, rel=1e-5)


def test_motions_of_one_weight_of_effort_are_the_cycle_of_their_rms():
    """Of the motions with as much heat in each motor the fastest are those of least T + w ∫ τᵀτ dt,
    legs with the same w: their weights of the limits are the same."""
    dwell, legs = 0.05, ((HERE, THERE, 1.0), (THERE, HERE, None))
    alone = [fastest(*leg, objective=TimeAndEffort(effort=WEIGHT)) for leg in legs]
    squares = sum(each.duration * rms_torques(each) ** 2 for each in alone)
    still = alone[0].trajectory.model.inverse_dynamics(THERE, np.zeros(3), np.zeros(3))
    durations = [each.duration for each in alone]
    period = sum(durations) + dwell
    rated = tuple(np.sqrt((squares + dwell * still**2) / period).tolist())
    found = of_oracle(HERE, Leg(THERE, 1.0, dwell), Leg(HERE), rated=rated)
    assert found.rms == pytest.approx(rated, rel=1e-6)
    assert found.period == pytest.approx(period, rel=2e-5)
    assert found.durations == pytest.approx(durations, rel=1e-4)
