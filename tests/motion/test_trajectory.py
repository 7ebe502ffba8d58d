"""Trajectories as functions of time: inside, outside, and with arguments that make no sense."""

from __future__ import annotations

import re
from dataclasses import fields

import numpy as np
import pytest

from deltaopt.motion.motion_sequence import waiting
from deltaopt.motion.trajectory import Motion
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.scene.scene_file import load_scene
from studies.problems import PROBLEMS

SCENE = load_scene(PROBLEMS / "pick_and_place.yaml")
LINE = baseline(SCENE)


@pytest.mark.parametrize(
    ("late", "place"),
    [(-1.0, SCENE.start), (LINE.duration + 1e-6, SCENE.goal), (np.inf, SCENE.goal)],
)
def test_outside_the_platform_is_held_at_rest(late, place):
    """The torques at rest are those that balance gravity: dV/dθ, here by differences of V."""
    held = LINE(late)
    assert held.t == late
    np.testing.assert_allclose(held.x, place, atol=1e-12)
    for still in (held.v, held.a, held.dtheta, held.ddtheta):
        assert not still.any()
    step = 1e-5
    for motor, change in enumerate(step * np.eye(3)):
        ahead, behind = (potential_energy(held.theta + way * change) for way in (1, -1))
        assert held.tau[motor] == pytest.approx((ahead - behind) / (2 * step), abs=1e-6)


def potential_energy(theta):
    """Of platform, payload, arms and bars, J; x is down, and the bars' centres are halfway."""
    robot, platform = SCENE.robot, LINE.model.forward_kinematics(theta)[0]
    elbows = -robot.upper_arm.length * np.sin(theta)
    moment = (robot.platform.mass + SCENE.payload) * platform
    moment += (robot.upper_arm.mass * elbows / 2).sum()
    moment += (robot.forearm.mass * (elbows + platform) / 2).sum()
    return -robot.gravity * moment


def test_no_times_give_empty_arrays():
    nothing = LINE([])
    assert nothing.t.shape == (0,)
    assert all(getattr(nothing, each.name).shape == (0, 3) for each in fields(Motion)[1:-1])
    assert nothing.under_way is LINE


def test_an_instant_has_vectors_and_instants_have_rows_of_them():
    t = 0.3 * LINE.duration
    one, several = LINE(t), LINE([t])
    for name in ("x", "v", "a", "theta", "dtheta", "ddtheta", "tau"):
        assert getattr(one, name).shape == (3,)
        np.testing.assert_array_equal(getattr(several, name), [getattr(one, name)])
    assert (np.shape(one.t), several.t.shape) == ((), (1,))
    assert one.under_way is LINE


def test_rounding_beyond_the_end_is_the_end():
    last, beyond = LINE(LINE.duration), LINE(LINE.duration * (1 + 2e-16))
    np.testing.assert_array_equal(beyond.tau, last.tau)
    np.testing.assert_array_equal(beyond.a, last.a)


@pytest.mark.parametrize("times", [[np.nan], [[0.0, 0.1]]])
def test_times_that_make_no_sense(times):
    with pytest.raises(ValueError, match=r"^t (contains nan|has shape .*); a number or an array"):
        LINE(times)


@pytest.mark.parametrize("factor", [0, -1, np.nan, np.inf, 1e-300, 1e300])
def test_factors_that_make_no_sense(factor):
    with pytest.raises(
        ValueError, match=rf"^factor is {re.escape(str(factor))}; it must be finite and"
    ):
        LINE.slowed(factor)


def test_trajectories_are_equal_bit_by_bit():
    again, other = baseline(SCENE), LINE.slowed(1 + 1e-15)
    assert {LINE: "line", other: "other"}[again] == "line"
    assert again.position == LINE.position
    assert other != LINE
    assert other.position != LINE.position


@pytest.mark.parametrize("velocity", [1e-20, 0.3])
@pytest.mark.parametrize("duration", [1e-12, 1e-7, 1.0])
def test_a_wait_has_no_acceleration_however_short(duration, velocity):
    """By a cubic through both ends it had one of rounding, over the square of its duration."""
    wait = waiting(LINE.model, SCENE.start, (0.0, velocity, 0.0), duration)
    motion = wait([0.0, duration / 2, duration])
    assert not motion.a.any()
    assert (motion.v == (0.0, velocity, 0.0)).all()
    assert motion.x[-1, 1] == SCENE.start[1] + duration * velocity
