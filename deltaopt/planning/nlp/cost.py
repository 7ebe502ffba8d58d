"""The cost of a problem: the duration, an integral over the motion, or both."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from deltaopt.limits.running_cost import Running


@dataclass(frozen=True)
class Cost:
    """The cost time · T + running · ∫ r dt, with T and t in the scene's unit of time.

    ``time``, ``running``: the weights; r is the ``rate`` of the running cost, of a jerk in units of
    the scene.
    ``duration_is_given``: whether the duration is no variable; it is the unit of time then, T = 1.
    """

    time: float = 1.0
    running: float = 0.0
    duration_is_given: bool = False
    rate: Running = Running.EFFORT


FASTEST = Cost()
"""Minimum time."""
SMOOTHLY_FASTEST = Cost(running=1e-9, rate=Running.JERK)
"""Minimum time where acceleration is continuous, and the least jerk of the motions that take no
longer: where the duration leaves torques free they would chatter. It costs some 1e-5 of it."""


def effort_of(tau: ca.SX, motors: ca.SX) -> ca.SX:
    """The rate of effort of torques, (m,); weighted, where there are weights of the motors."""
    return ca.dot(motors, tau**2) if motors.numel() else ca.sumsqr(tau)
