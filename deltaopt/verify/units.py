"""Units in which robots and motions of every size have numbers of the order of one.

The equations of motion hold in any units of length, mass and time. In those of the robot and of the
motion itself rounding and the tolerances of integrators mean the same for a robot of a micrometre
as for one of a kilometre.
"""

from __future__ import annotations

from math import hypot, sqrt

import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.mechanisms.functions import Functions
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.machine import Model
from deltaopt.robot.model import model_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import distance


def way_of(scene: Scene, trajectory: Trajectory) -> float:
    """How far a motion goes, m: from the scene's start to its goal; where these move or there are
    via points or an approach, as far as it goes from where it begins."""
    task = scene.task
    by_motion = task.moves_at_ends or task.gates
    return trajectory.extent if by_motion else distance(task)


class Units:
    """Units of ``length`` (m), ``mass`` (kg) and ``time`` (s)."""

    def __init__(self, scene: Scene, trajectory: Trajectory) -> None:
        """The robot's own length, the mass of all bodies of a kind, and the duration or, if that
        is less, the time in which gravity moves that length from rest, about."""
        self.length, self.mass = scene.robot.size, model_of(scene.robot, scene.payload).mass
        self.time, gravity = trajectory.duration, hypot(*scene.robot.gravity_vector)
        if gravity:
            self.time = min(self.time, sqrt(self.length / gravity))

    def coordinates(self, functions: Functions) -> Array:
        """The units of all coordinates, (n,): lengths; angles have none."""
        return np.where(functions.lengths, self.length, 1.0)

    def torque(self, functions: Functions) -> float:
        """The unit of what actuators exert, N·m or N: of energy over that of their positions."""
        own = float(self.coordinates(functions)[functions.motors][0])
        return self.mass * (self.length / self.time) ** 2 / own

    def parameters(self, model: Model) -> Array:
        """Values of a model's parameters in these units, in their order."""
        units = np.array([self.length, self.mass, self.time])
        return np.asarray(model.parameters / np.prod(units**model.dimensions, axis=1))

    def position(self, position: PiecewisePolynomial) -> PiecewisePolynomial:
        """A position (m over s) in these units."""
        powers = np.arange(position.coefficients.shape[1])[:, None]
        coefficients = position.coefficients * (self.time**powers / self.length)
        return PiecewisePolynomial(position.knots / self.time, coefficients)
