"""Magnitudes that bring a scene's variables and equations to the order of one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from deltaopt.scene import Scene

Array = NDArray[np.float64]


OPENING = 0.1**2
"""Least sin² (q_{k,1} - q_{k,2}) on the way: six degrees from folded or stretched.

A motion that touches the serial singularity may be faster (of random moves by up to 1 %), but
task space cannot describe it: torque for a given acceleration grows without bound there.
"""


def margin_of_fold(opening_at_ends: float) -> float:
    """Least sin² (q_{k,1} - q_{k,2}) on the way, from the least at its ends."""
    return min(OPENING, opening_at_ends / 2)


@dataclass(frozen=True)
class Scales:
    """Magnitudes of a scene: its length D (m), a time (s), the drives' limits, and how far
    its ends are from a fold (least sin² (q_{k,1} - q_{k,2}))."""

    scene: Scene
    time: float
    opening_at_ends: float

    @property
    def origin(self) -> Array:
        return np.array(self.scene.start)

    @cached_property
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
        """x_start, D, time, torque limits, margin of the fold[, speed limits]."""
        scene = self.scene
        limits = [
            *scene.torque_limits,
            margin_of_fold(self.opening_at_ends),
            *(scene.speed_limits or ()),
        ]
        return np.array([*scene.start, self.length, self.time, *limits])
