"""|volume of the bars' directions| ≥ a margin: the distance to the parallel singularity.

There, in the parallel (type-2) singularity, all bars lie in one plane: motor torques cannot balance
a force normal to it, and torques of a motion through it grow without bound. It divides the
workspace; a motion stays on the side where it starts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import casadi as ca

from deltaopt.errors import DeltaOptError
from deltaopt.files.units import RATIO
from deltaopt.files.validated_record import Positive
from deltaopt.limits.limit import SX, Bounds, Described, Instant, Key, Numbers
from deltaopt.mechanisms.delta.singularities import parallel_margin
from deltaopt.robot.model import delta_model


@dataclass(frozen=True)
class ParallelSingularity:
    """Least volume that unit vectors along the three bars span, 0 in the singularity, below 1."""

    name: ClassVar[str] = "distance to the parallel singularity"
    unit: ClassVar[str] = "1"
    subject: ClassVar[str] = "robot"
    order: ClassVar[int] = 0
    key: ClassVar[Key] = Key(
        "parallel_singularity",
        Annotated[Positive, RATIO],
        "a distance without unit, greater than 0 and below 1",
    )
    robot_key: ClassVar[None] = None
    promised: ClassVar[bool] = True

    def items(self, scene: Described) -> Sequence[Numbers]:
        """The margin, and the sign of the volume at the start."""
        given = scene.given(self.key.name)
        if given is None:
            return []
        try:
            q = delta_model(scene.robot, scene.payload).inverse_kinematics(scene.placed_points[0])
        except DeltaOptError:
            return [(given, 1.0)]  # what is wrong with the start is told when it is planned
        return [(given, 1.0 if float(ca.DM(parallel_margin(SX(ca.DM(q))))) > 0 else -1.0)]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.at_least(numbers[0], 1.0, out_of_reach=True)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return numbers[1] * parallel_margin(motion.q)

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return self.bounds(numbers).normalised(self.measure(motion, numbers))
