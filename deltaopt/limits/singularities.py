"""Distances to the singularities of the robot, which motions keep.

sin² (q_{k,1} - q_{k,2}) ≥ a margin: how far each chain stays from folded or stretched. There, in
the serial (type-1) singularity, the platform's position no longer says where the elbow is, and the
torque for a given acceleration grows without bound. A motion that touches it may be faster, of
random moves by up to 1 %, but the platform's coordinates cannot describe it.

|volume of the bars' directions| ≥ a margin: the distance to the parallel singularity. There, in the
parallel (type-2) singularity, all bars lie in one plane: motor torques cannot balance a force
normal to it, and torques of a motion through it grow without bound. It divides the workspace; a
motion stays on the side where it starts.

|volume of the parallelograms' normals| ≥ a margin: the distance to the tilt of the platform. There
the normals of all parallelograms lie in one plane: nothing but the bars' and joints' stiffness
keeps the platform from turning about the axis normal to that plane, and the forces of bars grow
without bound. Motor torques do not show it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import casadi as ca
import numpy as np

from deltaopt.errors import Unreachable
from deltaopt.files.units import VOLUME_OF_DIRECTIONS
from deltaopt.files.validated_record import Below1
from deltaopt.limits.limit import SX, Bounds, Described, Instant, Key, Limit, Numbers
from deltaopt.robot.model import model_of

USUAL_MARGIN = 0.1**2
"""Six degrees from folded or stretched: more keeps motions away from what is fast, less brings
torques that are known to fewer digits."""


def margin(at_ends: float) -> float:
    """The margin for a motion whose ends are so far from the singularity: half of that at most."""
    return min(USUAL_MARGIN, at_ends / 2)


class SerialSingularity(Limit):
    """Least sin² of the angle between arm and bars of each chain."""

    name, unit, subject, order = "distance to the serial singularity", "1", "chain", 0
    quantity = "alignment"
    promised = False

    def items(self, scene: Described) -> Sequence[Numbers]:
        model = model_of(scene.robot, scene.payload)
        alignments = model.alignments(np.array(scene.placed_points))
        return [(margin(float(alignments.min())),)]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.at_least(numbers, 1.0, out_of_reach=True)


@dataclass(frozen=True)
class KeptVolume(Limit):
    """Least volume that three unit vectors of the chains span, on the side where a motion starts:
    0 in the singularity, below 1. ``quantity``: which, an attribute of motions and of functions of
    a mechanism."""

    name: str
    quantity: str
    key: Key
    unit, subject, order = "1", "robot", 0

    def items(self, scene: Described) -> Sequence[Numbers]:
        """The margin, and the sign of the volume at the start."""
        given = scene.given(self.key.name)
        if given is None:
            return []
        try:
            model = model_of(scene.robot, scene.payload)
            q = model.inverse_kinematics(scene.placed_points[0])
        except Unreachable:
            return [(given, 1.0)]  # what is wrong with the start is told when it is planned
        volume = getattr(model.functions, self.quantity)(SX(ca.DM(q)))
        return [(given, 1.0 if float(ca.DM(volume)) > 0 else -1.0)]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.at_least(numbers[0], 1.0, out_of_reach=True)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return numbers[1] * super().measure(motion, numbers)


_Volume = Annotated[Below1, VOLUME_OF_DIRECTIONS]
PARALLEL_SINGULARITY = KeptVolume(
    "distance to the parallel singularity", "parallel_margin", Key("parallel_singularity", _Volume)
)
"""Least volume that unit vectors along the three bars span."""
TILT_SINGULARITY = KeptVolume(
    "distance to the tilt of the platform", "tilt_margin", Key("tilt_singularity", _Volume)
)
"""Least volume that the unit normals of the three parallelograms span."""
