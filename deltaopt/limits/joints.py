"""Limits of the joints: what motors and gears give at the arms, and how far joints may turn.

|τ_k| ≤ τ_max, eq. (81), may have to hold for every payload of a range: see ``WithLeastPayload``.

|τ_k + μ θ̇_k| ≤ c for each straight piece of a torque curve: less torque at speed, driving. A piece
from (ω₁, τ₁) to (ω₂, τ₂) lies on the line τ = c - μ ω. A motor that drives forward keeps
τ + μ θ̇ ≤ c, backward -τ - μ θ̇ ≤ c; as the curve is concave, the motor is below the curve if it
is below the lines of all pieces. When it brakes, τ and θ̇ have opposite signs, and rows with c no
less than the peak torque hold by themselves.

With a limit of order 3, of the rate of a torque or of an arm's acceleration, the acceleration of a
motion is continuous: no drive takes a torque from one limit to the other in no time.

Ranges: θ_least ≤ θ_k ≤ θ_most, where the arms' stops, cables or software ends are, and
|q_{k,3}| ≤ β_max, how far ball joints let the bars lean out of the plane of their arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import casadi as ca

from deltaopt.files.units import ANGULAR_JERK, ANGULAR_SPEED, TORQUE, TORQUE_RATE
from deltaopt.files.validated_record import PerMotor
from deltaopt.limits.limit import SX, Bounds, Described, Instant, Key, Limit, Numbers
from deltaopt.limits.norms_and_ranges import MotorLimit, Range
from deltaopt.mechanisms.instant import LighterInstant

_TORQUE = Key("torque", Annotated[PerMotor, TORQUE])
_SPEED = Key("speed", Annotated[PerMotor, ANGULAR_SPEED])
_RATE = Key("torque_rate", Annotated[PerMotor, TORQUE_RATE])
_JERK = Key("joint_jerk", Annotated[PerMotor, ANGULAR_JERK])

TORQUE_LIMIT = MotorLimit("torque", "N·m", 2, "tau", "torque_limits", (2,), _TORQUE)
"""Largest torque of each motor at its arm."""
SPEED_LIMIT = MotorLimit("speed", "rad/s", 1, "dtheta", "speed_limits", (1,), _SPEED)
"""Largest angular speed of each arm."""
TORQUE_RATE_LIMIT = MotorLimit(
    "torque rate", "N·m/s", 3, "dtau", "torque_rate_limits", (1, 3), _RATE
)
"""Largest rate of each motor's torque at its arm."""
JOINT_JERK = MotorLimit("joint jerk", "rad/s³", 3, "dddtheta", None, (3,), _JERK)
"""Largest jerk of each arm."""


class TorqueCurve(Limit):
    """Largest torque of each motor by its speed, N·m, from the robot's key ``drive.torque_curve``.

    One item for each piece that falls or is below the peak torque: μ in N·m·s/rad and c in N·m.
    """

    name, unit, subject, order = "torque at speed", "N·m", "motor", 2
    powers = (1, 2)
    robot_key = "drive.torque_curve"

    def items(self, scene: Described) -> Sequence[Numbers]:
        curve, peak = scene.robot.drive.torque_curve, max(scene.robot.torque_limits)
        pieces = [_line(*ends) for ends in pairwise(curve or ())]
        return [(mu, c) for mu, c in pieces if mu > 0 or c < peak]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.symmetric(numbers[1])

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.tau + numbers[0] * motion.dtheta


def _line(begin: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
    """μ and c of the line τ = c - μ ω through two points (ω, τ), rad/s and N·m."""
    mu = (begin[1] - end[1]) / (end[0] - begin[0])
    return mu, begin[1] + mu * begin[0]


@dataclass(frozen=True)
class WithLeastPayload(Limit):
    """A limit that depends on the torques, for the least payload of a range.

    The rows of the limit itself are for the largest. Along a given motion torques are affine in the
    payload's mass: what keeps a limit that is affine in them at both ends of the range keeps it for
    every mass between. The first number of each item is the width of the range, kg.
    """

    limit: Limit

    def __post_init__(self) -> None:
        kept = ("unit", "subject", "order", "powers", "robot_key", "promised")
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


ARM_RANGE = Range("arm angle", "rad", "motor", "theta", "joints.arm")
"""Least and largest angle of each arm."""


class BallJoint(Limit):
    """Largest angle of the ball joints of each chain, rad, from the robot's key ``joints.ball``."""

    name, unit, subject, order = "ball joint angle", "rad", "chain", 0
    robot_key = "joints.ball"

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return ca.asin(motion.tilt)

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return motion.tilt / ca.sin(numbers)  # of the platform's position it is linear
