"""What a cost may count beside the duration: integrals over the motion."""

from __future__ import annotations

from enum import Enum


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
