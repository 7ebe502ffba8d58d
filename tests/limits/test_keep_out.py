"""Distances of the tool's point from bodies grown by the tool, against independent ones."""

from __future__ import annotations

from itertools import product

import casadi as ca
import numpy as np
import pytest

from deltaopt.errors import SceneError
from deltaopt.limits.keep_out import KeepOut
from deltaopt.motion.sure_bounds import signed_distances
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.clearance import distance_from
from studies.problems import PROBLEMS

SCENE = load_scene(PROBLEMS / "pick_and_place.yaml")
LOW, HIGH = np.array([0.40, -0.03, -0.08]), np.array([0.52, 0.05, 0.09])
BOX = {"box": {"from": LOW.tolist(), "to": HIGH.tolist()}}
SPHERE = {"sphere": {"centre": [0.45, 0.02, 0.01], "radius": 0.03}}
CYLINDER = {"cylinder": {"from": [0.40, 0.01, 0.02], "to": [0.47, -0.03, 0.05], "radius": 0.04}}
PLANE = {"half_space": {"point": [0.5, 0.0, 0.0], "normal": [2.0, 1.0, -1.0]}}
POINTS = np.random.default_rng(3).normal([0.45, 0.0, 0.0], 0.04, (9, 3))
HULL = {"hull": {"points": POINTS.tolist()}}
TETRAHEDRON = {"hull": {"points": POINTS[:4].tolist()}}
CORNERS = np.array(list(product(*zip(LOW, HIGH, strict=True))))
BODIES = [BOX, SPHERE, CYLINDER, PLANE]


def with_bodies(*bodies: dict, tool: dict | None = None, **keys: object) -> Scene:
    content = SCENE.model_dump(exclude_none=True) | {"keep_out": list(bodies)} | keys
    robot = SCENE.robot.model_copy(update={"tool": tool})
    return Scene.model_validate(content | {"robot": robot})


def places(number: int, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform([0.3, -0.15, -0.2], [0.6, 0.15, 0.2], (number, 3))


def of_box(x: np.ndarray) -> np.ndarray:
    """By the regions about a box, counted by hand."""
    beside = np.maximum(LOW - x, 0) + np.maximum(x - HIGH, 0)
    to_sides = np.minimum(x - LOW, HIGH - x).min(axis=1)
    outside = np.sqrt((beside**2).sum(axis=1))
    return np.where(to_sides > 0, -to_sides, outside)


def of_cylinder(x: np.ndarray) -> np.ndarray:
    """In the plane through the axis and the point, a rectangle."""
    begin, end = np.array(CYLINDER["cylinder"]["from"]), np.array(CYLINDER["cylinder"]["to"])
    length = np.sqrt(((end - begin) ** 2).sum())
    along = (x - begin) @ (end - begin) / length
    off = x - begin - np.outer(along, (end - begin) / length)
    across = np.sqrt((off**2).sum(axis=1)) - CYLINDER["cylinder"]["radius"]
    beyond = np.maximum(-along, along - length)
    outside = np.hypot(np.maximum(across, 0), np.maximum(beyond, 0))
    return np.where((across < 0) & (beyond < 0), np.maximum(across, beyond), outside)


def of_sphere(x: np.ndarray) -> np.ndarray:
    return np.sqrt(((x - SPHERE["sphere"]["centre"]) ** 2).sum(axis=1)) - 0.03


def of_plane(x: np.ndarray) -> np.ndarray:
    return (np.array([0.5, 0, 0]) - x) @ np.array([2.0, 1.0, -1.0]) / 6**0.5


FORMULAS = [of_box, of_sphere, of_cylinder, of_plane]


@pytest.mark.parametrize("radius", [None, 0.013])
def test_a_million_distances(radius):
    """From each of the four kinds of solid, from 250 000 places."""
    scene = with_bodies(*BODIES, tool=radius and {"radius": radius})
    x = places(250_000)
    found, slope = signed_distances(problem_of(scene), x)
    assert found.shape == (len(x), 4)
    for column, formula in zip(found.T, FORMULAS, strict=True):
        np.testing.assert_allclose(column, formula(x) - (radius or 0), rtol=0, atol=3e-12)
        assert (column < 0).any()
    np.testing.assert_allclose(np.linalg.norm(slope, axis=2), 1.0, rtol=1e-9)


def test_the_slope_is_that_of_the_distance():
    scene, x, h = with_bodies(*BODIES, HULL, tool={"radius": 0.01}), places(500), 1e-6
    _, slope = signed_distances(problem_of(scene), x)
    steps = h * np.eye(3)
    ends = [
        [signed_distances(problem_of(scene), x + s * step)[0] for s in (1, -1)] for step in steps
    ]
    numeric = np.stack([(up - down) / (2 * h) for up, down in ends], axis=2)
    smooth = np.abs(numeric - slope).max(axis=2) < 1e-4
    assert smooth.mean() > 0.999  # not beside a plane where the nearest face changes inside


def support(points: np.ndarray, directions: np.ndarray) -> np.ndarray:
    return (points @ directions.T).max(axis=0)


def by_directions(vertices: np.ndarray, x: np.ndarray) -> np.ndarray:
    """max over unit n of n·x - h(n) is the signed distance from a convex body, h(n) its support in
    the direction n: by 4000 directions, then by ever closer ones about the best."""
    found, rng = [], np.random.default_rng(0)
    for point in x:
        best, value, spread = np.zeros(3), -np.inf, 1.0
        for round_ in range(45):
            n = best + spread * rng.normal(size=(300 if round_ else 4000, 3))
            unit = n / np.linalg.norm(n, axis=1, keepdims=True)
            values = unit @ point - support(vertices, unit)
            if values.max() > value:
                best, value = unit[values.argmax()], values.max()
            spread *= 0.7
        found.append(value)
    return np.array(found)


SLANTED = {"capsule": {"from": [0, 0, 0], "to": [-0.02, 0.01, 0.01], "radius": 0.01}}
UPRIGHT = {"capsule": {"from": [0, 0, 0], "to": [-0.02, 0.0, 0.0], "radius": 0.01}}
BLOCK = {"box": {"from": [-0.01, -0.02, 0.0], "to": [0.0, 0.02, 0.01]}}
SUMS = {
    "hull": (HULL, None),
    "hull and capsule": (TETRAHEDRON, SLANTED),
    "box and box": (BOX, BLOCK),
    "box and capsule": (BOX, UPRIGHT),
}


@pytest.mark.parametrize("name", SUMS)
def test_distances_from_sums(name):
    """By supports, which of a sum add up, of corners of the body less corners of the tool."""
    body, shape = SUMS[name]
    scene = with_bodies(body, tool=shape and {"shapes": [shape]})
    corners = np.array(body.get("hull", {}).get("points", CORNERS))
    tool, radius = np.zeros((1, 3)), 0.0
    if shape is not None:
        (kind, given), *_ = shape.items()
        ends = np.array([given["from"], given["to"]])
        tool = ends if kind == "capsule" else np.array(list(product(*ends.T)))
        radius = given.get("radius", 0.0)
    vertices = (corners[:, None] - tool).reshape(-1, 3)
    x = places(20, seed=5)
    found, _ = signed_distances(problem_of(scene), x)
    expected = by_directions(vertices, x) - radius
    assert found.shape == (20, 1)
    np.testing.assert_allclose(found[:, 0], expected, atol=2e-6)
    assert (found[:, 0] >= expected - 1e-12).all()  # which are those of some directions


ALONG = {"capsule": {"from": [0, 0, 0], "to": [0.035, -0.02, 0.015], "radius": 0.01}}


@pytest.mark.parametrize(
    ("body", "shape"),
    [(SPHERE, BLOCK), (SPHERE, SLANTED), (PLANE, SLANTED), (PLANE, BLOCK), (CYLINDER, ALONG)],
)
def test_distances_of_the_tools_own_places(body, shape):
    """Where the tool is clear of the body, its nearest place is as far from it as the tool's point
    is from the sum."""
    scene, alone = with_bodies(body, tool={"shapes": [shape]}), with_bodies(body)
    (kind, given), *_ = shape.items()
    ends, radius = np.array([given["from"], given["to"]], float), given.get("radius", 0.0)
    share, compared = np.linspace(0, 1, 41 if kind == "box" else 20001), 0
    if kind == "box":
        grids = np.meshgrid(*(a + share * (b - a) for a, b in ends.T), indexing="ij")
        tool = np.stack(grids, axis=-1).reshape(-1, 3)
    else:
        tool = ends[0] + share[:, None] * (ends[1] - ends[0])
    for point in places(12, seed=2):
        found = float(signed_distances(problem_of(scene), point[None])[0][0, 0])
        nearest = signed_distances(problem_of(alone), point + tool)[0].min() - radius
        if nearest > 0.01:
            assert nearest - 3e-5 <= found <= nearest + 1e-11
            compared += 1
    assert compared > 3


def test_a_cylinder_and_a_box_of_the_tool_have_no_closed_form():
    shape = {"box": {"from": [-0.01, -0.02, 0.0], "to": [0.0, 0.02, 0.01]}}
    with pytest.raises(SceneError, match=r"keep_out\[0\] is a cylinder, whose sum with a box"):
        with_bodies(CYLINDER, tool={"shapes": [shape]})


def test_verification_measures_distances_of_its_own():
    """By nearest points; the same numbers."""
    scene = with_bodies(*BODIES, HULL, tool={"radius": 0.01})
    x = places(3000, seed=7)
    found, slope = signed_distances(problem_of(scene), x)
    for column, own, (_, body) in zip(found.T, slope.swapaxes(0, 1), scene.obstacles, strict=True):
        distance, normal = distance_from(body, x)
        np.testing.assert_allclose(distance, column, atol=3e-12)
        far = np.abs(distance) > 0.002  # the direction is not unique on the axis or between faces
        assert (np.einsum("nc,nc->n", normal, own)[far & (distance > 0)] > 1 - 1e-9).all()


def test_rows_are_at_their_bound_where_the_clearance_is():
    """-1 exactly there, bounded above, and increasing with the distance."""
    scene = with_bodies(PLANE, clearance=0.004, tool={"radius": 0.01})
    limits = limits_of(scene)
    (item,) = (i for i, each in enumerate(limits.constraints.limits) if isinstance(each, KeepOut))
    x, numbers = ca.SX.sym("x", 3), ca.SX(ca.DM(limits.of_items[item]))

    class At:
        pass

    At.x = x
    row = ca.Function("row", [x], [limits.constraints.limits[item].rows(At, numbers)])
    normal = np.array([2.0, 1.0, -1.0]) / 6**0.5
    away = np.array([-0.01, 0.0, 0.014, 0.03, 100.0])
    found = [float(row(np.array([0.5, 0, 0]) - d * normal)) for d in away]
    assert found[2] == pytest.approx(-1, abs=1e-10)
    assert found == sorted(found)
    assert found[-1] < 1
