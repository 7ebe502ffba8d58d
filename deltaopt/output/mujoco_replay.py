"""A motion's torques replayed in MuJoCo, whose bodies know nothing of this package's equations.

The torques, nothing else, drive the robot of ``mjcf`` from where the motion begins. Where the
tool's point arrives is compared with where the motion ends. MuJoCo's integrator is of first order
and its joints are as stiff as the step allows, so that the miss falls in proportion to the step if
torques and robot belong together; if not, it stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import log

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import installed
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.motion.trajectory import Trajectory
from deltaopt.output.mjcf import TO_WORLD, mjcf
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Robot, as_delta

STEPS = (2000, 4000, 8000)
"""Numbers of steps of a replay. More take longer, about a second for 4,000, and miss by less."""
_LEAST_ORDER = 0.8
"""Power of the step that the miss must fall with. It is one within 0.1 for shipped scenes, with
Coulomb friction too; for a robot or torques that are wrong it is near zero."""


class InMujoco:
    """A robot with a payload (kg) in MuJoCo, at rest or in motion."""

    def __init__(self, robot: Robot, payload: float | None, start: Vector3) -> None:
        """With the tool's point at a start (m, base's frame). Raises MissingPackage."""
        self.robot, self.payload, self.start = robot, payload, start
        self.mujoco = installed("mujoco", "mujoco")
        self.model = self.mujoco.MjModel.from_xml_string(mjcf(robot, payload, start))
        self.data = self.mujoco.MjData(self.model)

    def put(self, q: Array, dq: Array) -> None:
        """Give MuJoCo's joints the positions and speeds of the twelve coordinates, (12,) each."""
        q0 = DeltaModel(self.robot, self.payload).inverse_kinematics(self.start)
        self.data.qpos[:] = self.model.qpos0
        self.data.qpos[:3] = q[:3] - np.array(self.start)
        self.data.qvel[:3] = dq[:3]
        for k in range(3):
            own = slice(3 + 3 * k, 6 + 3 * k)
            at_start = of_joints(q0[own]) * [0, 1, 1, 1, 1]
            self.data.qpos[7 + 5 * k : 12 + 5 * k] = of_joints(q[own]) - at_start
            self.data.qvel[6 + 5 * k : 11 + 5 * k] = of_joints(dq[own])

    def coulomb(self, speed: Array) -> Array:
        """Coulomb friction at motor speeds, (3,), N·m: MuJoCo's own is not tanh (θ̇ / w)."""
        friction = self.robot.drive.friction
        if friction is None or friction.coulomb is None or friction.speed is None:
            return np.zeros(3)
        return np.asarray(friction.coulomb * np.tanh(speed / friction.speed))

    def miss(self, trajectory: Trajectory, count: int) -> float:
        """Distance, m, of the tool's point from the end of a motion whose torques drove it there.

        ``count``: of equal steps. The mean torque of a step is held through it.
        """
        model, data = self.model, self.data
        model.opt.timestep = trajectory.duration / count
        model.opt.tolerance, model.opt.iterations = 0.0, 100
        model.eq_solref[:] = [2 * model.opt.timestep, 1.0]
        self.mujoco.mj_resetData(model, data)
        q, dq, _ = trajectory.coordinates_inside([0.0])
        self.put(q[0], dq[0])
        for torque in mean_torques(trajectory, count):
            data.ctrl[:] = torque - self.coulomb(np.array(data.qvel[6::5]))
            self.mujoco.mj_step(model, data)
        self.mujoco.mj_forward(model, data)
        goal = trajectory.position.at(trajectory.knots[-1:])[0]
        return float(np.linalg.norm(data.site("tool").xpos - TO_WORLD @ goal))


def mean_torques(trajectory: Trajectory, count: int) -> Array:
    """Mean motor torques of a motion in ``count`` equal steps, (count, 3), N·m.

    By Gauss's rule with two points between all ends of steps and all knots, so that a torque that
    jumps inside of a step counts for as long as it lasts.
    """
    knots = trajectory.knots
    ends = np.linspace(knots[0], knots[-1], count + 1)
    times = np.unique(np.concatenate([ends, knots]))
    half, middle = np.diff(times) / 2, (times[1:] + times[:-1]) / 2
    points = middle[:, None] + half[:, None] * np.array([-1, 1]) / np.sqrt(3)
    torques = trajectory(points.ravel()).tau.reshape(-1, 2, 3).sum(axis=1)
    step = np.searchsorted(ends, middle) - 1
    impulses = np.zeros((count, 3))
    np.add.at(impulses, step, half[:, None] * torques)
    return impulses / (trajectory.duration / count)


def of_joints(angles: Array) -> Array:
    """Angles, or rates, of a chain's five joints, of q_{k,1}, q_{k,2}, q_{k,3}: those of the arm
    and of both bars' forks and swings."""
    q1, q2, q3 = angles
    return np.array([q1, q2 - q1, q3, q2 - q1, q3])


@dataclass(frozen=True)
class MujocoReplay:
    """Arrivals of one motion: ``steps``, s, the longest first, and ``misses``, m, one for each."""

    steps: tuple[float, ...]
    misses: tuple[float, ...]

    @property
    def order(self) -> float:
        """The power of the step that the miss falls with, from the longest step to the shortest."""
        return log(self.misses[0] / self.misses[-1]) / log(self.steps[0] / self.steps[-1])

    @property
    def converges(self) -> bool:
        """Whether the torques lead to the goal as steps become shorter."""
        falls = all(one > other for one, other in pairwise(self.misses))
        return falls and self.order >= _LEAST_ORDER


def replay_in_mujoco(trajectory: Trajectory, counts: Sequence[int] | None = None) -> MujocoReplay:
    """Replay a motion of a robot with rising numbers of steps, two at least; ``STEPS`` by default.

    Raises MissingPackage.
    """
    model = trajectory.model
    start = vector3(trajectory.path_inside([0.0])[0][0])
    there = InMujoco(as_delta(model.robot), model.payload, start)
    counts = counts or STEPS
    misses = tuple(there.miss(trajectory, count) for count in counts)
    return MujocoReplay(tuple(trajectory.duration / count for count in counts), misses)
