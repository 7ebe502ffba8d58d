"""What a motion is to minimise: its duration, an integral over it, or a weighted sum."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from deltaopt.files.validated_record import Vector3


class Running(Enum):
    """The rate r of a running cost ∫ r dt; its name in lower case is its word in scene files.

    ``integral``: in words. ``unit``: of the integral. ``unit_of_weight``: of a weight that makes a
    time of it. ``order``: the highest derivative of position in it; one of order 3 is finite only
    where the acceleration is continuous.
    """

    EFFORT = "effort ∫ τᵀτ dt", "N²m²s", "1/(N²m²)", 2
    WEIGHTED_EFFORT = "weighted effort ∫ Σ w τ² dt", "s", "1", 2
    JERK = "squared jerk ∫ ‖d³x/dt³‖² dt", "m²/s⁵", "s⁶/m²", 3
    TORQUE_RATE = "squared torque rates ∫ ‖dτ/dt‖² dt", "N²m²/s", "s²/(N²m²)", 3

    def __init__(self, integral: str, unit: str, unit_of_weight: str, order: int) -> None:
        self.word, self.integral, self.unit = self.name.lower(), integral, unit
        self.unit_of_weight, self.order = unit_of_weight, order


@dataclass(frozen=True)
class CostFunctional:
    """What is least: ``time`` · T + ``running`` · ∫ r dt, r being the ``rate``, or the integral
    alone in a given ``duration``, s. ``motors``: weights of the motors in a weighted effort,
    1/(N²m²)."""

    time: float = 1.0
    running: float = 0.0
    rate: Running = Running.EFFORT
    duration: float | None = None
    motors: Vector3 = (1.0, 1.0, 1.0)

    @property
    def unit(self) -> str:
        """Of the cost: that of the integral where it is least alone, otherwise that of time."""
        return "s" if self.time else self.rate.unit


LEAST_TIME = CostFunctional()
"""The duration alone."""
