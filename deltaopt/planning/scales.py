"""Magnitudes that bring a scene's variables and equations to the order of one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deltaopt.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scales:
    """Magnitudes of a scene: its length D (m), a time (s), and the drives' limits."""

    scene: Scene
    time: float

    @property
    def origin(self) -> Array:
        return np.array(self.scene.start)

    @property
    def length(self) -> float:
        return float(np.linalg.norm(np.array(self.scene.goal) - np.array(self.scene.start)))

    @property
    def goal(self) -> Array:
        """The goal in these scales."""
        return (np.array(self.scene.goal) - self.origin) / self.length

    @property
    def torques(self) -> Array:
        return np.array(self.scene.torque_limits)

    def vector(self) -> Array:
        """x_start, D, time, torque limits[, speed limits]."""
        speeds = self.scene.speed_limits or ()
        return np.array(
            [*self.scene.start, self.length, self.time, *self.scene.torque_limits, *speeds]
        )
