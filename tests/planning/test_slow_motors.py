"""Motors whose speed is so low that one of them alone decides how long a motion takes."""

from __future__ import annotations

import numpy as np

from deltaopt import plan, verify
from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.drive import Drive
from deltaopt.robot.machine import Model
from deltaopt.robot.model import model_of
from deltaopt.scene.scene import Scene
from tests.edge_scenes import ORSINO

ROBOT = ORSINO.model_copy(update={"drive": Drive(torque=10.0, speed=0.3)})


def torques(model: Model, place: Array, acceleration: Array) -> Array:
    """What it takes to accelerate from rest at a place."""
    piece = [place, np.zeros(3), acceleration / 2, np.zeros(3)]
    return Trajectory(PiecewisePolynomial(np.array([0.0, 1.0]), np.array([piece])), model)(0.0).tau


def turn(task: Scene) -> float:
    """How long the arm with the longest way takes, s, at full speed, which it gains and loses with
    all torques for it. The robot hardly moves meanwhile, and its inertia is constant."""
    model = model_of(task.robot, task.payload)
    motors, limit = model.functions.motors, np.array(task.robot.torque_limits)
    speed = task.robot.speed_limits[0]
    start, goal = model.inverse_kinematics(np.array(task.given_points))[:, motors]
    arm = int(np.abs(goal - start).argmax())
    duration = abs(goal - start)[arm] / speed
    for place, sign in zip(np.array(task.given_points), (1, -1), strict=True):
        places, still = np.tile(place, (3, 1)), np.zeros((3, 3))
        angles = model.motion(places, still, np.eye(3))[2][:, motors]  # rad/s² by m/s²
        weight = torques(model, place, np.zeros(3))
        forces = np.array([torques(model, place, unit) - weight for unit in np.eye(3)])
        by_torque = np.linalg.solve(forces, angles)[:, arm]
        towards = sign * np.sign(goal - start)[arm]
        fastest = np.abs(by_torque) @ limit - towards * by_torque @ weight
        duration += speed / (2 * fastest)
    return float(duration)


def test_plan_takes_as_long_as_the_arm_that_decides():
    """For nearly all of the time the other torques are not determined, and speeds are reached in
    less than a ten thousandth of it."""
    task = Scene(robot=ROBOT, start=(0.4, 0.0, 0.0), goal=(0.3, 0.25, 0.1))
    found = plan(task, tolerance=1e-6)
    assert found.gap <= 1e-6
    assert verify(task, found.trajectory).ok
    assert -1e-7 < found.duration / turn(task) - 1 < 2e-6
