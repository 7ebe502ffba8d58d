"""Limits that are values of a record: norms of a vector, and ranges of a quantity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from deltaopt.limits.limit import SX, Bounds, Instant, Key, Limit


@dataclass(frozen=True)
class Norm(Limit):
    """The Euclidean norm of a vector of the motion is at most the first of its numbers.

    ``vector``: of the motion and all numbers. ``out_of_reach``: as of `Bounds`.
    """

    name: str
    unit: str
    subject: str
    order: int
    vector: Callable[[Instant, SX], SX]
    powers: tuple[int, ...] | None = None
    key: Key | None = None
    robot_key: str | None = None
    out_of_reach: bool = True

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.at_most(numbers[0], out_of_reach=self.out_of_reach)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return ca.norm_2(self.vector(motion, numbers))

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return ca.sumsqr(self.vector(motion, numbers)) / numbers[0] ** 2  # smooth where it is 0


@dataclass(frozen=True)
class Range(Limit):
    """A quantity of the position is between two numbers of the robot's file."""

    name: str
    unit: str
    subject: str
    quantity: Callable[[Instant], SX]
    robot_key: str
    order = 0

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.between(numbers[0], numbers[1])

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return self.quantity(motion)
