"""Verification: measures against independent values, and bad motions that must not pass."""

from __future__ import annotations

import json
from dataclasses import replace
from math import cos, factorial, inf, nan, pi, sin

import numpy as np
import pytest

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.errors import Infeasible, Unreachable
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.initial_motion import baseline, straight_line
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.known_limits import Limits
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.measures import MeasuredMotion
from deltaopt.verify.verification import Verification, verify
from studies.problems import PROBLEMS

SCENE = load_scene(PROBLEMS / "pick_and_place.yaml")
INDUSTRIAL = load_scene(PROBLEMS / "industrial_cross.yaml")
LINE = baseline(SCENE)


def cut(trajectory: Trajectory, intervals: int) -> Trajectory:
    """The same motion of one polynomial, written as several."""
    whole = trajectory.position
    knots = np.linspace(whole.knots[0], whole.knots[-1], intervals + 1)
    pieces, derivative = [], whole
    for order in range(whole.coefficients.shape[1]):
        first = np.zeros(intervals, dtype=np.intp)
        pieces.append(derivative.inside(first, knots[:-1] - knots[0]) / factorial(order))
        derivative = derivative.derivative()
    return replace(trajectory, position=PiecewisePolynomial(knots, np.stack(pieces, axis=1)))


def changed(trajectory: Trajectory, power: int, by: object, interval: int = -1) -> Trajectory:
    """A motion with something added to the coefficients of a power of time in an interval."""
    coefficients = trajectory.position.coefficients.copy()
    coefficients[interval, power] += by
    return replace(trajectory, position=replace(trajectory.position, coefficients=coefficients))


def scene_with(**changes: object):
    return SCENE.model_copy(update=changes)


# What a good motion measures


@pytest.mark.parametrize("scene", [SCENE, INDUSTRIAL], ids=["orsino", "industrial"])
@pytest.mark.parametrize("intervals", [1, 40])
def test_good_motion_passes(scene, intervals):
    found = verify(scene, cut(baseline(scene), intervals))
    assert found.ok
    assert found.failures() == []
    assert abs(found.torque_excess) < 1e-12
    assert found.safe_duration == pytest.approx(found.duration, rel=1e-12)
    assert found.kinematic_error < 1e-14
    assert found.dynamic_error < 1e-11
    assert found.arrival_distance < 1e-10
    assert found.arrival_speed < 1e-9
    assert (found.speed_excess is None) == (scene.robot.speed_limits is None)


def test_excess_is_the_largest_ratio():
    """Against samples a hundred times as dense, off the peak by their spacing squared."""
    fast = baseline(INDUSTRIAL).slowed(0.5)
    motion = fast(np.linspace(0, fast.duration, 20_001))
    torque = (np.abs(motion.tau) / INDUSTRIAL.robot.torque_limits).max() - 1
    speed = (np.abs(motion.dtheta) / INDUSTRIAL.robot.speed_limits).max() - 1
    found = MeasuredMotion(INDUSTRIAL, fast).excesses()
    assert 0 <= found["torque_excess"].value - torque < 1e-6
    assert 0 <= found["speed_excess"].value - speed < 1e-6


def test_excess_says_of_what_and_when():
    fast = LINE.slowed(0.9)
    found = verify(SCENE, fast).excesses["torque_excess"]
    ratio = np.abs(fast(found.t).tau[0]) / SCENE.robot.torque_limits - 1
    assert found.subject == f"motor {np.argmax(ratio) + 1}"
    assert ratio.max() == pytest.approx(found.value, rel=1e-9)
    assert found.amount == pytest.approx(found.value * 10, rel=1e-12)  # of 10 N·m
    assert found.unit == "N·m"
    assert f"torque of {found.subject} exceeds its limit by" in found.check.complaint
    assert f"at t = {found.t:.6g} s" in found.check.complaint


def test_safe_duration_agrees_with_the_planner():
    """Two methods that share nothing but the model."""
    for scene in (SCENE, INDUSTRIAL, scene_with(limits=Limits(torque=(9.0, 4.0, 10.0)))):
        fast = baseline(scene).slowed(0.3)
        found = MeasuredMotion(scene, fast).safe_duration()
        assert found == pytest.approx(
            fast.duration * safe_factor(problem_of(scene), fast), rel=1e-11
        )


def test_safe_duration_is_infinite_where_gravity_alone_is_too_much():
    weak = scene_with(limits=Limits(torque=1.4))
    found = verify(weak, LINE)
    assert found.safe_duration == inf
    assert any("slowing it down does not help" in sentence for sentence in found.failures())


def test_distances_to_singularities():
    """Against geometry in Cartesian coordinates, at dense instants."""
    scene = load_scene(PROBLEMS / "long_diagonal.yaml")
    line = baseline(scene)
    found = verify(scene, line)
    x = line(np.linspace(0, line.duration, 4001)).x
    bars, normals, alignment, sideways = [], [], [], []
    for k, phi in enumerate((0, 2 * pi / 3, -2 * pi / 3)):
        theta = line.model.inverse_kinematics(x)[:, 3 + 3 * k]
        radial, axis = np.array([0, cos(phi), sin(phi)]), np.array([0, -sin(phi), cos(phi)])
        offset = scene.robot.base_radius - scene.robot.platform_radius
        arm = np.outer(np.cos(theta), radial) - np.outer(np.sin(theta), [1, 0, 0])
        bar = x - offset * radial - scene.robot.upper_arm.length * arm
        bar /= np.linalg.norm(bar, axis=1, keepdims=True)
        np.testing.assert_allclose(np.linalg.norm(bar, axis=1), 1)
        plane = bar - np.outer(bar @ axis, axis)
        normal = np.cross(bar, axis)
        normals.append(normal / np.linalg.norm(normal, axis=1, keepdims=True))
        bars.append(bar)
        cosine = (plane * arm).sum(axis=1) / np.linalg.norm(plane, axis=1)
        alignment.append(1 - cosine**2)
        sideways.append(1 - (bar @ axis) ** 2)
    volumes = [np.abs(np.linalg.det(np.stack(rows, axis=1))) for rows in (bars, normals)]
    expected = [np.min(alignment), np.min(sideways), *(volume.min() for volume in volumes)]
    np.testing.assert_allclose([d.least for d in found.distances], expected, rtol=1e-6)
    assert all(d.least <= e * (1 + 1e-12) for d, e in zip(found.distances, expected, strict=True))
    chain = int(np.argmin(np.min(alignment, axis=1))) + 1
    assert found.distances[0].subject == f"chain {chain}"
    written = found.as_dict()["singularities"][found.distances[0].name]
    assert written["least"] == found.distances[0].least
    assert written["formula"] == "sin² (q_k1 - q_k2)"


# Motions that must fail, each with its sentence


def complaints(trajectory: Trajectory, scene=SCENE) -> str:
    found = verify(scene, trajectory)
    assert not found.ok
    return "; ".join(found.failures())


def test_another_start():
    said = complaints(LINE, scene_with(start=(0.451, -0.05, 0.0)))
    assert "it begins 0.001 m from the scene's start" in said


def test_another_goal():
    said = complaints(LINE, scene_with(goal=(0.45, 0.101, 0.0)))
    assert "it ends 0.001 m from the scene's goal" in said
    assert "its torques bring the platform to 0.001 m from the goal" in said


def test_wrong_payload():
    """The torques reported are those without the payload that the scene has."""
    light = replace(LINE, model=DeltaModel(SCENE.robot, payload=None)).slowed(1.5)
    said = complaints(light)
    assert "its torques give accelerations that differ by" in said
    assert "its torques bring the platform to" in said
    assert "exceeds its limit" not in said


def test_wrong_robot():
    """The coordinates reported are those of longer arms."""
    arm = SCENE.robot.upper_arm.model_copy(update={"length": 0.21})
    other = DeltaModel(SCENE.robot.model_copy(update={"upper_arm": arm}), SCENE.payload)
    assert "leave the loops open by" in complaints(replace(LINE, model=other).slowed(1.5))


def test_jumping_velocity():
    """The last piece starts 1 mm/s too fast and ends where it should."""
    whole = cut(LINE.slowed(1.5), 4)
    length = np.diff(whole.knots)[-1]
    v = np.array([0.001, 0, 0])
    bad = changed(changed(whole, 1, v), 2, -v / length)
    said = complaints(bad)
    assert "its velocity jumps by 0.001 m/s at its knots, all jumps together" in said
    assert "its position" not in said
    assert "it ends with a velocity 0.001 m/s off the scene's" in said


def test_moving_start():
    bad = changed(LINE.slowed(1.5), 1, [0.002, 0, 0])
    assert "it begins with a velocity 0.002 m/s off the scene's" in complaints(bad)


def test_time_that_stands_still():
    whole = cut(LINE, 3)
    knots = whole.knots.copy()
    knots[1] = knots[2]
    bad = replace(whole, position=replace(whole.position, knots=knots))
    assert complaints(bad) == "time does not increase from knot to knot"


def test_torques_that_cannot_be_followed():
    """Torques for a payload of 20 kg fling the lighter platform out of reach."""
    heavy = replace(LINE, model=DeltaModel(SCENE.robot, payload=20.0)).slowed(4.0)
    found = verify(SCENE, heavy)
    assert found.arrival_distance == inf
    assert any("CVODES failed" in sentence for sentence in found.failures())


# Long motions


@pytest.mark.parametrize("duration", [3.0, 9.0, 60.0])
@pytest.mark.parametrize("scene", [SCENE, INDUSTRIAL], ids=["orsino", "industrial"])
def test_good_slow_motion_passes_and_nothing_is_printed(scene, duration, capfd):
    """A Delta held against gravity may be unstable: its torques alone need not lead to the goal."""
    line = baseline(scene)
    found = verify(scene, line.slowed(duration / line.duration))
    assert found.failures() == []
    assert found.ok
    if not found.judges_arrival:
        assert found.amplification > 1e4
        assert found.defect_distance < 1e-10
        assert found.defect_speed < 1e-9
    assert capfd.readouterr() == ("", "")


def test_a_slow_motion_of_the_orsino_robot_is_judged_in_pieces():
    assert not verify(SCENE, LINE.slowed(9.0 / LINE.duration)).judges_arrival


def test_torques_of_a_slow_motion_for_another_payload_are_found():
    payload = 1.001 * (SCENE.payload or 1.0)
    other = replace(LINE, model=DeltaModel(SCENE.robot, payload=payload)).slowed(
        9.0 / LINE.duration
    )
    said = complaints(other)
    assert "off its path within a piece of it" in said
    assert "off its own within a piece of it" in said


def test_amplification_is_how_a_deviation_grows():
    """Against motions from starts a micrometre away, by Runge and Kutta's method in small steps."""
    slow = LINE.slowed(1.0 / LINE.duration)
    model, steps = DeltaModel(SCENE.robot, SCENE.payload), 400
    t = np.linspace(0.0, slow.duration, 2 * steps + 1)
    tau, h = slow(t).tau, slow.duration / steps

    def rate(state, torque):
        a = model.forward_dynamics(state[:, :3], state[:, 3:], np.tile(torque, (len(state), 1)))
        return np.hstack([state[:, 3:], a])

    state = np.zeros((4, 6))
    state[:, :3] = SCENE.start
    state[1:, :3] += 1e-6 * np.eye(3)
    for k in range(steps):
        before, middle, after = tau[2 * k : 2 * k + 3]
        first = rate(state, before)
        second = rate(state + h / 2 * first, middle)
        third = rate(state + h / 2 * second, middle)
        fourth = rate(state + h * third, after)
        state = state + h / 6 * (first + 2 * second + 2 * third + fourth)
    growth = np.linalg.norm((state[1:, :3] - state[0, :3]) / 1e-6, 2)
    found = verify(SCENE, slow).amplification
    assert growth > 5  # it is unstable
    assert growth < 1.2 * found
    assert found < 6 * growth  # growth of velocities comes to that of positions


def test_a_plan_is_no_trajectory():
    with pytest.raises(TypeError, match="trajectory is a Scene; it must be a Trajectory"):
        verify(SCENE, SCENE)


def test_json_has_no_infinity():
    found = verify(SCENE, changed(LINE, 0, [1.0, 0, 0]))
    read = json.loads(json.dumps(found.as_dict(), allow_nan=False))
    assert read["ok"] is False
    assert read["arrival_distance"] is None
    assert read["failures"] == found.failures()


def test_nothing_measured_is_no_pass():
    assert not Verification(duration=1.0).ok
    assert Verification(duration=1.0).failures()
    found = verify(SCENE, LINE)
    unknown = replace(found.excesses["torque_excess"], value=nan)
    assert not replace(found, excesses={"torque_excess": unknown}).ok


# Scenes without a solution


def test_problems_are_feasible():
    for file in PROBLEMS.glob("*.yaml"):
        check_feasible(load_scene(file))


@pytest.mark.parametrize(
    ("changes", "error", "sentence"),
    [
        (
            {"start": (0.7, 0.0, 0.0)},
            Unreachable,
            r"start: the platform cannot be at \[0.7, 0, 0\] m: arm and bars of chain 1 cannot ",
        ),
        (
            {"goal": (0.45, 0.9, 0.0)},
            Unreachable,
            r"goal: the platform cannot be at \[0.45, 0.9, 0\] m: ",
        ),
        (
            {"goal": (-0.45, 0.05, 0.0)},
            Unreachable,
            r"goal: at \[-0.45, 0.05, 0\] m the platform is not below its elbows",
        ),
        (
            {"payload": 10.0},
            Infeasible,
            r"goal: at rest at \[0.45, 0.1, 0\] m the torque of motor 1 is 13 N·m, where at most"
            " 10 N·m is allowed",
        ),
    ],
)
def test_infeasible(changes, error, sentence):
    with pytest.raises(error, match=sentence):
        check_feasible(scene_with(**changes))


def test_straight_line_of_any_duration_is_checked():
    """A slow line is safe as it is; its safe duration is its own."""
    slow = straight_line(LINE.model, SCENE.start, SCENE.goal, 2.0)
    found = verify(SCENE, slow)
    assert found.ok
    assert found.safe_duration == 2.0
