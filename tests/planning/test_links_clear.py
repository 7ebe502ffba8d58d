"""Plans whose arms and forearms keep clear of bodies too."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import load_scene, plan, verify
from deltaopt.errors import Infeasible
from deltaopt.scene.scene import Scene
from studies.problems import PROBLEMS
from tests.limits.test_links import lines

COLUMN = load_scene(PROBLEMS / "keep_out" / "beside_a_column.yaml")
WITHOUT = COLUMN.model_copy(update={"robot_keeps_clear": None})


def clearance(scene: Scene, motion) -> float:
    """The least distance of all links from the column, by dense samples of instants and lines, m:
    by the column's own axis, which is upright."""
    column = scene.keep_out[0].cylinder
    (low, high), axis = sorted((column.ends[0][0], column.ends[1][0])), np.array(column.centre)
    begin, end = lines(scene, motion.position.at(np.linspace(0, motion.duration, 401)))
    least = np.inf
    for share in np.linspace(0, 1, 401):
        x = begin + share * (end - begin)
        across = np.linalg.norm((x - axis)[..., 1:], axis=-1) - column.radius
        beyond = np.maximum(low - x[..., 0], x[..., 0] - high)
        outside = np.hypot(np.maximum(across, 0), np.maximum(beyond, 0))
        inside = np.minimum(np.maximum(across, beyond), 0)
        radii = [scene.robot.upper_arm.radius, scene.robot.forearm.radius] * 3
        least = min(least, float((outside + inside - radii).min()))
    return least


def test_a_forearm_that_would_hit_a_body_is_led_around_it():
    free, clear = plan(WITHOUT), plan(COLUMN)
    assert clearance(COLUMN, free.trajectory) < -5e-3
    assert clearance(COLUMN, clear.trajectory) >= COLUMN.clearance - 1e-9
    assert verify(COLUMN, clear.trajectory).ok
    assert verify(WITHOUT, free.trajectory).ok
    assert clear.within_tolerance
    assert 1.001 < clear.duration / free.duration < 1.1
    assert clear.scene == COLUMN


def test_bodies_that_no_link_comes_near_change_nothing():
    beside = {"sphere": {"centre": [1.3, 0.0, 0.0], "radius": 0.1}}
    durations = [
        plan(COLUMN.model_copy(update={"keep_out": [beside], "robot_keeps_clear": key})).duration
        for key in (True, None)
    ]
    assert durations[0] == durations[1]


def test_on_a_given_path_there_is_no_way_around():
    with pytest.raises(Infeasible, match=r"^the path: on it forearm \d comes .* to keep_out\[0\]"):
        plan(COLUMN.model_copy(update={"path": "line"}))


def test_an_arm_that_turns_past_a_body_at_any_rate_is_named():
    """Where an arm is depends on its angle alone, and a body there is on no way around."""
    industrial = load_scene(PROBLEMS / "industrial_cross.yaml")
    ends = lines(industrial, np.linspace(*industrial.given_points, 41))
    middles = (ends[0] + ends[1])[:, ::2] / 2
    turned = np.linalg.norm(middles - middles[:1], axis=-1)
    arm = int(turned[-1].argmax())
    half = int(np.abs(turned[:, arm] - turned[-1, arm] / 2).argmin())
    sphere = {"centre": middles[half, arm].tolist(), "radius": float(turned[-1, arm]) / 8}
    with_sphere = {"keep_out": [{"sphere": sphere}], "robot_keeps_clear": True}
    with pytest.raises(Infeasible, match=rf"arm {arm + 1} turns past .* to keep_out\[0\]$"):
        plan(industrial.model_copy(update=with_sphere))
