"""Peers that fix the path: the paths they are given, and what is said where they are missing."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt.output.joint_table import platform_motion
from deltaopt.planning.planner import Planner
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import load_robot
from deltaopt.scene.scene_file import load_scene
from studies.bench import fixed_paths
from studies.bench.fixed_paths import driven, straight
from studies.problems import PROBLEMS

ORSINO = load_robot(PROBLEMS / "robots" / "orsino.yaml")
PICK = load_scene(PROBLEMS / "pick_and_place.yaml")


def test_a_driven_path_by_its_length():
    """Against differences of its positions: tangents of length one, curvature between."""
    motion = Planner(ORSINO, 1.0).plan(PICK.start, PICK.goal).trajectory
    path = driven(motion, 200)
    x, tangent, curvature = path.derivatives
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=1), 1.0, rtol=1e-12)
    inner = slice(400, 600)  # the third interval, away from rest
    slopes = np.gradient(x[inner], path.s[inner], axis=0)[1:-1]
    np.testing.assert_allclose(tangent[inner][1:-1], slopes, atol=1e-5)
    bends = np.gradient(tangent[inner], path.s[inner], axis=0)[1:-1]
    np.testing.assert_allclose(curvature[inner][1:-1], bends, atol=1e-3 * np.abs(bends).max())


def test_motors_and_platform_move_together():
    model, rng = DeltaModel(ORSINO, 1.0), np.random.default_rng(1)
    x = np.array(PICK.start) + 0.02 * rng.normal(size=(5, 3))
    v, a = rng.normal(size=(2, 5, 3))
    of_motors = (each[:, 3::3] for each in model.motion(x, v, a))
    np.testing.assert_allclose(
        platform_motion(model, *of_motors), (x, v, a), rtol=1e-10, atol=1e-10
    )


def test_toppra_drives_our_path_as_fast_as_we_do():
    """On a grid fine enough, and faster by no more than the gap that the plan states."""
    pytest.importorskip("toppra")
    plan = Planner(ORSINO, 1.0).plan(PICK.start, PICK.goal)
    coarse, fine = (
        fixed_paths.toppra_duration(plan.scene, driven(plan.trajectory, pieces)) / plan.duration
        for pieces in (32, 256)
    )
    assert 1 - plan.gap < fine < 1 + 3e-4
    assert fine < coarse < 1 + 2e-3
    line = fixed_paths.toppra_duration(plan.scene, straight(plan.scene, 100))
    assert line > plan.duration


@pytest.mark.parametrize("intervals", [20, 100])
def test_toppra_keeps_torques_at_both_ends_of_an_interval(intervals):
    """By inverse dynamics, on grids so coarse that held at the beginnings alone they are broken."""
    pytest.importorskip("toppra")
    model, path = DeltaModel(ORSINO, 1.0), straight(PICK, intervals)
    speeds = fixed_paths.toppra_speeds(PICK, path)
    x, tangent, curvature = path.derivatives
    along = np.diff(speeds**2) / (2 * np.diff(path.s))
    shares = []
    for at in (slice(None, -1), slice(1, None)):
        v = tangent[at] * speeds[at, None]
        a = tangent[at] * along[:, None] + curvature[at] * speeds[at, None] ** 2
        torques = model.inverse_dynamics(x[at], v, a)
        shares.append(np.abs(torques / np.array(ORSINO.torque_limits)).max(axis=1))
    assert np.max(shares) < 1 + 1e-6
    assert np.median(np.max(shares, axis=0)) > 0.99  # bang-bang: but for the switch
