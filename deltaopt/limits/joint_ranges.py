"""Ranges of the joints: θ_least ≤ θ_k ≤ θ_most, where the arms' stops, cables or software ends are,
and |q_{k,3}| ≤ β_max, how far ball joints let the bars lean out of the plane of their arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from deltaopt.limits.limit import SX, Bounds, Described, Instant, Limit, Numbers


@dataclass(frozen=True)
class ArmRange(Limit):
    """Least and largest angle of each arm, rad, from the robot's key ``joints.arm``."""

    name: ClassVar[str] = "arm angle"
    unit: ClassVar[str] = "rad"
    subject: ClassVar[str] = "motor"
    order: ClassVar[int] = 0
    robot_key: ClassVar[str] = "joints.arm"

    def items(self, scene: Described) -> Sequence[Numbers]:
        joints = scene.robot.joints
        return [] if joints is None or joints.arm is None else [joints.arm]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.between(numbers[0], numbers[1])

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.theta


@dataclass(frozen=True)
class BallJoint(Limit):
    """Largest angle of the ball joints of each chain, rad, from the robot's key ``joints.ball``."""

    name: ClassVar[str] = "ball joint angle"
    unit: ClassVar[str] = "rad"
    subject: ClassVar[str] = "chain"
    order: ClassVar[int] = 0
    robot_key: ClassVar[str] = "joints.ball"

    def items(self, scene: Described) -> Sequence[Numbers]:
        joints = scene.robot.joints
        return [] if joints is None or joints.ball is None else [(joints.ball,)]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.symmetric(numbers)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return ca.asin(motion.tilt)

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return motion.tilt / ca.sin(numbers)  # of the platform's position it is linear
