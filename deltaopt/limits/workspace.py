"""x_least ≤ x ≤ x_most and √(y² + z²) ≤ r: where the robot's maker or its cell lets the tool be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from deltaopt.limits.limit import SX, Bounds, Described, Instant, Numbers


@dataclass(frozen=True)
class WorkspaceDepth:
    """Least and largest depth of the tool's point below the base, m: ``workspace.depth``."""

    name: ClassVar[str] = "workspace depth"
    unit: ClassVar[str] = "m"
    subject: ClassVar[str] = "tool"
    order: ClassVar[int] = 0
    key: ClassVar[None] = None
    robot_key: ClassVar[str] = "workspace.depth"
    promised: ClassVar[bool] = True

    def items(self, scene: Described) -> Sequence[Numbers]:
        workspace = scene.robot.workspace
        return [] if workspace is None or workspace.depth is None else [workspace.depth]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.between(numbers[0], numbers[1])

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.x[0]

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return self.bounds(numbers).normalised(self.measure(motion, numbers))


@dataclass(frozen=True)
class WorkspaceRadius:
    """Largest distance of the tool's point from the base's axis, m: ``workspace.radius``."""

    name: ClassVar[str] = "workspace radius"
    unit: ClassVar[str] = "m"
    subject: ClassVar[str] = "tool"
    order: ClassVar[int] = 0
    key: ClassVar[None] = None
    robot_key: ClassVar[str] = "workspace.radius"
    promised: ClassVar[bool] = True

    def items(self, scene: Described) -> Sequence[Numbers]:
        workspace = scene.robot.workspace
        return [] if workspace is None or workspace.radius is None else [(workspace.radius,)]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.at_most(numbers, out_of_reach=True)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return ca.norm_2(motion.x[1:])

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return ca.sumsqr(motion.x[1:]) / numbers**2  # the norm has no derivative on the axis
