"""Approach: within a vertical cylinder about start and goal, and above a height between the two.

Which of these holds depends on the phase of the motion: from the start to its height, from there to
the goal's height, and down to the goal. Phases differ in the limit's numbers alone, so that one
compiled function serves all. For a place of which the phase is not known the limit is that it is
in one of the three regions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.limits.limit import SX, Bounds, Column, Described, Instant, Numbers

Array = NDArray[np.float64]

_ANYWHERE = 1e3
"""Radius of a cylinder and depth of a level, m, that no robot reaches: no limit."""


@dataclass(frozen=True)
class Approach:
    """Two rows. The first: the squared distance from the axis over the squared radius, in the outer
    phases. The second: how far below the level the tool is, in the middle phase.

    Numbers: axis and radius of two cylinders, the level above which a place in neither may be, the
    level that is imposed, and the natural size of heights.
    """

    name: ClassVar[str] = "approach"
    unit: ClassVar[str] = "1"
    subject: ClassVar[str] = "tool"
    order: ClassVar[int] = 0
    key: ClassVar[None] = None
    robot_key: ClassVar[None] = None
    promised: ClassVar[bool] = True

    def items(self, scene: Described) -> Sequence[Numbers]:
        if not scene.columns:
            return []
        start, goal = scene.columns
        level = max(start.level, goal.level)
        ends = [point[0] for point in scene.given_points]
        size = min(end - column.level for end, column in zip(ends, scene.columns, strict=True))
        return [(*_circle(start), *_circle(goal), level, _ANYWHERE, size)]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.at_most(SX.ones(2))

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return self.rows(motion, numbers)

    def rows(self, motion: Instant, numbers: SX) -> SX:
        n, x = numbers, motion.x
        first, second = (
            ((x[1] - n[i]) ** 2 + (x[2] - n[i + 1]) ** 2) / n[i + 2] ** 2 for i in (0, 3)
        )
        above, imposed = (1 + (x[0] - n[i]) / n[8] for i in (6, 7))
        nearer = ca.if_else(second < first, second, first)
        return ca.vertcat(ca.if_else(above < nearer, above, nearer), imposed)


def _circle(column: Column) -> Numbers:
    return column.y, column.z, column.radius


def numbers_in_phases(numbers: Array) -> tuple[Array, Array, Array]:
    """The numbers of the limit in the three phases, from those of a scene, (9,)."""
    start, goal, (level, _, size) = numbers[:3], numbers[3:6], numbers[6:]
    everywhere = [0.0, 0.0, _ANYWHERE]
    below = [-_ANYWHERE, _ANYWHERE, size]
    return (
        np.concatenate([start, start, below]),
        np.concatenate([everywhere, everywhere, [-_ANYWHERE, level, size]]),
        np.concatenate([goal, goal, below]),
    )
