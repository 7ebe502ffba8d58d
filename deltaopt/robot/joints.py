"""The joints of a robot: how its controller counts the arms' angles, and their ranges.

With a sign σ, 1 or -1, and a zero θ₀ of each motor,

    θ = σ · (the controller's angle) - θ₀

and so σ alone relates speeds, accelerations and torques: power, torque times speed, is the same
number on both sides. Plans and their files are in the model's angles; what goes to a controller or
comes from one passes here.
"""

from __future__ import annotations

from math import pi
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator, Field

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError
from deltaopt.files.units import ANGLE
from deltaopt.files.validated_record import Number, Record, Triple, optional


def _one(value: float) -> float:
    if abs(value) != 1:
        raise ValueError
    return value


Sign = Annotated[Number, AfterValidator(_one)]
"""1 or -1."""


class Joints(Record):
    """The zero, sign and range of the arms' angles, and the range of the ball joints.

    ``zero`` in rad and ``sign``, 1 or -1, are one for all motors or three: the model's angle θ is
    sign · (the controller's angle) - zero. ``arm``: [least, largest] θ in rad, of the model.
    ``ball``: the largest angle of the forearms to the planes of their arms, abs(q_{k,3}), in rad.
    None where there is no such limit, a zero of 0 or a sign of 1.
    """

    zero: Annotated[Number | Triple, ANGLE] | None = optional("one angle in rad or three")
    sign: Sign | tuple[Sign, Sign, Sign] | None = optional("1 or -1, or three of them")
    arm: Annotated[tuple[Number, Number], ANGLE] | None = optional(
        "two angles [least, largest] in rad, the first the lesser"
    )
    ball: Annotated[Number, Field(gt=0, lt=pi / 2), ANGLE] | None = optional(
        "an angle in rad, greater than 0 and less than π/2"
    )

    def require_consistent(self) -> None:
        if self.arm is not None and self.arm[0] >= self.arm[1]:
            expected = str(type(self).model_fields["arm"].description)
            raise SceneError(None, "arm", self.arm, expected)

    @property
    def zeros(self) -> Array:
        """θ₀ of each motor, (3,), rad."""
        return np.broadcast_to(0.0 if self.zero is None else self.zero, 3).astype(float)

    @property
    def signs(self) -> Array:
        """σ of each motor, (3,)."""
        return np.broadcast_to(1.0 if self.sign is None else self.sign, 3).astype(float)

    def angle_to_controller(self, theta: ArrayLike) -> Array:
        """The controller's angles of the model's, (N, 3), rad."""
        return np.asarray(self.signs * (np.asarray(theta, dtype=float) + self.zeros))

    def angle_from_controller(self, angle: ArrayLike) -> Array:
        """The model's angles of the controller's, (N, 3), rad."""
        return np.asarray(self.signs * np.asarray(angle, dtype=float) - self.zeros)

    def rate_to_controller(self, rate: ArrayLike) -> Array:
        """The controller's speeds, accelerations or torques of the model's, (N, 3)."""
        return np.asarray(self.signs * np.asarray(rate, dtype=float))

    def rate_from_controller(self, rate: ArrayLike) -> Array:
        """The model's speeds, accelerations or torques of the controller's, (N, 3)."""
        return self.rate_to_controller(rate)  # a sign is its own inverse


def controller_angles_in_words(joints: Joints | None) -> list[str]:
    """How the controller counts angles, where not as the model does; in degrees, in which a zero
    that lacks its unit is seen."""
    if joints is None or not (joints.zeros.any() or (joints.signs < 0).any()):
        return []
    at_zero = np.rad2deg(joints.angle_from_controller(0.0)) + 0.0  # of -0.0 too
    values = ", ".join(f"{each:.6g}" for each in at_zero)
    turned = [f"{index}" for index, sign in enumerate(joints.signs, 1) if sign < 0]
    counted = f"; it counts downwards: motor {', '.join(turned)}" if turned else ""
    return [f"where the controller's are 0 the model's are {values} degrees{counted}"]
