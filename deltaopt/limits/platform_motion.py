"""Euclidean norms of the platform's motion: ‖ẋ‖ ≤ v_max and ‖ẍ‖ ≤ a_max.

How fast hoses, cameras, scales or people beside the robot let the platform be, and what load,
gripper or product on it can stand.
"""

from __future__ import annotations

from typing import Annotated

from deltaopt.files.units import ACCELERATION, SPEED
from deltaopt.files.validated_record import Positive
from deltaopt.limits.limit import SX, Instant, Key
from deltaopt.limits.norms_and_ranges import Norm


def _velocity(motion: Instant, numbers: SX) -> SX:
    return motion.v


def _acceleration(motion: Instant, numbers: SX) -> SX:
    return motion.a


_SPEED = Key("platform_speed", Annotated[Positive, SPEED], "a speed in m/s, greater than 0")
_ACCELERATION = Key(
    "acceleration", Annotated[Positive, ACCELERATION], "an acceleration in m/s², greater than 0"
)
PLATFORM_SPEED = Norm("platform speed", "m/s", "platform", 1, _velocity, (2,), _SPEED)
"""Largest speed of the platform in any direction."""
PLATFORM_ACCELERATION = Norm(
    "acceleration", "m/s²", "platform", 2, _acceleration, (4,), _ACCELERATION, out_of_reach=False
)
"""Largest acceleration of the platform in any direction."""
