"""Euclidean norms of the platform's motion: ‖ẋ‖ ≤ v_max and ‖ẍ‖ ≤ a_max.

How fast hoses, cameras, scales or people beside the robot let the platform be, and what load,
gripper or product on it can stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import casadi as ca

from deltaopt.files.units import ACCELERATION, SPEED
from deltaopt.files.validated_record import Positive
from deltaopt.limits.limit import SX, Bounds, Described, Instant, Key, Limit, Numbers


@dataclass(frozen=True)
class PlatformSpeed(Limit):
    """Largest speed of the platform in any direction, Euclidean norm, m/s."""

    name: ClassVar[str] = "platform speed"
    unit: ClassVar[str] = "m/s"
    subject: ClassVar[str] = "platform"
    order: ClassVar[int] = 1
    key: ClassVar[Key] = Key(
        "platform_speed", Annotated[Positive, SPEED], "a speed in m/s, greater than 0"
    )

    def items(self, scene: Described) -> Sequence[Numbers]:
        given = scene.given(self.key.name)
        return [] if given is None else [(given,)]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.at_most(numbers, out_of_reach=True)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return ca.norm_2(motion.v)

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return ca.sumsqr(motion.v) / numbers**2  # the norm has no derivative at rest


@dataclass(frozen=True)
class Acceleration(Limit):
    """Largest acceleration of the platform in any direction, Euclidean norm, m/s²."""

    name: ClassVar[str] = "acceleration"
    unit: ClassVar[str] = "m/s²"
    subject: ClassVar[str] = "platform"
    order: ClassVar[int] = 2
    key: ClassVar[Key] = Key(
        "acceleration",
        Annotated[Positive, ACCELERATION],
        "an acceleration in m/s², greater than 0",
    )

    def items(self, scene: Described) -> Sequence[Numbers]:
        given = scene.given(self.key.name)
        return [] if given is None else [(given,)]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.at_most(numbers)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return ca.norm_2(motion.a)

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return ca.sumsqr(motion.a) / numbers**2  # the norm has no derivative at rest
