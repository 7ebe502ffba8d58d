"""A fourth axis that turns the gripper while the platform moves: a least duration of the motion."""

from __future__ import annotations

from math import sqrt
from typing import Annotated

from deltaopt.files.units import ANGLE, ANGULAR_ACCELERATION, ANGULAR_SPEED
from deltaopt.files.validated_record import Positive, Record


class Rotation(Record):
    """A turn by ``angle`` (rad) from rest to rest, at most at ``speed`` (rad/s), with at most
    ``acceleration`` (rad/s²).

    The axis is light and moves by itself: the Delta's motion only has to take no less time.
    """

    angle: Annotated[Positive, ANGLE]
    speed: Annotated[Positive, ANGULAR_SPEED]
    acceleration: Annotated[Positive, ANGULAR_ACCELERATION]

    @property
    def duration(self) -> float:
        """The least time it takes, s: full acceleration, full speed if that is reached, full
        braking."""
        if self.angle * self.acceleration <= self.speed**2:
            return 2 * sqrt(self.angle / self.acceleration)
        return self.angle / self.speed + self.speed / self.acceleration
