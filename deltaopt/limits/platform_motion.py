"""Euclidean norms of the platform's motion: ‖ẋ‖ ≤ v_max, ‖ẍ‖ ≤ a_max and ‖d³x/dt³‖ ≤ j_max, and
‖ẍ − g‖ ≤ f_max of what it carries.

How fast hoses, cameras, scales or people beside the robot let the platform be, what load, gripper
or product on it can stand, and what shakes the frame so that it rings. The last is what a suction
cup or gripper must hold, per mass of the payload: the force between platform and payload over the
payload's mass, what an accelerometer on the platform reads: the acceleration of gravity at rest,
none in free fall.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from typing import Annotated

from deltaopt.errors import SceneError
from deltaopt.files.units import ACCELERATION, FORCE_PER_MASS, JERK, SPEED
from deltaopt.files.validated_record import Positive
from deltaopt.limits.limit import SX, Described, Instant, Key, Numbers
from deltaopt.limits.norms_and_ranges import Norm


class _SpecificForce(Norm):
    def vector(self, motion: Instant, numbers: SX) -> SX:
        return super().vector(motion, numbers) - numbers[1:]

    def items(self, scene: Described) -> Sequence[Numbers]:
        """f_max, and the acceleration of gravity in the base frame, 3, all in m/s²."""
        gravity = scene.robot.gravity_vector
        at_rest = hypot(*gravity)
        for (given,) in super().items(scene):
            if given <= at_rest:
                least = f"more than {at_rest:g} m/s², the specific force at rest"
                raise SceneError(None, f"limits.{_SPECIFIC_FORCE.name}", given, least)
            return [(given, *gravity)]
        return []


_SPEED = Key("platform_speed", Annotated[Positive, SPEED])
_ACCELERATION = Key("acceleration", Annotated[Positive, ACCELERATION])
_SPECIFIC_FORCE = Key("specific_force", Annotated[Positive, FORCE_PER_MASS])
_JERK = Key("jerk", Annotated[Positive, JERK])
PLATFORM_SPEED = Norm("platform speed", "m/s", "platform", 1, "v", (2,), _SPEED)
"""Largest speed of the platform in any direction."""
PLATFORM_ACCELERATION = Norm(
    "acceleration", "m/s²", "platform", 2, "a", (4,), _ACCELERATION, out_of_reach=False
)
"""Largest acceleration of the platform in any direction."""
SPECIFIC_FORCE = _SpecificForce(
    "specific force", "m/s²", "payload", 2, "a", (2, 4), _SPECIFIC_FORCE
)
"""Largest force on the payload over its mass, in any direction."""
PLATFORM_JERK = Norm("jerk", "m/s³", "platform", 3, "j", (6,), _JERK, out_of_reach=False)
"""Largest jerk of the platform in any direction."""
