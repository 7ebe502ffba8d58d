"""Units in which robots and motions of every size have numbers of the order of one.

The equations of motion hold in any units of length, mass and time. In those of the robot and of the
motion itself rounding and the tolerances of integrators mean the same for a robot of a micrometre
as for one of a kilometre.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import MovingEnds, distance

_LENGTH, _MASS, _INERTIA = (1, 0, 0), (0, 1, 0), (2, 1, 0)
_ACCELERATION = (1, 0, -2)

DIMENSIONS: dict[str, tuple[int, int, int]] = {
    **dict.fromkeys(("a1", "a2", "a3", "a4", "b1", "b2"), _LENGTH),
    **dict.fromkeys(("tool_x", "tool_y", "tool_z"), _LENGTH),
    **dict.fromkeys(("m1", "m2", "m3", "m4"), _MASS),
    **dict.fromkeys(("I33", "I41", "I42", "I43"), _INERTIA),
    **dict.fromkeys(("g", "g_y", "g_z"), _ACCELERATION),
}
"""Of each parameter of a Delta but those of loads, by its name: powers of length, mass and time."""


def way_of(scene: Scene, trajectory: Trajectory) -> float:
    """How far a motion goes, m: from the scene's start to its goal; where these move or there are
    via points or an approach, as far as it goes from where it begins."""
    task = scene.task
    by_motion = isinstance(task, MovingEnds) or task.gates
    return trajectory.extent if by_motion else distance(task)


@dataclass(frozen=True)
class Units:
    """Units of ``length`` (m), ``mass`` (kg) and ``time`` (s)."""

    length: float
    mass: float
    time: float

    @classmethod
    def of(cls, scene: Scene, trajectory: Trajectory) -> Units:
        """The length of the upper arm, the mass of all bodies of a kind, and the duration or, if
        that is less, the time in which gravity moves the length of the arm from rest, about."""
        numbers = delta_model(scene.robot, scene.payload).numbers
        length, time = scene.robot.upper_arm.length, trajectory.duration
        masses = (numbers.m1, numbers.m2 or 0.0, numbers.m3, numbers.m4)
        gravity = hypot(*(g or 0.0 for g in (numbers.g, numbers.g_y, numbers.g_z)))
        if gravity:
            time = min(time, sqrt(length / gravity))
        return cls(length, float(sum(masses)), time)

    @property
    def torque(self) -> float:
        """The unit of torque, N·m."""
        return self.mass * (self.length / self.time) ** 2

    def parameters(self, model: DeltaModel) -> Array:
        """Values of a model's parameters in these units, in their order."""
        terms = model.functions.terms
        of_loads = {name: of for load in terms.loads for name, of in load.dimensions.items()}
        powers = np.array([(DIMENSIONS | of_loads)[name] for name in terms.names])
        return np.asarray(model.parameters / self._to(powers))

    def position(self, position: PiecewisePolynomial) -> PiecewisePolynomial:
        """A position (m over s) in these units."""
        powers = np.arange(position.coefficients.shape[1])[:, None]
        coefficients = position.coefficients * (self.time**powers / self.length)
        return PiecewisePolynomial(position.knots / self.time, coefficients)

    def _to(self, powers: Array) -> Array:
        """The units of quantities with these powers of length, mass and time, (N, 3) -> (N,)."""
        return np.asarray(np.prod(np.array([self.length, self.mass, self.time]) ** powers, axis=1))
