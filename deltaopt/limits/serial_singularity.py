"""sin² (q_{k,1} - q_{k,2}) ≥ a margin: how far each chain stays from folded or stretched.

There, in the serial (type-1) singularity, the platform's position no longer says where the elbow
is, and the torque for a given acceleration grows without bound. A motion that touches it may be
faster, of random moves by up to 1 %, but the platform's coordinates cannot describe it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from deltaopt.limits.limit import SX, Bounds, Described, Instant, Numbers
from deltaopt.robot.model import delta_model

USUAL_MARGIN = 0.1**2
"""Six degrees from folded or stretched: more keeps motions away from what is fast, less brings
torques that are known to fewer digits."""


def margin(at_ends: float) -> float:
    """The margin for a motion whose ends are so far from the singularity: half of that at most."""
    return min(USUAL_MARGIN, at_ends / 2)


@dataclass(frozen=True)
class SerialSingularity:
    """Least sin² of the angle between arm and bars of each chain."""

    name: ClassVar[str] = "distance to the serial singularity"
    unit: ClassVar[str] = "1"
    subject: ClassVar[str] = "chain"
    order: ClassVar[int] = 0
    key: ClassVar[None] = None
    robot_key: ClassVar[None] = None
    promised: ClassVar[bool] = False

    def items(self, scene: Described) -> Sequence[Numbers]:
        model = delta_model(scene.robot, scene.payload)
        alignments = model.alignments(np.array(scene.placed_points))
        return [(margin(float(alignments.min())),)]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.at_least(numbers, 1.0, out_of_reach=True)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.alignment

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return self.bounds(numbers).normalised(self.measure(motion, numbers))
