"""Paths of straight lines past bodies."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from deltaopt import Scene, load_robot
from deltaopt.planning.first_motions.passages import paths_of_lines, shortest_paths
from studies.problems import PROBLEMS
from tests.limits.test_links import lines

BLOCK = {"from": [-0.05, -0.05, -0.025], "to": [0.0, 0.05, 0.025]}
WALL = {"from": [0.121, -0.2503, -0.517], "to": [1.21, -0.1746, 0.643]}


def test_a_block_is_led_over_a_wall_that_reaches_almost_to_the_top_of_the_workspace():
    """Places of a grid that are clear by little have lines between them that are not."""
    robot = load_robot(PROBLEMS / "robots" / "orsino.yaml")
    robot = robot.model_copy(update={"tool": {"shapes": [{"box": BLOCK}]}})
    start, goal = (0.379, -0.331, -0.045), (0.421, -0.094, 0.145)
    scene = Scene(robot=robot, start=start, goal=goal, keep_out=[{"box": WALL}])
    corners = next(shortest_paths(scene))
    assert np.array_equal(corners[[0, -1]], [start, goal])
    share = np.linspace(0, 1, 501)[:, None]
    places = np.vstack([a + share * (b - a) for a, b in pairwise(corners)])
    low, high = places + BLOCK["from"], places + BLOCK["to"]
    apart = (low > WALL["to"]) | (high < WALL["from"])
    assert apart.any(axis=1).all()


def test_paths_of_lines_keep_links_clear_too():
    """By the lines of the links at dense places of the path, and the box's own distance."""
    low, high = np.array([0.28718, -0.18459, -0.03204]), np.array([1.94371, -0.0212, 0.134])
    scene = Scene(
        robot=load_robot(PROBLEMS / "robots" / "industrial_links.yaml"),
        payload=1.0,
        start=[0.49321, -0.52745, -0.38044],
        goal=[0.71329, 0.32166, 0.4824],
        keep_out=[{"box": {"from": low.tolist(), "to": high.tolist()}}],
    )
    assert least_distance_of_forearms(scene, low, high) < 0.01
    radius = scene.robot.forearm.radius
    planned = tuple((link, 0, radius) for link in (1, 3, 5))
    found = scene.model_copy(update={"planned_links": planned})
    assert least_distance_of_forearms(found, low, high) >= radius


def test_places_where_arms_and_bars_are_in_line_are_on_no_path():
    """A grid over all that the robot reaches has such places, where links have no angles."""
    robot = {"name": "lines", "base_radius": 0.0, "platform_radius": 0.0, "gravity": 0.0}
    robot |= {"drive": {"torque": 15.0}, "platform": {"mass": 0.5}}
    robot["upper_arm"] = {"length": 0.25, "mass": 0.0}
    robot["forearm"] = {"length": 0.6, "mass": 0.0}
    wall = {"from": [0.04779, -0.02574, -1.16085], "to": [1.56944, 0.20692, 0.62774]}
    scene = Scene(
        robot=robot,
        start=[0.67515, -0.22866, -0.1695],
        goal=[0.07982, 0.40984, -0.36361],
        keep_out=[{"box": wall}],
    )
    assert list(paths_of_lines(scene.model_copy(update={"planned_links": ((1, 0, 1e-3),)}))) == []


def least_distance_of_forearms(scene: Scene, low: np.ndarray, high: np.ndarray) -> float:
    """From a box, of the lines of the forearms along the shortest path of lines, m."""
    corners = next(iter(shortest_paths(scene)))
    places = [a + s * (b - a) for a, b in pairwise(corners) for s in np.linspace(0, 1, 61)]
    begin, end = (each[:, 1::2] for each in lines(scene, np.array(places)))
    x = begin + np.linspace(0, 1, 201)[:, None, None, None] * (end - begin)
    outside = np.maximum(np.maximum(low - x, x - high), 0)
    return float(np.linalg.norm(outside, axis=-1).min())
