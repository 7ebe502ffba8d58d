"""|τ_k| ≤ τ_max: what motor and gear give at the arm, eq. (81); and with the least payload.

Limits of torques may have to hold for every payload of a range: see ``WithLeastPayload``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from deltaopt.files.units import TORQUE
from deltaopt.files.validated_record import PerMotor, Vector3
from deltaopt.limits.limit import SX, Bounds, Described, Instant, Key, Limit, MotorLimit, Numbers
from deltaopt.mechanisms.instant import LighterInstant
from deltaopt.robot.machine import Machine


class Torque(MotorLimit):
    """Largest torque of each motor at its arm, N·m."""

    name, unit, order, powers = "torque", "N·m", 2, (2,)
    key = Key("torque", Annotated[PerMotor, TORQUE], "one torque in N·m, greater than 0, or three")

    def of_drive(self, robot: Machine) -> Vector3:
        return robot.torque_limits

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.tau


@dataclass(frozen=True)
class WithLeastPayload(Limit):
    """A limit that depends on the torques, for the least payload of a range.

    The rows of the limit itself are for the largest. Along a given motion torques are affine in the
    payload's mass: what keeps a limit that is convex in them at both ends of the range keeps it for
    every mass between. The first number of each item is the width of the range, kg.
    """

    limit: Limit

    def __post_init__(self) -> None:
        kept = ("unit", "subject", "order", "powers", "robot_key", "promised", "convex_in_torque")
        for name in kept:
            object.__setattr__(self, name, getattr(self.limit, name))
        object.__setattr__(self, "name", f"{self.limit.name} with the least payload")

    def items(self, scene: Described) -> Sequence[Numbers]:
        if scene.least_payload is None or scene.payload is None:
            return []
        width = scene.payload - scene.least_payload
        return [(width, *numbers) for numbers in self.limit.items(scene)]

    def bounds(self, numbers: SX) -> Bounds:
        return self.limit.bounds(numbers[1:])

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return self.limit.measure(LighterInstant(motion, numbers[0]), numbers[1:])

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return self.limit.rows(LighterInstant(motion, numbers[0]), numbers[1:])
