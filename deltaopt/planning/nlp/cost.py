"""The cost of a problem: the duration, an integral over the motion, or both."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Cost:
    """The cost time · T + running · ∫ r dt, with T and t in the scene's unit of time.

    ``time``, ``running``: the weights; r is the rate of the running cost, such as τᵀτ.
    ``duration_is_given``: whether the duration is no variable; it is the unit of time then, T = 1.
    """

    time: float = 1.0
    running: float = 0.0
    duration_is_given: bool = False


FASTEST = Cost()
"""Minimum time."""
