"""What a problem minimises: the duration, an integral over the motion, or both."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Cost:
    """time · T + running · ∫ r dt, both in the scene's unit of time.

    r is the rate that the equations at a point give, such as Σ τ². ``duration_is_given``: time
    is no variable; the unit of time is the duration then, and T = 1.
    """

    time: float = 1.0
    running: float = 0.0
    duration_is_given: bool = False


FASTEST = Cost()
