"""Arms and forearms as capsules: distances from bodies, against formulas of their own."""

from __future__ import annotations

from math import cos, pi, sin
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest

from deltaopt.errors import Infeasible
from deltaopt.robot.model import delta_model
from deltaopt.robot.robot import Robot
from deltaopt.scene.bodies import solid_about, sums
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.links import name_of, rooms_at
from deltaopt.scene.scene import Scene
from tests.limits.test_keep_out import (
    BOX,
    CYLINDER,
    HULL,
    PLANE,
    SCENE,
    SPHERE,
    of_box,
    of_cylinder,
)
from tests.limits.test_keep_out import with_bodies as with_tool

ARM, FOREARM = 0.04, 0.02
"""Radii of the links, m."""


def with_bodies(*bodies: dict, **keys: object) -> Scene:
    """Of a robot whose links are as thick as that."""
    scene = with_tool(*bodies, **keys)
    content = scene.robot.model_dump(exclude_none=True)
    content["upper_arm"]["radius"], content["forearm"]["radius"] = ARM, FOREARM
    return scene.model_copy(update={"robot": Robot.model_validate(content)})


def lines(scene: Scene, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both ends of all links, (N, 6, 3) each: shaft and elbow, elbow and pins."""
    robot, model, begins, ends = scene.robot, delta_model(scene.robot, scene.payload), [], []
    for point in points:
        theta = np.array(model.inverse_kinematics(tuple(point)))[3::3]
        begin, end = [], []
        for k, angle in enumerate((0, 2 * pi / 3, -2 * pi / 3)):
            away = np.array([0, cos(angle), sin(angle)])
            reach = robot.base_radius + robot.upper_arm.length * cos(theta[k])
            elbow = reach * away - [robot.upper_arm.length * sin(theta[k]), 0, 0]
            begin += [robot.base_radius * away, elbow]
            end += [elbow, point + robot.platform_radius * away]
        begins.append(begin)
        ends.append(end)
    return np.array(begins), np.array(ends)


def of_sphere(x: np.ndarray) -> np.ndarray:
    return np.linalg.norm(x - SPHERE["sphere"]["centre"], axis=1) - SPHERE["sphere"]["radius"]


def of_plane(x: np.ndarray) -> np.ndarray:
    normal = np.array(PLANE["half_space"]["normal"])
    return (PLANE["half_space"]["point"] - x) @ normal / np.linalg.norm(normal)


def densely(scene: Scene, of_body, points: np.ndarray) -> np.ndarray:
    """The least distance of each capsule by samples of its line, (N, 6), m."""
    begin, end = lines(scene, points)
    share = np.linspace(0, 1, 401)[:, None, None, None]
    x = begin + share * (end - begin)
    least = of_body(x.reshape(-1, 3)).reshape(x.shape[:3]).min(axis=0)
    return least - np.array([ARM, FOREARM] * 3)


POINTS = np.random.default_rng(4).uniform([0.40, -0.1, -0.1], [0.52, 0.1, 0.1], (12, 3))
KINDS = [(BOX, of_box), (SPHERE, of_sphere), (CYLINDER, of_cylinder), (PLANE, of_plane)]


@pytest.mark.parametrize(("body", "of_body"), KINDS)
def test_distances_are_those_of_dense_samples(body, of_body):
    scene = with_bodies(body)
    found, expected = rooms_at(scene, POINTS)[:, :, 0], densely(scene, of_body, POINTS)
    np.testing.assert_allclose(found, expected, atol=2e-3)
    assert (found <= expected + 1e-12).all()


@pytest.mark.parametrize(("body", "of_body"), KINDS)
def test_limits_measure_the_same(body, of_body):
    """The rows of a planned scene, and their derivatives by finite differences."""
    planned = tuple((link, 0, [ARM, FOREARM][link % 2]) for link in range(6))
    scene = with_bodies(body, planned_links=planned)
    constraints, model = limits_of(scene).constraints, delta_model(scene.robot, scene.payload)
    x = ca.SX.sym("x", 3)
    q = model.functions.inverse_kinematics(x, ca.DM(model.parameters))
    own = ca.SX(ca.DM(limits_of(scene).of_items[-1]))
    measure = constraints.limits[-1].measure(SimpleNamespace(x=x, theta=q[3::3]), own)[:6]
    function = ca.Function("links", [x], [measure, ca.jacobian(measure, x)])
    for point, rooms in zip(POINTS, rooms_at(scene, POINTS)[:, :, 0], strict=True):
        value, slope = (np.array(each) for each in function(point))
        away = rooms + [ARM, FOREARM] * 3 > 1e-3  # inside of a body bisection is rough
        expected = (rooms + [ARM, FOREARM] * 3)[away]
        np.testing.assert_allclose(value.ravel()[away], expected, atol=1e-8)
        for k, step in enumerate(1e-6 * np.eye(3)):
            ahead, behind = (np.array(function(point + sign * step)[0]) for sign in (1, -1))
            difference = ((ahead - behind) / 2e-6).ravel()
            np.testing.assert_allclose(slope[away, k], difference[away], atol=1e-5)


def test_a_hull_counts_as_a_box_about_it():
    scene = with_bodies(HULL)
    ((_, hull),) = sums(scene.keep_out, None)
    box = solid_about(hull)
    inside = np.abs((np.array(HULL["hull"]["points"]) - box.centre) @ np.array(box.axes).T)
    np.testing.assert_allclose(inside.max(axis=0), box.half, atol=1e-12)
    along_the_base = np.ptp(np.array(HULL["hull"]["points"]), axis=0).prod()
    assert 8 * np.prod(box.half) <= along_the_base + 1e-15


@pytest.mark.parametrize("end", ["start", "goal"])
def test_a_link_in_a_body_at_an_end_is_refused(end):
    begin, to = lines(SCENE, np.array([getattr(SCENE, end)]))
    middle = (begin[0, 3] + to[0, 3]) / 2
    body = {"sphere": {"centre": middle.tolist(), "radius": 0.03}}
    check_feasible(with_bodies(body))
    with pytest.raises(Infeasible) as refused:
        check_feasible(with_bodies(body, robot_keeps_clear=True))
    assert str(refused.value).startswith(f"{end}: at ")
    assert f"{name_of(3)} is 50 mm too near to keep_out[0], a sphere" in str(refused.value)


def test_a_file_gives_no_planned_links(tmp_path):
    assert "planned_links" not in with_bodies(BOX, planned_links=((0, 0, 0.1),)).model_dump()
