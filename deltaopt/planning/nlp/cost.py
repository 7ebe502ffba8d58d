"""The cost of a problem: the duration, an integral over the motion, or both."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto


class Running(Enum):
    """What the rate r of a running cost is."""

    EFFORT = auto()
    """τᵀτ, N²m²."""
    JERK = auto()
    """The squared jerk of the platform, in units of the scene."""


@dataclass(frozen=True)
class Cost:
    """The cost time · T + running · ∫ r dt, with T and t in the scene's unit of time.

    ``time``, ``running``: the weights; r is the ``rate`` of the running cost.
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
