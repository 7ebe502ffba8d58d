"""Bows past bodies: clear by distances written out by hand, on all sides on which there is room."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from deltaopt.planning.first_motions.bands import Bodies
from deltaopt.planning.first_motions.bows import bows
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from studies.problems import PROBLEMS

CROSS = load_scene(PROBLEMS / "paths" / "industrial_25_305_25.yaml").model_copy(
    update={"path": None}
)
START, GOAL = np.array(CROSS.given_points)
MIDDLE = (START + GOAL) / 2
SHARES = np.linspace(0.0, 1.0, 401)


def with_bodies(*bodies: dict) -> Scene:
    return CROSS.model_copy(update={"keep_out": bodies})


def bows_of_line(scene: Scene) -> list[np.ndarray]:
    return bows(Bodies.of(scene), START + SHARES[:, None] * (GOAL - START))


def finely(path: np.ndarray) -> np.ndarray:
    along = np.linspace(0.0, 1.0, len(path))
    return np.stack([np.interp(SHARES, along, path[:, i]) for i in range(3)], axis=1)


def test_bows_pass_a_sphere_on_all_sides():
    radius = 0.05
    sphere = {"centre": MIDDLE.tolist(), "radius": radius}
    found, sides = bows_of_line(with_bodies({"sphere": sphere})), set[tuple[int, bool]]()
    for path in map(finely, found):
        np.testing.assert_allclose(path[[0, -1]], [START, GOAL], atol=1e-15)
        away = np.linalg.norm(path - MIDDLE, axis=1)
        assert away.min() >= radius
        outwards = (path - MIDDLE)[away < away.min() + 0.005].mean(axis=0)
        axis = int(np.abs(outwards).argmax())
        sides.add((axis, bool(outwards[axis] > 0)))
    assert len(sides) >= 3  # of four across the line


def test_bows_lead_between_two_spheres():
    """The middle of the line is inside of one, and the other is 60 mm beside it: of all ways the
    one between them is hardly longer than the line."""
    centres, radius = MIDDLE + np.array([[0.0, 0.0, -0.048], [0.0, 0.0, 0.112]]), 0.05
    spheres = [{"sphere": {"centre": centre.tolist(), "radius": radius}} for centre in centres]
    found = [finely(path) for path in bows_of_line(with_bodies(*spheres))]
    through = [path for path in found if 0 < path[200, 2] < 0.07]
    assert through
    for path, centre in product(found, centres):
        assert np.linalg.norm(path - centre, axis=1).min() >= radius
    lengths = [np.linalg.norm(np.diff(path, axis=0), axis=1).sum() for path in through]
    assert min(lengths) < 1.01 * np.linalg.norm(GOAL - START)


def test_bows_pass_a_wall_on_the_side_that_is_open():
    """It goes down and to both sides out of reach."""
    top = START[0] - 0.03
    wall = {"from": [top, MIDDLE[1] - 0.01, -2.0], "to": [3.0, MIDDLE[1] + 0.01, 2.0]}
    found = bows_of_line(with_bodies({"box": wall}))
    assert found
    for path in found:
        x, y, _ = finely(path).T
        assert (x[np.abs(y - MIDDLE[1]) <= 0.01] < top).all()


def test_the_middle_of_a_line_that_cuts_an_edge_off_is_shifted_out_of_the_body():
    """The line leads from a place before one face of a box to one above the next face."""
    corner = MIDDLE + np.array([0.02, 0.0, 0.0])
    box = {"from": [corner[0], corner[1], -2.0], "to": [3.0, 3.0, 2.0]}
    bodies = Bodies.of(with_bodies({"box": box}))
    margin = bodies.margin * bodies.way
    beside = [[0.03, -0.05, 0.0], [0.03, -margin, 0.0], [-margin, 0.04, 0.0], [-margin, 0.09, 0.0]]
    path = np.array([START, *(corner + np.array(beside)), GOAL])
    (shifted,) = bodies.beside_corners(path[None])
    middle = (shifted[2] + shifted[3]) / 2 - corner
    assert middle[0] == pytest.approx(-margin, abs=1e-9)
    others = [0, 1, 4, 5]
    np.testing.assert_array_equal(shifted[others], path[others])


def test_bands_come_back_into_reach_and_no_farther():
    """Of places within 0.3 m, a third of which no chains reach, those well within reach stay, and
    all others end where the chains close."""
    places = MIDDLE + np.random.default_rng(1).uniform(-0.3, 0.3, (400, 3))
    model = problem_of(CROSS).model
    before = model.closes(places)
    assert 0.5 < before.mean() < 0.8
    after = Bodies.of(CROSS).in_reach(places.copy())
    kept = (model.alignments(places) >= 0.04).all(axis=1)
    assert kept.any()
    assert np.array_equal(after[kept], places[kept])
    assert model.closes(after).all()
