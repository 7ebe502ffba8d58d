"""Limits of order 3: rates of torques and of accelerations, which drives and frames can follow.

With one of them the acceleration of a motion is continuous: no drive takes a torque from one limit
to the other in no time, and a frame that is shaken so rings.
"""

from __future__ import annotations

from typing import Annotated

from deltaopt.files.units import ANGULAR_JERK, JERK, TORQUE_RATE
from deltaopt.files.validated_record import PerMotor, Positive, Vector3
from deltaopt.limits.limit import SX, Instant, Key, MotorLimit
from deltaopt.limits.norms_and_ranges import Norm
from deltaopt.robot.machine import Machine


class TorqueRate(MotorLimit):
    """Largest rate of each motor's torque at its arm, N·m/s."""

    name, unit, order, powers = "torque rate", "N·m/s", 3, (1, 3)
    key = Key(
        "torque_rate",
        Annotated[PerMotor, TORQUE_RATE],
        "one rate of torque in N·m/s, greater than 0, or three",
    )

    def of_drive(self, robot: Machine) -> Vector3 | None:
        return robot.torque_rate_limits

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.dtau


class JointJerk(MotorLimit):
    """Largest jerk of each arm, rad/s³."""

    name, unit, order, powers = "joint jerk", "rad/s³", 3, (3,)
    key = Key(
        "joint_jerk",
        Annotated[PerMotor, ANGULAR_JERK],
        "one angular jerk in rad/s³, greater than 0, or three",
    )

    def of_drive(self, robot: Machine) -> Vector3 | None:
        return None

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.dddtheta


def _jerk(motion: Instant, numbers: SX) -> SX:
    return motion.j


_JERK = Key("jerk", Annotated[Positive, JERK], "a jerk in m/s³, greater than 0")
PLATFORM_JERK = Norm("jerk", "m/s³", "platform", 3, _jerk, (6,), _JERK, out_of_reach=False)
"""Largest jerk of the platform in any direction."""
