"""|τ_k| ≤ τ_max: what motor and gear give at the arm, eq. (81)."""

from __future__ import annotations

from typing import Annotated

from deltaopt.files.units import TORQUE
from deltaopt.files.validated_record import PerMotor, Vector3
from deltaopt.limits.limit import SX, Instant, Key, MotorLimit
from deltaopt.robot.robot import Robot


class Torque(MotorLimit):
    """Largest torque of each motor at its arm, N·m."""

    name, unit, order = "torque", "N·m", 2
    key = Key("torque", Annotated[PerMotor, TORQUE], "one torque in N·m, greater than 0, or three")

    def of_drive(self, robot: Robot) -> Vector3:
        return robot.torque_limits

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.tau
