"""‖ẍ − g‖ ≤ f_max: what a suction cup or gripper must hold, per mass of the payload.

It is the force between platform and payload over the payload's mass, what an accelerometer on the
platform reads: the acceleration of gravity at rest, none in free fall.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import Annotated

from deltaopt.errors import SceneError
from deltaopt.files.units import ACCELERATION
from deltaopt.files.validated_record import Positive
from deltaopt.limits.limit import SX, Described, Instant, Key, Numbers
from deltaopt.limits.norms_and_ranges import Norm


def _felt(motion: Instant, numbers: SX) -> SX:
    return motion.a - numbers[1:]


class _SpecificForce(Norm):
    def items(self, scene: Described) -> Sequence[Numbers]:
        """f_max, and the acceleration of gravity in the base frame, 3, all in m/s²."""
        gravity = scene.robot.gravity_vector
        at_rest = hypot(*gravity)
        for (given,) in super().items(scene):
            if given <= at_rest:
                least = f"more than {at_rest:g} m/s², the specific force at rest"
                raise SceneError(None, f"limits.{_KEY.name}", given, least)
            return [(given, *gravity)]
        return []


_KEY = Key(
    "specific_force",
    Annotated[Positive, ACCELERATION],
    "a specific force in m/s², greater than 0",
)
SPECIFIC_FORCE = _SpecificForce("specific force", "m/s²", "payload", 2, _felt, (2, 4), _KEY)
"""Largest force on the payload over its mass, in any direction."""
