"""Plans: as fast as they can be, verified, and what must not change them does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.first_motions.order_of_merit import first_motion
from deltaopt.planning.mesh.error_estimate import SAFETY_FACTOR
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.planning.planner import Planner, plan
from deltaopt.robot.robot import load_robot
from deltaopt.scene.known_limits import Limits
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.verification import verify
from studies.problems import PROBLEMS
from tests.good_plans import good_plan

INDUSTRIAL = load_robot(PROBLEMS / "robots/industrial.yaml")
PICK = load_scene(PROBLEMS / "pick_and_place.yaml")
LIGHT = load_scene(PROBLEMS / "light_and_fast.yaml")
CROSS = load_scene(PROBLEMS / "industrial_cross.yaml")
DIAGONAL = load_scene(PROBLEMS / "long_diagonal.yaml")


@pytest.fixture(scope="module")
def picked():
    return plan(PICK)


# As fast as it can be


def test_duration_against_a_switch_resolved_solution(picked):
    assert picked.duration == pytest.approx(0.140870, rel=1e-3)
    assert picked.duration > 0.140869
    assert picked.duration < 0.75 * baseline(PICK).duration


def test_verified(picked):
    found = verify(PICK, picked.trajectory)
    assert found.failures() == []
    assert found.torque_excess <= 1e-9
    assert found.arrival_distance <= 1e-5


@pytest.mark.parametrize("scene", [PICK, CROSS], ids=["orsino", "industrial"])
def test_estimated_gap_against_a_finer_plan(scene):
    """The truth is known to the finer plan's own gap."""
    reference = plan(scene, tolerance=1e-4)
    for tolerance in (1e-2, 1e-3):
        coarse = plan(scene, tolerance=tolerance)
        true_gap = coarse.duration / reference.duration - 1
        assert coarse.within_tolerance
        assert true_gap <= 1.5 * coarse.gap
        assert true_gap + reference.gap >= coarse.gap / (2 * SAFETY_FACTOR)


@pytest.mark.parametrize("tolerance", [3e-3, 1e-2, 3e-2, 0.1])
def test_looser_tolerances_take_no_more_meshes_and_are_met(tolerance):
    loose, usual = plan(DIAGONAL, tolerance=tolerance), plan(DIAGONAL)
    assert loose.within_tolerance
    assert sum(entry.solves for entry in loose.journal) <= len(usual.meshes)
    assert loose.iterations <= usual.iterations


def test_accelerations_of_a_high_degree_lead_to_the_same_duration(picked):
    """Their motions are sampled at other places than those of a low one."""
    high = good_plan(PICK, transcription=PiecewiseAcceleration(4))
    assert abs(high.duration / picked.duration - 1) <= high.gap + picked.gap


def test_a_gap_that_is_not_reached_is_told(monkeypatch):
    monkeypatch.setattr("deltaopt.planning.flat.flat_problem.FlatProblem.finest", 20)
    monkeypatch.setattr("deltaopt.planning.formulations.delta.DeltaProblem.finest", 20)
    told = []
    planner = Planner(PICK.robot, PICK.payload, tolerance=1e-7, intervals=4, resolved_below=0.0)
    found = planner.plan(PICK.start, PICK.goal, progress=told.append)
    assert not found.within_tolerance
    assert found.gap > 1e-7
    assert found.meshes[-1].intervals <= 20
    assert any(str(found.meshes[-1]) in line for line in told)
    assert "no finer mesh" in told[-2]


# What must not change it


@pytest.fixture(scope="module")
def light():
    """A planner for a scene without symmetry, and the duration it finds."""
    planner = Planner(LIGHT.robot, LIGHT.payload)
    return planner, planner.plan(LIGHT.start, LIGHT.goal).duration


def turned(point, turns: int):
    """A point turned by thirds about the axis x."""
    angle = turns * 2 * np.pi / 3
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = point
    return (x, float(c * y - s * z), float(s * y + c * z))


@pytest.mark.parametrize("turns", [1, 2])
def test_turned_by_a_third(light, turns):
    planner, duration = light
    found = planner.plan(turned(LIGHT.start, turns), turned(LIGHT.goal, turns))
    assert found.duration == pytest.approx(duration, rel=1e-6)


def test_way_back(light):
    """From rest to rest without friction, a motion may be run backwards."""
    planner, duration = light
    assert planner.plan(LIGHT.goal, LIGHT.start).duration == pytest.approx(duration, rel=1e-6)


def test_mirrored(light):
    """z to -z swaps chains 2 and 3."""
    planner, duration = light
    ends = [(x, y, -z) for x, y, z in (LIGHT.start, LIGHT.goal)]
    assert planner.plan(*ends).duration == pytest.approx(duration, rel=1e-6)


# Limits


def limited(scene: Scene, **limits: float) -> Scene:
    return scene.model_copy(update={"limits": Limits(**limits)})


def test_speed_limit_of_the_scene(picked):
    scene = limited(PICK, speed=4.0)
    slower = plan(scene)
    found = verify(scene, slower.trajectory)
    assert found.ok
    assert -1e-3 < found.speed_excess <= 1e-9
    assert slower.within_tolerance
    assert slower.duration > 1.01 * picked.duration


# Any move


@pytest.mark.parametrize(
    ("start", "goal"),
    [
        ((0.0645, 0.2925, 0.7299), (0.5273, 0.0225, 0.5238)),
        ((0.8549, 0.2811, 0.1652), (0.3481, -0.0308, -0.6206)),
    ],
)
def test_far_sides_are_joined(start, goal):
    """No parabola towards the axis joins these; a line in motor angles does."""
    scene = Scene(robot=INDUSTRIAL, payload=1.0, start=start, goal=goal)
    motion = first_motion(scene)
    ends = motion.position.at(motion.knots[[0, -1]])
    assert np.abs(ends - [start, goal]).max() < 1e-9


# No


@pytest.mark.parametrize(
    ("setting", "value", "words"),
    [
        ("tolerance", 0.0, "greater than 0"),
        ("tolerance", float("nan"), "greater than 0"),
        ("tolerance", float("inf"), "finite"),
        ("intervals", 1, "at least 2 to stop again"),
        ("starts", 0, "at least 1"),
        ("seed", -1, "at least 0"),
    ],
)
def test_settings_out_of_range(setting, value, words):
    with pytest.raises(ValueError, match=f"^{setting} is {value}; it must be {words}$"):
        plan(PICK, **{setting: value})


@pytest.mark.parametrize(
    ("setting", "value", "words"),
    [
        ("tolerance", "x", "a number greater than 0"),
        ("intervals", 3.5, "a whole number of at least 2"),
        ("starts", 1.5, "a whole number of at least 1"),
        ("seed", "1", "a whole number of at least 0"),
        ("formulation", "flat", "deltaopt.flat, deltaopt.forward, or"),
        ("formulation", "", "deltaopt.flat, deltaopt.forward, or"),
        ("solver", "ipopt", "deltaopt.interior_point or deltaopt.ipopt"),
        ("transcription", "linear", r"deltaopt.PiecewiseAcceleration\(degree\)"),
    ],
)
def test_settings_of_the_wrong_type(setting, value, words):
    with pytest.raises(TypeError, match=f"^{setting} is {value!r}; it must be {words}"):
        plan(PICK, **{setting: value})


def test_a_file_name_is_no_scene():
    with pytest.raises(TypeError, match=r"^scene is 'a.yaml'; it must be a Scene, such as"):
        plan("a.yaml")


def test_settings_as_numpy_has_them(picked):
    found = plan(PICK, tolerance=np.float64(1e-3), intervals=np.int64(16), seed=np.int32(1))
    assert found.duration == picked.duration


def test_plans_of_a_scene_are_equal(picked):
    again, other = plan(PICK), replace(picked, trajectory=picked.trajectory.slowed(1.1))
    assert (picked == again, picked.trajectory == again.trajectory) == (True, True)
    assert picked != other
    assert {picked: 1, picked.trajectory: 2, picked.trajectory.position: 3}[picked] == 1


def test_after_a_plan_the_robot_is_held(picked):
    """With the torques that gravity asks for, whatever those of the last instant are."""
    inside = picked.trajectory([picked.duration])
    assert np.abs(inside.tau).max() > 9.99
    after = picked.trajectory(1.5 * picked.duration)
    rest = picked.trajectory.model.inverse_dynamics(inside.x[0], np.zeros(3), np.zeros(3))
    np.testing.assert_array_equal(after.tau, rest)


# Files and commands


def test_save(picked, tmp_path):
    files = picked.save(tmp_path / "out")
    assert [file.name for file in files] == ["trajectory.csv", "plan.json", "plan.png"]
    assert all(file.stat().st_size > 1000 for file in files)
