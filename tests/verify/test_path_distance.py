"""Motions that leave their scene's path fail."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import deltaopt
from deltaopt.motion.trajectory import PiecewisePolynomial, Trajectory
from deltaopt.verify.path_distance import nearest_places

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


def test_the_nearest_place_of_a_path_is_found_beyond_the_centres_of_its_bends():
    """Where a tube is thicker than a bend, two places of the path may be nearly as near."""
    start, goal = (0.5, -0.2, 0.0), (0.48, 0.15, 0.1)
    path = deltaopt.PickAndPlace(height=0.04, blend=0.02).between(start, goal)
    rng = np.random.default_rng(5)
    on, away = path(rng.uniform(path.knots[0], path.knots[-1], 4000)), rng.normal(size=(4000, 3))
    x = on + 0.035 * away / np.linalg.norm(away, axis=1)[:, None]
    s, found = nearest_places(path, x)
    np.testing.assert_allclose(np.linalg.norm(path(s) - x, axis=1), found, atol=1e-15)
    dense = path(np.linspace(path.knots[0], path.knots[-1], 4001))
    apart = np.linalg.norm(np.diff(dense, axis=0), axis=1).max()
    parts = (part[:, None] - dense for part in np.array_split(x, 40))
    sampled = np.concatenate([np.linalg.norm(part, axis=2).min(axis=1) for part in parts])
    assert (found <= sampled + 1e-15).all()
    np.testing.assert_allclose(found, sampled, rtol=0, atol=apart / 2)
