"""Plans whose arms and forearms keep clear of bodies too."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import load_robot, load_scene, plan, verify
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


def test_what_is_planned_nearer_to_a_wall_is_no_longer_than_what_keeps_farther_away():
    wall = {
        "from": [0.573128245576581, -0.2911012543769259, -0.21188541710378767],
        "to": [1.4448810624776138, -0.1619093497776376, 0.13185780590480128],
    }
    scene = Scene(
        robot=load_robot(PROBLEMS / "robots" / "industrial.yaml"),
        payload=1.0,
        start=[0.7477214452473553, -0.106844519233663, 0.2783697904158795],
        goal=[0.5951296261778865, -0.3461660849209005, -0.3583974016148659],
        keep_out=[{"box": wall}],
        robot_keeps_clear=True,
    )
    found, farther = (plan(scene.model_copy(update={"clearance": each})) for each in (None, 2e-3))
    assert found.duration <= farther.duration
    assert farther.duration <= (1 + 3e-3) * found.duration  # it costs some 0.2 %
    assert verify(scene, found.trajectory).ok


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
