"""Magnitudes that bring a scene's variables and equations to the order of one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.limits.constraints import Constraints, SceneLimits
from deltaopt.motion.trajectory import PiecewisePolynomial
from deltaopt.scene.scene import Scene, limits_of
from deltaopt.scene.task import EndState, distance

Array = NDArray[np.float64]

UNTIGHTENED = 1.0
"""Share of a limit that may be used all of it."""


@dataclass(frozen=True)
class Parameters:
    """Parameters of a point function, by name, as symbols.

    ``origin`` (3, m), ``length`` (m), ``time`` (s) and ``torque`` (3, N·m) are the units of scaled
    variables; ``limits`` the numbers of the limits; ``mechanism`` those of the mechanism.
    """

    origin: ca.SX
    length: ca.SX
    time: ca.SX
    torque: ca.SX
    limits: ca.SX
    mechanism: ca.SX

    @classmethod
    def symbols(cls, constraints: Constraints, mechanism: ca.SX) -> Parameters:
        """Symbols for all but the mechanism's, which exist."""
        return cls(
            origin=ca.SX.sym("origin", 3),
            length=ca.SX.sym("length"),
            time=ca.SX.sym("time"),
            torque=ca.SX.sym("torque", constraints.motors),
            limits=constraints.numbers(),
            mechanism=mechanism,
        )

    @property
    def scaling(self) -> ca.SX:
        """Those that ``Scaling.vector`` gives numbers for."""
        return ca.vertcat(self.origin, self.length, self.time, self.torque, self.limits)

    @property
    def vector(self) -> ca.SX:
        """All of them, in their order."""
        return ca.vertcat(self.scaling, self.mechanism)


@dataclass(frozen=True)
class Scaling:
    """Units of a scene's scaled variables, and its limits.

    Lengths are measured from the start in units of the distance from start to goal (m), time in
    units of ``time`` (s), torques in units of the largest that the scene allows. ``share``: of each
    limit what a motion may use, everywhere or by interval, (N, rows).
    """

    scene: Scene
    time: float
    share: Array | float = UNTIGHTENED

    @cached_property
    def limits(self) -> SceneLimits:
        """The limits of the scene."""
        return limits_of(self.scene)

    @property
    def constraints(self) -> Constraints:
        """The limits without their numbers."""
        return self.limits.constraints

    @cached_property
    def origin(self) -> Array:
        """Start of the motion, (3,), m."""
        return np.array(self.scene.task.start.position)

    @cached_property
    def length(self) -> float:
        """Distance from start to goal, m."""
        return distance(self.scene.task)

    @cached_property
    def torque(self) -> Array:
        """The unit of torque: the largest that the scene allows each motor, (motors,), N·m."""
        return self.limits.bounds()[1][self.constraints.is_control]

    @cached_property
    def at_start(self) -> Array:
        """X and V at the start, (6,)."""
        return self._state(self.scene.task.start)

    @cached_property
    def at_goal(self) -> Array:
        """X and V at the goal, (6,)."""
        return self._state(self.scene.task.goal)

    def _state(self, end: EndState) -> Array:
        """An end at rest, in these units: a velocity would depend on the duration."""
        position = (np.array(end.position) - self.origin) / self.length
        return np.concatenate([position, np.zeros(len(position))])

    @property
    def untightened(self) -> Scaling:
        """With all of every limit."""
        return self if self.share is UNTIGHTENED else replace(self, share=UNTIGHTENED)

    def shares(self, intervals: int) -> Array:
        """Of each limit what may be used in each interval, (N, rows)."""
        return np.broadcast_to(self.share, (intervals, self.constraints.number))

    def vector(self) -> Array:
        """Numbers of ``Parameters.scaling``."""
        units = [*self.origin, self.length, self.time, *self.torque]
        return np.concatenate([units, self.limits.numbers])

    def parameters(self, mechanism: Array) -> Array:
        """Numbers of all parameters of a point function; ``mechanism``: the mechanism's."""
        return np.concatenate([self.vector(), mechanism])

    def polynomial(self, h: Array, coefficients: Array, T: float) -> PiecewisePolynomial:
        """In m and s, from scaled coefficients on intervals of lengths h, (n,), in units of
        a time T (s)."""
        coefficients = self.length * coefficients
        coefficients[:, 0] += self.origin
        coefficients /= T ** np.arange(coefficients.shape[1])[:, None]
        return PiecewisePolynomial(T * np.concatenate([[0.0], np.cumsum(h)]), coefficients)

    def states(self, position: PiecewisePolynomial, times: Array, T: float) -> Array:
        """(X, V) of a motion (m, s) at times (s), V in units of length / T: (n, 6)."""
        x, v = position.with_rate_at(times)
        return np.hstack([(x - self.origin) / self.length, v * (T / self.length)])
