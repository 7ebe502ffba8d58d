"""Magnitudes that bring a scene's variables and equations to the order of one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from deltaopt.motion.trajectory import PiecewisePolynomial
from deltaopt.scene.scene import Scene

Array = NDArray[np.float64]


OPENING = 0.1**2
"""Least sin² (q_{k,1} - q_{k,2}) on the way: six degrees from folded or stretched.

A motion that touches the serial singularity may be faster (of random moves by up to 1 %), but
task space cannot describe it: torque for a given acceleration grows without bound there.
"""


WHOLE = 1.0
"""Share of a limit that may be used all of it."""


def margin_of_fold(opening_at_ends: float) -> float:
    """Least sin² (q_{k,1} - q_{k,2}) on the way, from the least at its ends."""
    return min(OPENING, opening_at_ends / 2)


@dataclass(frozen=True)
class Scales:
    """Magnitudes of a scene: its length D (m), a time (s), the drives' limits, and how far
    its ends are from a fold (least sin² (q_{k,1} - q_{k,2})). ``torque_share`` and
    ``speed_share``: of the limits that may be used, everywhere or by interval, (N, 1, 3)."""

    scene: Scene
    time: float
    opening_at_ends: float
    torque_share: Array | float = WHOLE
    speed_share: Array | float = WHOLE

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
    def at_start(self) -> Array:
        """X and V at the start, (6,)."""
        return np.zeros(6)

    @property
    def at_goal(self) -> tuple[Array, Array]:
        """Bounds of X and V at the goal, (6,) each."""
        state = np.concatenate([self.goal, np.zeros(3)])
        return state, state

    @property
    def torques(self) -> Array:
        return np.array(self.scene.torque_limits)

    @property
    def whole(self) -> Scales:
        """Without shares."""
        if self.torque_share is WHOLE and self.speed_share is WHOLE:
            return self
        return replace(self, torque_share=WHOLE, speed_share=WHOLE)

    def shares(self, intervals: int) -> Array:
        """Of the limits of torque and speed that may be used in each interval, (N, 6)."""
        shares = np.empty((intervals, 2, 3))
        shares[:, :1], shares[:, 1:] = self.torque_share, self.speed_share
        return shares.reshape(intervals, 6)

    def polynomial(self, h: Array, coefficients: Array, T: float) -> PiecewisePolynomial:
        """In m and s, from scaled coefficients on intervals of lengths h, (n,), in units of
        a time T (s)."""
        coefficients = self.length * coefficients
        coefficients[:, 0] += self.origin
        coefficients /= T ** np.arange(coefficients.shape[1])[:, None]
        return PiecewisePolynomial(T * np.concatenate([[0.0], np.cumsum(h)]), coefficients)

    def states(self, position: PiecewisePolynomial, times: Array, T: float) -> Array:
        """(X, V) of a motion (m, s) at times (s), V in units of D / T: (n, 6)."""
        x, v = position.with_rate_at(times)
        return np.hstack([(x - self.origin) / self.length, v * (T / self.length)])

    def vector(self) -> Array:
        """x_start, D, time, torque limits, margin of the fold[, speed limits]: a program has one
        for all intervals, so that the least share counts."""
        scene = self.scene
        speeds = (float(np.min(self.speed_share)) * speed for speed in scene.speed_limits or ())
        limits = [*scene.torque_limits, margin_of_fold(self.opening_at_ends), *speeds]
        return np.array([*scene.start, self.length, self.time, *limits])
