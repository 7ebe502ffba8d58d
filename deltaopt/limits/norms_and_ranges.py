"""Limits that are values of a record: norms of a vector, ranges, and limits of each motor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from deltaopt.errors import SceneError
from deltaopt.files.units import percentage
from deltaopt.files.validated_record import Vector3, per_motor
from deltaopt.limits.limit import SX, Bounds, Described, Instant, Key, Limit, Numbers
from deltaopt.robot.machine import Machine


@dataclass(frozen=True)
class Norm(Limit):
    """The Euclidean norm of a vector of the motion is at most the first of its numbers.

    ``quantity``: the vector, an attribute of motions. ``out_of_reach``: as of `Bounds`.
    """

    name: str
    unit: str
    subject: str
    order: int
    quantity: str
    powers: tuple[int, ...] | None = None
    key: Key | None = None
    robot_key: str | None = None
    out_of_reach: bool = True

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.at_most(numbers[0], out_of_reach=self.out_of_reach)

    def vector(self, motion: Instant, numbers: SX) -> SX:
        """What the norm is of."""
        return super().measure(motion, numbers)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return ca.norm_2(self.vector(motion, numbers))

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return ca.sumsqr(self.vector(motion, numbers)) / numbers[0] ** 2  # smooth where it is 0


@dataclass(frozen=True)
class Range(Limit):
    """A quantity of the position, an attribute of motions, is between two numbers of the robot's
    file."""

    name: str
    unit: str
    subject: str
    quantity: str
    robot_key: str
    order = 0

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.between(numbers[0], numbers[1])


@dataclass(frozen=True)
class MotorLimit(Limit):
    """A limit of the size of a ``quantity`` of each motor, an attribute of motions: given by the
    robot's drives, whose attribute ``of_drives`` is, None if these have none, and tightened by a
    scene."""

    name: str
    unit: str
    order: int
    quantity: str
    of_drives: str | None
    powers: tuple[int, ...]
    key: Key
    subject: str = "motor"

    def of_drive(self, robot: Machine) -> Vector3 | None:
        """What the robot's drives give; None if that is unlimited."""
        return getattr(robot, self.of_drives) if self.of_drives else None

    def without_shares(self, given: object, robot: Machine) -> object:
        """What a scene gives, with shares of the drive's limit such as "85 %" as numbers.

        Raises SceneError for a share that is not above 0 and at most 100 %, or of no limit.
        """
        each = given if isinstance(given, list | tuple) else [given] * 3
        if len(each) != 3 or all(percentage(value) is None for value in each):
            return given
        drive = self.of_drive(robot) or (None, None, None)
        resolved = tuple(map(self._without_share, each, drive))
        return resolved[0] if len(set(resolved)) == 1 else resolved

    def _without_share(self, value: object, drive: float | None) -> object:
        """A share of one motor's limit as a number; any other value as it is."""
        share, key = percentage(value), f"limits.{self.key.name}"
        if share is None:
            return value
        if drive is None:
            expected = f"{self.key.expected}, since the robot's drive names no {self.name}"
            raise SceneError(None, key, value, expected)
        if not 0 < share <= 1:
            expected = "a share of what the drive gives, greater than 0 and at most 100 %"
            raise SceneError(None, key, value, expected)
        return share * drive

    def items(self, scene: Described) -> Sequence[Numbers]:
        """The drive's, or the scene's, which must not be more."""
        drive, given = self.of_drive(scene.robot), scene.given(self.key.name)
        if given is None:
            return [] if drive is None else [drive]
        each = per_motor(given)
        if drive is not None and any(ours > its for ours, its in zip(each, drive, strict=True)):
            most = f"{drive[0]:g}" if len(set(drive)) == 1 else ", ".join(f"{d:g}" for d in drive)
            expected = f"at most what the drive gives, {most} {scene.robot.unit(self.unit)}"
            raise SceneError(None, f"limits.{self.key.name}", given, expected)
        return [each]
