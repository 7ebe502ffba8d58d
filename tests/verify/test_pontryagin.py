"""Costates fitted to a motion: what other starts cost, and motions that are not the best."""

from __future__ import annotations

import json
from functools import cache

import numpy as np
import pytest
from matplotlib.image import imread

import deltaopt
from deltaopt import Limits, load_scene, plan
from deltaopt.motion.certificate import MET
from deltaopt.output.facts import facts
from deltaopt.output.plan_files import write_json
from deltaopt.verify.pontryagin import extremal
from tests import planned_scenes

LIGHT = load_scene("problems/light_and_fast.yaml")
GENTLY = load_scene("problems/objectives/pick_and_place_gently.yaml")


@cache
def resolved(scene):
    return plan(scene, tolerance=1e-7)


def changed(scene, **fields):
    return scene.model_copy(update=fields)


def cost_from(scene, shift, tolerance):
    start = tuple(np.array(scene.start) + shift)
    return plan(changed(scene, start=start), tolerance=tolerance, intervals=32).cost


@pytest.mark.parametrize(
    ("scene", "tolerance"), [(LIGHT, 1e-7), (GENTLY, 1e-3)], ids=["time", "effort"]
)
def test_costates_are_what_another_start_costs(scene, tolerance):
    """p_x(0): by so much the cost grows with the start's place, m."""
    shift = 1e-3 * np.array([0.3, 0.8, -0.5])
    found = extremal(scene, plan(scene, tolerance=tolerance, intervals=32).trajectory)
    differ = cost_from(scene, shift, tolerance) - cost_from(scene, -shift, tolerance)
    assert found.costates[0, :3] @ shift == pytest.approx(differ / 2, rel=2e-3)


def test_switching_functions_have_the_torques_signs():
    found = resolved(LIGHT)
    along = extremal(LIGHT, found.trajectory)
    tau = found.trajectory(along.t).tau / np.array(LIGHT.robot.torque_limits)
    clear = np.abs(along.switching) > 1e-3
    held = np.abs(tau) > 0.99
    assert clear.mean() > 0.5
    between_knots = ~np.isin(along.t, found.trajectory.knots)[:, None]
    where = clear & held & between_knots
    np.testing.assert_array_equal(np.sign(along.switching[where]), -np.sign(tau[where]))
    np.testing.assert_allclose(along.hamiltonian, 0, atol=1e-6)


@pytest.mark.parametrize(
    "other",
    [{"payload": 0.002}, {"limits": Limits(torque=9.95)}, {"goal": (0.47, 0.09, 0.0601)}],
    ids=["payload", "limit", "goal"],
)
def test_the_best_of_another_scene_is_not_that_of_this(other):
    """The limit: costates fit that motion just as well, but its torques are not at their limits."""
    motion = resolved(changed(LIGHT, **other)).trajectory
    scene = LIGHT
    if "goal" in other:  # the same motion, but bent a little on its way
        position = resolved(LIGHT).trajectory.position
        bend = position.coefficients.copy()
        bend[:, 4:, 1] *= 1.02
        motion = deltaopt.Trajectory(type(position)(position.knots, bend), motion.model)
    assert extremal(scene, motion).residual > 1e-4
    assert extremal(scene, resolved(LIGHT).trajectory).residual < 1e-6


def test_a_motion_that_is_not_optimised_at_all():
    for scene in (LIGHT, GENTLY):
        assert extremal(scene, deltaopt.baseline(scene)).residual > 0.05


def test_a_motion_at_a_limit_of_speed():
    """The costates jump where the limit is reached."""
    robot = deltaopt.load_robot("problems/robots/industrial.yaml")
    planner = deltaopt.Planner(robot, 1.0, tolerance=1e-6)
    found = planner.plan((0.7102, 0.1262, 0.3389), (0.5822, 0.3444, -0.3645))
    speed = np.abs(found.trajectory(np.linspace(0, found.duration, 200)).dtheta).max(axis=1)
    assert (speed > 10 * (1 - 1e-6)).mean() > 0.05
    assert extremal(found.scene, found.trajectory).residual < 1e-5


@pytest.mark.parametrize("number", [6, 13])
def test_a_motor_at_its_limits_of_speed_and_torque(number):
    """Its speed is held by another motor's torque; in the second move another speed touches its
    limit at an instant, where the costates jump. With another payload it is not the fastest."""
    scene = planned_scenes.random_move("industrial", number)
    found = planned_scenes.resolved(scene)
    assert extremal(scene, found.trajectory).residual < 1e-7
    assert extremal(changed(scene, payload=1.1), found.trajectory).residual > 10 * MET


def test_files_carry_it(tmp_path):
    """plan.json has the numbers; limits.png a third row where the condition is met."""
    heights = {}
    for name, found in (("resolved", resolved(LIGHT)), ("mesh", plan(LIGHT, tolerance=1e-2))):
        found.save(tmp_path / name, chart=False, limits=True)
        record = json.loads((tmp_path / name / "plan.json").read_text())
        met = record["verification"]["hamiltonian_spread"] <= MET
        assert met == (name == "resolved")
        assert (record["certificate"] is not None) == met
        heights[name] = imread(tmp_path / name / "limits.png").shape[0]
    row = 2.05 * 200  # inches of a row, at the dots per inch of the file
    assert heights["resolved"] == pytest.approx(heights["mesh"] + row, rel=0.01)


def test_plan_json_tells_the_objective_and_the_optima(tmp_path):
    found = plan(GENTLY, tolerance=1e-2, starts=2)
    file = tmp_path / "plan.json"
    write_json(file, facts(found))
    record = json.loads(file.read_text())
    assert record["cost"] == {"value": pytest.approx(found.cost, rel=1e-12), "unit": "N²m²s"}
    assert record["verification"]["effort"] == pytest.approx(found.cost, rel=1e-12)
    assert [each["starts"] for each in record["optima"]] == [o.starts for o in found.optima]
    assert record["optima"][0]["cost"] == pytest.approx(found.cost, rel=1e-12)
    assert (record["scene"]["objective"], record["scene"]["duration"]) == ("effort", 0.28)
