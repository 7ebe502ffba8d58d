"""Motions that leave their scene's path fail."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import deltaopt
from deltaopt.motion.trajectory import PiecewisePolynomial, Trajectory

PROBLEMS = Path(__file__).parents[2] / "problems"


def test_a_free_motion_is_off_the_path():
    line = deltaopt.load_scene(PROBLEMS / "paths" / "glue_line.yaml")
    free = deltaopt.plan(line.model_copy(update={"path": None}))
    report = deltaopt.verify(line, free.trajectory)
    x = free.trajectory(np.linspace(0, free.duration, 2001)).x
    away = np.linalg.norm(x[:, [0, 2]] - np.array(line.start)[[0, 2]], axis=1).max()
    assert report.path_distance == pytest.approx(away, rel=1e-2)
    assert any("off the scene's path" in sentence for sentence in report.failures())


def test_a_micrometre_is_seen():
    lane = deltaopt.load_scene(PROBLEMS / "paths" / "safe_lane.yaml")
    plan = deltaopt.plan(lane, tolerance=1e-2)
    assert deltaopt.verify(lane, plan.trajectory).path_distance < 1e-14
    knots, coefficients = plan.trajectory.knots, plan.trajectory.position.coefficients.copy()
    coefficients[:, 0] += 1e-6 * np.array([1.0, 0.0, 0.0])
    moved = Trajectory(PiecewisePolynomial(knots, coefficients), plan.trajectory.model)
    report = deltaopt.verify(lane, moved)
    assert report.path_distance == pytest.approx(1e-6, rel=1e-6)
    assert not report.ok


def test_a_free_scene_has_no_such_measure():
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    report = deltaopt.verify(scene, deltaopt.baseline(scene))
    assert report.path_distance is None
