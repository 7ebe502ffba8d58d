"""The campaign: its moves, the independent check whether one is possible, and its files."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import load_scene, plan
from deltaopt.robot.model import delta_model
from studies.bench.hard_moves import ROBOTS, move
from studies.bench.met_belts import of_belt
from studies.bench.possible import possibility
from studies.bench.statics import Statics
from studies.bench.strata import STRATA


@pytest.mark.parametrize("stratum", ["inside", "tilted gravity", "tool", "centres and pins"])
@pytest.mark.parametrize("number", range(len(ROBOTS)))
def test_statics_of_the_independent_check(stratum, number):
    """Virtual work by differences beside inverse dynamics at rest: two derivations."""
    scene = move(1, number + len(ROBOTS) * list(STRATA).index(stratum)).scene
    points, rest = np.array(scene.given_points), np.zeros((2, 3))
    model = delta_model(scene.robot, scene.payload)
    found = Statics(scene.robot, scene.payload or 0.0).at(points)
    size = 1e-8 * max(scene.robot.torque_limits)
    np.testing.assert_allclose(
        found.torques, model.inverse_dynamics(points, rest, rest), rtol=1e-7, atol=size
    )
    np.testing.assert_allclose(found.alignments, model.alignments(points), rtol=1e-9)
    q = model.inverse_kinematics(points)
    np.testing.assert_allclose(found.angles, q[:, 3::3], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(np.abs(found.sideways), np.abs(q[:, 5::3]), rtol=1e-9, atol=1e-12)


def test_a_move_is_possible_unless_the_motors_are_too_weak_between_its_ends(monkeypatch):
    monkeypatch.setattr("studies.bench.possible._STEPS", (12,))
    scene = move(1, 0).scene
    far = {"sphere": {"centre": [10.0, 0.0, 0.0], "radius": 1.0}}
    assert possibility(scene.model_copy(update={"keep_out": [far]})).found
    torque = tuple(1e-3 * t for t in scene.robot.torque_limits)
    weak = scene.robot.model_copy(
        update={"drive": scene.robot.drive.model_copy(update={"torque": torque})}
    )
    assert not possibility(scene.model_copy(update={"robot": weak})).found


@pytest.mark.parametrize("body", ["box", "half_space"])
def test_a_move_is_not_possible_where_a_body_encloses_its_goal(monkeypatch, body):
    monkeypatch.setattr("studies.bench.possible._STEPS", (12,))
    scene = move(1, 0).scene
    goal = np.array(scene.goal)
    way = np.linalg.norm(goal - np.array(scene.start))
    bodies = {
        "box": {"from": (goal - way / 2).tolist(), "to": (goal + way / 2).tolist()},
        "half_space": {"point": ((goal + scene.start) / 2).tolist(), "normal": goal - scene.start},
    }
    assert not possibility(scene.model_copy(update={"keep_out": [{body: bodies[body]}]})).found


def test_a_move_is_not_possible_through_a_point_beyond_a_parallel_singularity():
    """A grid led around the singularity, and from its last point straight through."""
    assert "other side of a parallel singularity" in possibility(move(80, 3155).scene).against


def test_arms_and_forearms_are_joined():
    """At angles by one derivation and places by another."""
    scene = move(1, 0).scene
    points, statics = np.array(scene.given_points), Statics(scene.robot, 0.0)
    forearms = statics.forearms(points)
    sizes = np.linalg.norm(forearms[:, :, 1] - forearms[:, :, 0], axis=2)
    np.testing.assert_allclose(sizes, scene.robot.forearm.length, rtol=1e-12)
    elbows = statics.arms(statics.at(points).angles)[:, :, 1]
    np.testing.assert_allclose(elbows, forearms[:, :, 0], atol=1e-12)


def test_a_move_is_not_possible_where_an_arm_would_have_to_turn_through_a_body(monkeypatch):
    """A sphere at its end, half way between its angles; the tool passes it."""
    monkeypatch.setattr("studies.bench.possible._STEPS", (12,))
    scene, statics = move(1, 0).scene, Statics(move(1, 0).scene.robot, 0.0)
    angles = statics.at(np.array(scene.given_points)).angles
    arm = int(np.ptp(angles, axis=0).argmax())
    middle = statics.arms(angles.mean(axis=0)[None])[0, arm, 1]
    sphere = {"sphere": {"centre": middle.tolist(), "radius": 0.001}}
    passed = scene.model_copy(update={"keep_out": [sphere]})
    assert possibility(passed).found
    found = possibility(passed.model_copy(update={"robot_keeps_clear": True}))
    assert (found.found, found.against) == (False, "an arm that would have to turn through a body")


def test_belts_that_can_be_met_and_others(monkeypatch):
    """One is never in reach slowly enough, one leaves too soon, and one is met; by the default
    solver instead of Ipopt, which takes ten times as long."""
    monkeypatch.setattr("studies.bench.met_belts._PLACES", 2)
    monkeypatch.setattr("studies.bench.met_belts.plan", lambda scene, solver: plan(scene))
    too_fast, leaving = (of_belt(move(3, number).scene) for number in (373, 377))
    assert "at none of 2000 places of the belt do the chains close" in too_fast.against
    assert "motions to 2 places there take 1.41 times as long" in leaving.against
    assert of_belt(load_scene("problems/moving/belt.yaml")).found
