"""‖ẍ − g‖ ≤ f_max: what a suction cup or gripper must hold, per mass of the payload.

It is the force between platform and payload over the payload's mass, what an accelerometer on the
platform reads: the acceleration of gravity at rest, none in free fall.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Annotated, ClassVar

import casadi as ca

from deltaopt.errors import SceneError
from deltaopt.files.units import ACCELERATION
from deltaopt.files.validated_record import Positive
from deltaopt.limits.limit import SX, Bounds, Described, Instant, Key, Limit, Numbers


@dataclass(frozen=True)
class SpecificForce(Limit):
    """Largest force on the payload over its mass, in any direction, Euclidean norm, m/s²."""

    name: ClassVar[str] = "specific force"
    unit: ClassVar[str] = "m/s²"
    subject: ClassVar[str] = "payload"
    order: ClassVar[int] = 2
    key: ClassVar[Key] = Key(
        "specific_force",
        Annotated[Positive, ACCELERATION],
        "a specific force in m/s², greater than 0",
    )

    def items(self, scene: Described) -> Sequence[Numbers]:
        """f_max, and the acceleration of gravity in the base frame, 3, all in m/s²."""
        given = scene.given(self.key.name)
        if given is None:
            return []
        gravity = scene.robot.gravity_vector
        at_rest = hypot(*gravity)
        if given <= at_rest:
            least = f"more than {at_rest:g} m/s², the specific force at rest"
            raise SceneError(None, f"limits.{self.key.name}", given, least)
        return [(given, *gravity)]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.at_most(numbers[0], out_of_reach=True)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return ca.norm_2(motion.a - numbers[1:])

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return ca.sumsqr(motion.a - numbers[1:]) / numbers[0] ** 2  # smooth in free fall too
