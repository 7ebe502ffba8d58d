"""Motor, brake and gear as a catalogue gives them, and what they are at the arm.

With ratio i and efficiency η of the gear:

    torque      min(i η peak torque of the motor, peak torque of the gear)
    RMS torque  i η rated torque of the motor
    speed       min(largest speed of the motor, input speed of the gear) / i
    inertia     i² (motor + brake + gear)
    curve       each speed over i, each torque times i η, cut at the gear's peak torque and speed

A quantity that the catalogue does not name is absent at the arm too. Efficiency lowers what reaches
the arm; that losses help to brake is not credited.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from deltaopt.errors import SceneError
from deltaopt.files.units import ANGULAR_SPEED, INERTIA, RATIO, TORQUE
from deltaopt.files.validated_record import NonNegative, Positive, Record

Curve = tuple[tuple[float, float], ...]
"""Points (speed, torque) of a torque curve, in rad/s and N·m, straight between them."""
CurvePoints = tuple[
    tuple[Annotated[NonNegative, ANGULAR_SPEED], Annotated[NonNegative, TORQUE]], ...
]
"""A torque curve in a record; ``require_torque_curve`` says what makes it one."""

CURVE = (
    "two or more points [speed in rad/s, torque in N·m], the first at speed 0, whose speeds "
    "increase and whose torques do not, ever more steeply (concave), none above the peak torque"
)

_ROUNDING = 1e-9
"""Share by which a slope may exceed the one before it: points on a line, given with rounding."""


def require_torque_curve(curve: Curve, peak: float, key: str) -> None:
    """Raise SceneError, naming ``key``, unless torque falls with speed in a concave curve.

    ``peak``: the largest torque of the drive or motor, N·m, which no point exceeds.
    """
    speed, torque = np.array(curve, dtype=float).reshape(-1, 2).T
    if (
        len(speed) < 2
        or speed[0] != 0
        or not 0 < torque[0] <= peak * (1 + _ROUNDING)
        or np.any(np.diff(speed) <= 0)
        or np.any(np.diff(torque) > 0)
        or np.any(np.diff(slopes := np.diff(torque) / np.diff(speed)) > -_ROUNDING * slopes.min())
    ):
        raise SceneError(None, key, curve, CURVE)


class Motor(Record):
    """A motor: ``peak_torque`` and ``rated_torque`` in N·m, ``max_speed`` in rad/s.

    ``inertia``: of its rotor, kg·m². ``curve``: its torque by its speed when it drives. What is
    None is not limited, or not modelled.
    """

    peak_torque: Annotated[Positive, TORQUE] = Field(description="a torque in N·m, greater than 0")
    rated_torque: Annotated[Positive, TORQUE] | None = Field(
        default=None, description="a torque in N·m, greater than 0, at most the peak torque"
    )
    max_speed: Annotated[Positive, ANGULAR_SPEED] | None = Field(
        default=None, description="an angular speed in rad/s, greater than 0"
    )
    inertia: Annotated[NonNegative, INERTIA] | None = Field(
        default=None, description="a moment of inertia in kg·m², at least 0"
    )
    curve: CurvePoints | None = Field(default=None, description=CURVE)

    @model_validator(mode="after")
    def _torques_fit(self) -> Self:
        _require_at_most_peak(self, "rated_torque", self.rated_torque, self.peak_torque)
        if self.curve is not None:
            require_torque_curve(self.curve, self.peak_torque, "curve")
        return self


class Brake(Record):
    """A holding brake at the motor: ``inertia`` in kg·m²."""

    inertia: Annotated[NonNegative, INERTIA] = Field(
        description="a moment of inertia in kg·m², at least 0"
    )


class Gear(Record):
    """A gear: ``ratio`` of the motor's speed to the arm's, ``efficiency`` when it drives the arm.

    ``inertia``: at the motor's side, kg·m². ``peak_torque``, ``nominal_torque``: at the arm, N·m,
    the latter for the speed-weighted cubic mean. ``input_speed``: the largest of the motor, rad/s.
    """

    ratio: Annotated[Positive, RATIO] = Field(
        description="a number greater than 0, motor's speed over arm's"
    )
    efficiency: Annotated[Positive, Field(le=1), RATIO] = Field(
        default=1.0, description="a number greater than 0 and at most 1"
    )
    inertia: Annotated[NonNegative, INERTIA] | None = Field(
        default=None, description="a moment of inertia in kg·m² at the motor's side, at least 0"
    )
    peak_torque: Annotated[Positive, TORQUE] | None = Field(
        default=None, description="a torque in N·m at the arm, greater than 0"
    )
    nominal_torque: Annotated[Positive, TORQUE] | None = Field(
        default=None,
        description="a torque in N·m at the arm, greater than 0, at most the peak torque",
    )
    input_speed: Annotated[Positive, ANGULAR_SPEED] | None = Field(
        default=None, description="an angular speed in rad/s at the motor, greater than 0"
    )

    @model_validator(mode="after")
    def _torques_fit(self) -> Self:
        _require_at_most_peak(self, "nominal_torque", self.nominal_torque, self.peak_torque)
        return self


@dataclass(frozen=True)
class AtTheArm:
    """What motor, brake and gear are at the arm: torques in N·m, speed in rad/s, inertia in kg·m².

    What is None is not limited, or not modelled.
    """

    torque: float
    speed: float | None
    inertia: float | None
    torque_curve: Curve | None
    rms_torque: float | None


def at_the_arm(motor: Motor, brake: Brake | None, gear: Gear | None) -> AtTheArm:
    """Reduce a motor, a brake and a gear to the arm; without a gear the motor turns the arm."""
    gear = gear or Gear(ratio=1.0)
    gain = gear.ratio * gear.efficiency
    torque = _least(motor.peak_torque * gain, gear.peak_torque)
    end_of_curve = None if motor.curve is None else motor.curve[-1][0]
    speed = _least(motor.max_speed, end_of_curve, gear.input_speed)
    inertias = [part.inertia for part in (motor, brake, gear) if part and part.inertia is not None]
    assert torque is not None  # the motor's is always given
    at_arm = None if speed is None else speed / gear.ratio
    return AtTheArm(
        torque=torque,
        speed=at_arm,
        inertia=sum(inertias) * gear.ratio**2 if inertias else None,
        torque_curve=(
            None
            if motor.curve is None or at_arm is None
            else _cut([(w / gear.ratio, t * gain) for w, t in motor.curve], at_arm, torque)
        ),
        rms_torque=None if motor.rated_torque is None else motor.rated_torque * gain,
    )


def _cut(curve: list[tuple[float, float]], last: float, most: float) -> Curve:
    """A torque curve until the speed ``last``, with no torque above ``most``."""
    speed, torque = np.array(curve).T
    # Torque falls, so it passes ``most`` at one speed, where the cut ends, or at none.
    begin = float(np.interp(-most, -torque, speed)) if torque[0] > most else 0.0
    apart = _ROUNDING * last  # no two points so close that rounding decides on the slope
    inner = speed[(speed > begin + apart) & (speed < last - apart)]
    speeds = np.array([0.0, *([begin] if apart < begin < last - apart else []), *inner, last])
    torques = np.minimum(np.interp(speeds, speed, torque), most)
    return tuple(zip(speeds.tolist(), torques.tolist(), strict=True))


def _least(*values: float | None) -> float | None:
    """The least of the values that are given; None if none is."""
    return min((value for value in values if value is not None), default=None)


def _require_at_most_peak(
    record: Record, key: str, torque: float | None, peak: float | None
) -> None:
    if torque is not None and peak is not None and torque > peak:
        raise SceneError(None, key, torque, f"at most the peak torque, {peak:g} N·m")
