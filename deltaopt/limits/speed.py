"""|θ̇_k| ≤ ω_max: how fast motor and gear turn the arm."""

from __future__ import annotations

from typing import Annotated

from deltaopt.files.units import ANGULAR_SPEED
from deltaopt.files.validated_record import PerMotor, Vector3
from deltaopt.limits.limit import SX, Instant, Key, MotorLimit
from deltaopt.robot.machine import Machine


class Speed(MotorLimit):
    """Largest angular speed of each arm, rad/s."""

    name, unit, order, powers = "speed", "rad/s", 1, (1,)
    key = Key(
        "speed",
        Annotated[PerMotor, ANGULAR_SPEED],
        "one angular speed in rad/s, greater than 0, or three",
    )

    def of_drive(self, robot: Machine) -> Vector3 | None:
        return robot.speed_limits

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.dtheta
