"""Paths of straight lines past bodies."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from deltaopt import Scene, load_robot
from deltaopt.planning.first_motions.passages import shortest_paths
from studies.problems import PROBLEMS

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
