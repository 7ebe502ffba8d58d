"""The oracles of keep-out bodies, and that passages are looked for where walls leave them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from deltaopt import load_robot
from deltaopt.planning.first_motions.passages import _StraightLines, shortest_paths
from deltaopt.verify.clearance import distance_from
from studies.keep_out.passages import CLOSED, KINDS, planted
from studies.keep_out.planned import PLANNED, planned
from studies.keep_out.random_bodies import BODIES, scene_of, with_bodies
from studies.problems import INDUSTRIAL
from tests.oracles.body_distances import tool_distances
from tests.oracles.clear_grid import ClearGrid

ROBOT = load_robot(INDUSTRIAL)


def lines_of(path: np.ndarray) -> np.ndarray:
    """Places along the lines of a path, close together."""
    share = np.linspace(0, 1, 400)[:, None]
    return np.vstack([a + share * (b - a) for a, b in pairwise(path)])


def test_distances_of_the_oracle_are_those_of_verification():
    """Two derivations, of all kinds of bodies."""
    move, rng = scene_of(ROBOT, 1, 0), np.random.default_rng(1)
    bodies = [make(rng, rng.normal([0.6, 0, 0], 0.2), 0.4) for make in BODIES for _ in range(4)]
    scene = with_bodies(move, bodies, 0.01)
    x = rng.uniform([0.3, -0.6, -0.6], [1.0, 0.6, 0.6], (300, 3))
    ours = tool_distances(scene, x)
    assert {body.kind for body in scene.keep_out} == {
        "sphere",
        "box",
        "cylinder",
        "half-space",
        "hull",
    }
    for index, body in scene.obstacles:
        np.testing.assert_allclose(ours[:, index], distance_from(body, x)[0], atol=1e-12)


@pytest.mark.parametrize("kind", KINDS[:3])  # hulls take half a minute to compile
def test_the_grid_finds_planted_passages_alone(kind):
    """Its path is clear between its places too, and there is none where the passage is closed."""
    wall = planted(ROBOT, kind, 0.001, 1, 1)
    path = ClearGrid.of(wall.scene, 0.06, wall.on_the_way).path()
    assert tool_distances(wall.scene, lines_of(path)).min() >= 0
    np.testing.assert_allclose(path[[0, -1]], wall.scene.given_points)
    closed = planted(ROBOT, kind, CLOSED, 1, 1)
    assert ClearGrid.of(closed.scene, 0.06, closed.on_the_way).path() is None


@pytest.mark.parametrize("kind", ["slot", "window", "two slots"])
def test_paths_of_lines_lead_through_passages(kind):
    """A millimetre wide, by walls whose edges are metres long."""
    scene = planted(ROBOT, kind, 0.001, 1, 2).scene
    path = next(shortest_paths(scene), None)
    assert tool_distances(scene, lines_of(path)).min() >= 0


def test_a_line_that_begins_on_a_body_is_not_clear_of_it():
    """On a surface the distance's slope may be told as nothing, which says nothing."""
    move = scene_of(ROBOT, 1, 0)
    box = {"box": {"from": [0.65, -0.1, -0.1], "to": [0.75, 0.1, 0.1]}}
    lines = _StraightLines(with_bodies(move, [box], None), 0.0)
    through, away = [0.7, 0.0, -0.3], [0.7, 0.1, 0.3]
    clear = lines.are_clear(np.array([0.7, 0.0, 0.1]), np.array([through, away]))
    assert clear.tolist() == [False, True]


def test_a_window_that_no_mesh_finds_its_way_through(tmp_path):
    """1.5 mm to each side of a point: solutions lead through the wall between two points of the
    mesh. The motion passes near the corners of the shortest path instead, and says so: what another
    one would save is not known."""
    wall = planted(ROBOT, "window", 0.003, 1, 3)
    found = planned(wall.scene, 3, 0.05, tmp_path, wall.on_the_way)
    assert found.outcome == PLANNED
    assert found.duration < 0.25
    assert not list(tmp_path.iterdir())
