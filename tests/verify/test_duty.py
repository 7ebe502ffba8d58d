"""The duty of the motors, against the balance of energy and samples at forty thousand instants.

Integrals by dense samples are by the trapezoidal rule, which is as good as its step squared; the
balance of energy is to rounding.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

import deltaopt
from deltaopt.limits.running_cost import Running
from deltaopt.motion.running_cost import running_cost
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.in_words import duty_table, table
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.plots.limits import caption
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.robot import Robot
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.duty import Duty, MotorDuty, exceeding
from deltaopt.verify.measures import MeasuredMotion
from deltaopt.verify.verification import verify
from studies.problems import PROBLEMS

PAPER = load_scene(PROBLEMS / "pick_and_place.yaml")
INDUSTRIAL = load_scene(PROBLEMS / "industrial_cross.yaml")
CATALOGUE = {
    "motor": {"peak_torque": 1.9, "rated_torque": 0.6, "inertia": 0.4e-4},
    "gear": {"ratio": 22, "efficiency": 0.95, "inertia": 0.1e-4, "nominal_torque": 14.0},
    "friction": {"viscous": 0.3, "coulomb": 2.0, "speed": 0.05},
}


def with_drive(scene: Scene, **keys: object) -> Scene:
    """A scene whose robot has another drive."""
    robot = scene.robot.model_dump(exclude_none=True) | {"drive": keys}
    return scene.model_copy(update={"robot": Robot.model_validate(robot)})


GEARED = with_drive(INDUSTRIAL, **CATALOGUE)


def measured(scene: Scene, trajectory: Trajectory) -> Duty:
    return MeasuredMotion(scene, trajectory).duty()


def sampled(trajectory: Trajectory):
    """A motion at 40,000 instants and both sides of its knots, and the integral over time of
    values there, (N, m)."""
    lengths = np.diff(trajectory.knots)
    fractions = np.linspace(0, 1, 1 + 40_000 // len(lengths))
    motion = trajectory.inside_intervals(fractions)

    def integral(values):
        by_piece = values.reshape(len(lengths), len(fractions), -1)
        return np.einsum("k,kc->c", lengths, np.trapezoid(by_piece, fractions, axis=1))

    return motion, integral


def potential(scene: Scene, x: np.ndarray, theta: np.ndarray) -> float:
    """Potential energy, J, by hand: arms and bars have their centres of mass in the middle."""
    robot = scene.robot
    elbow = -robot.upper_arm.length * np.sin(theta)  # x is down
    depth = (robot.platform.mass + (scene.payload or 0.0)) * x[0]
    depth += (robot.upper_arm.mass * elbow / 2 + robot.forearm.mass * (elbow + x[0]) / 2).sum()
    return -robot.gravity * depth


@pytest.fixture(scope="module", params=["paper", "industrial", "planned"])
def motion(request) -> tuple[Scene, Trajectory]:
    if request.param == "planned":
        return PAPER, deltaopt.plan(PAPER, tolerance=1e-2).trajectory
    scene = PAPER if request.param == "paper" else INDUSTRIAL
    return scene, baseline(scene)


def test_work_is_the_change_of_potential_energy(motion):
    """From rest to rest, without friction."""
    scene, trajectory = motion
    found = measured(scene, trajectory)
    net = sum(each.work_done - each.work_absorbed for each in found.motors)
    ends = trajectory(trajectory.knots[[0, -1]])
    begin, end = (potential(scene, ends.x[i], ends.theta[i]) for i in (0, 1))
    scale = sum(each.work_done for each in found.motors)
    assert net == pytest.approx(end - begin, abs=1e-12 * scale)
    assert all(each.work_done > 0 and each.work_absorbed > 0 for each in found.motors)


def test_duty_of_every_motor_by_dense_samples(motion):
    scene, trajectory = motion
    found, (m, integral) = measured(scene, trajectory), sampled(trajectory)
    power = m.tau * m.dtheta
    rms = np.sqrt(integral(m.tau**2) / trajectory.duration)
    done, absorbed = integral(power.clip(min=0)), integral((-power).clip(min=0))
    for k, each in enumerate(found.motors):
        assert each.rms_torque == pytest.approx(rms[k], rel=1e-6)
        assert each.work_done == pytest.approx(done[k], rel=1e-6)
        assert each.work_absorbed == pytest.approx(absorbed[k], rel=1e-6)
        assert each.peak_power == pytest.approx(power[:, k].max(), rel=1e-6)
        assert each.largest_speed == pytest.approx(np.abs(m.dtheta[:, k]).max(), rel=1e-6)
        assert (each.gear_torque, each.motor_rms_torque) == (None, None)
        travel = integral(np.abs(m.dtheta))[k]
        assert each.travel == pytest.approx(travel, rel=1e-6)
    assert found.peak_power == pytest.approx(power.sum(axis=1).max(), rel=1e-6)
    drawn = integral(power.sum(axis=1, keepdims=True).clip(min=0))[0]
    assert found.work_drawn == pytest.approx(drawn, rel=1e-6)
    assert (found.rated_torque, found.nominal_torque) == (None, None)


def test_the_squares_of_rms_torques_are_the_effort(motion):
    scene, trajectory = motion
    squares = sum(each.rms_torque**2 for each in measured(scene, trajectory).motors)
    assert squares * trajectory.duration == pytest.approx(
        running_cost(problem_of(scene), trajectory, Running.EFFORT), rel=1e-10
    )


def test_friction_takes_the_rest_of_the_work():
    trajectory = baseline(GEARED)
    found, (m, integral) = measured(GEARED, trajectory), sampled(trajectory)
    lost = integral(m.dtheta * (0.3 * m.dtheta + 2.0 * np.tanh(m.dtheta / 0.05))).sum()
    net = sum(each.work_done - each.work_absorbed for each in found.motors)
    begin, end = (potential(GEARED, m.x[i], m.theta[i]) for i in (0, -1))
    assert lost > 100 * abs(end - begin)
    assert net == pytest.approx(lost + end - begin, rel=1e-7)


def test_a_gear_transmits_all_but_the_torque_of_rotor_and_gear():
    trajectory = baseline(GEARED)
    found, (m, integral) = measured(GEARED, trajectory), sampled(trajectory)
    passed = np.abs(m.tau - 0.5e-4 * 22**2 * m.ddtheta)
    mean = np.cbrt(integral(passed**3 * np.abs(m.dtheta)) / integral(np.abs(m.dtheta)))
    for k, each in enumerate(found.motors):
        assert each.gear_torque == pytest.approx(mean[k], rel=1e-6)
        assert each.motor_rms_torque == pytest.approx(each.rms_torque / (22 * 0.95), rel=1e-15)
    assert found.nominal_torque == 14.0
    assert found.rated_torque == pytest.approx((0.6 * 22 * 0.95,) * 3, rel=1e-15)


def test_reports_have_the_duty_and_ratings_only_if_the_robot_names_them():
    plain = verify(INDUSTRIAL, baseline(INDUSTRIAL))
    assert "rated torque" not in table(plain)
    assert "gear" not in table(plain)
    found = verify(GEARED, baseline(GEARED))
    lines = table(found).splitlines()
    (rated,) = (line for line in lines if line.startswith("    rated torque"))
    assert rated.split()[2:6] == ["12.54", "12.54", "12.54", "N·m"]
    assert rated.endswith("N·m") is (not any(found.duty.above_rated))
    (nominal,) = (line for line in lines if line.startswith("    nominal torque"))
    assert nominal.split()[2:6] == ["14", "14", "14", "N·m"]
    assert "(rated 12.54" in caption(found)
    assert "rated" not in caption(plain)
    assert "least distance to singularities: serial" in caption(plain)
    told = json.loads(json.dumps(found.as_dict(), allow_nan=False))["duty"]
    assert found.duty is not None
    assert told["motors"][1]["rms_torque"] == found.duty.motors[1].rms_torque
    assert told["rated_torque"] == list(found.duty.rated_torque)


@pytest.mark.parametrize(
    ("rms", "words"),
    [
        ((1.0, 2.0, 0.5), ""),
        ((1.0, 2.1, 0.5), "above in motor 2"),
        ((3.0, 2.1, 2.5), "above in motors 1, 2 and 3"),
    ],
)
def test_motors_above_their_rating_are_marked(rms, words):
    """In words, as truth values, in the table and in plan.json's part."""
    each = [MotorDuty(torque, None, 1.0, 1.0, 10.0, 5.0, 2 * torque, 1.0) for torque in rms]
    found = Duty(tuple(each), 30.0, 1.0, (2.0, 2.0, 2.0), 5.5)
    assert found.above_rated == tuple(torque > 2.0 for torque in rms)
    assert found.above_nominal == tuple(torque > 2.75 for torque in rms)
    assert exceeding(found.above_rated) == words
    (line,) = (line for line in duty_table(found) if line.startswith("    rated torque"))
    assert line.endswith(words.upper() or "N·m")
    assert found.as_dict()["above_rated"] == found.above_rated
    assert Duty(tuple(each), 30.0, 1.0, None, None).above_rated is None
    assert Duty(tuple(each), 30.0, 1.0, None, None).above_nominal is None
