"""x_least ≤ x ≤ x_most and √(y² + z²) ≤ r: where the robot's maker or its cell lets the tool be.

Approach: where a scene lets it be, within a vertical cylinder about start and goal, and above a
height between the two. Which of these holds depends on the phase of the motion: from the start to
its height, from there to the goal's height, and down to the goal. Phases differ in the limit's
numbers alone, so that one compiled function serves all. For a place of which the phase is not known
the limit is that it is in one of the three regions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import casadi as ca
import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.limits.limit import (
    SX,
    Along,
    Bounds,
    Column,
    Described,
    Instant,
    Numbers,
    PhasedLimit,
)
from deltaopt.limits.norms_and_ranges import Norm, Range

_ANYWHERE = 1e3
"""Radius of a cylinder and depth of a level, m, that no robot reaches: no limit."""

_FAR_ABOVE = -0.5
"""The least value of the row of heights: lower ones would look like a lower bound that is met."""


class _Depth(Range):
    def measure(self, motion: Instant, numbers: SX) -> SX:
        return super().measure(motion, numbers)[0]


class _FromAxis(Norm):
    def vector(self, motion: Instant, numbers: SX) -> SX:
        return super().vector(motion, numbers)[1:]


WORKSPACE_DEPTH = _Depth("workspace depth", "m", "tool", "x", "workspace.depth")
"""Least and largest depth of the tool's point below the base."""
WORKSPACE_RADIUS = _FromAxis("workspace radius", "m", "tool", 0, "x", robot_key="workspace.radius")
"""Largest distance of the tool's point from the base's axis."""


class ApproachLimit(PhasedLimit):
    """Two rows. The first: the squared distance from the axis over the squared radius, in the outer
    phases. The second: how far below the level the tool is, in the middle phase.

    Numbers: axis and radius of two cylinders, the level above which a place in neither may be, the
    level that is imposed, and the natural size of heights.
    """

    name, unit, subject, order = "approach", "1", "tool", 0

    def items(self, scene: Described) -> Sequence[Numbers]:
        if not scene.columns:
            return []
        start, goal = scene.columns
        level = max(start.level, goal.level)
        ends = [point[0] for point in scene.placed_points]
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
        # Far above the level, or without one, the row is no negative share of it.
        return ca.vertcat(
            ca.if_else(above < nearer, above, nearer),
            ca.if_else(imposed > _FAR_ABOVE, imposed, _FAR_ABOVE),
        )

    def numbers_in_phases(self, numbers: Array) -> Sequence[Array]:
        """Up from the start, between, and down to the goal: (9,) each."""
        start, goal, (level, _, size) = numbers[:3], numbers[3:6], numbers[6:]
        everywhere = [0.0, 0.0, _ANYWHERE]
        below = [-_ANYWHERE, _ANYWHERE, size]
        return (
            np.concatenate([start, start, below]),
            np.concatenate([everywhere, everywhere, [-_ANYWHERE, level, size]]),
            np.concatenate([goal, goal, below]),
        )

    def along(self, position: Iterable[Along], numbers: Array) -> tuple[Along, ...]:
        """Both rows in one phase, where there is but one cylinder."""
        (x, y, z), n = position, numbers.tolist()
        return ((y - n[0]) ** 2 + (z - n[1]) ** 2) / n[2] ** 2, 1 + (x - n[7]) / n[8]


def _circle(column: Column) -> Numbers:
    return column.y, column.z, column.radius
