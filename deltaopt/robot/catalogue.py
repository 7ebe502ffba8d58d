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
from typing import Annotated

import numpy as np
from pydantic import Field

from deltaopt.errors import SceneError
from deltaopt.files.units import EFFICIENCY, MOTOR_SPEED, MOTOR_TORQUE, RATIO, ROTOR_INERTIA, TORQUE
from deltaopt.files.validated_record import NonNegative, Positive, Record, optional

Curve = tuple[tuple[float, float], ...]
"""Points (speed, torque) of a torque curve, in rad/s and N·m, straight between them."""
CurvePoints = tuple[tuple[Annotated[NonNegative, MOTOR_SPEED], Annotated[NonNegative, TORQUE]], ...]
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

    peak_torque: Annotated[Positive, MOTOR_TORQUE]
    rated_torque: Annotated[Positive, MOTOR_TORQUE] | None = optional(
        "a torque in N·m, greater than 0, at most the peak torque"
    )
    max_speed: Annotated[Positive, MOTOR_SPEED] | None = None
    inertia: Annotated[NonNegative, ROTOR_INERTIA] | None = None
    curve: CurvePoints | None = optional(CURVE)

    def require_consistent(self) -> None:
        _require_at_most_peak("rated_torque", self.rated_torque, self.peak_torque)
        if self.curve is not None:
            require_torque_curve(self.curve, self.peak_torque, "curve")


class Brake(Record):
    """A holding brake at the motor: ``inertia`` in kg·m²."""

    inertia: Annotated[NonNegative, ROTOR_INERTIA]


class Gear(Record):
    """A gear: ``ratio`` of the motor's speed to the arm's, ``efficiency`` when it drives the arm.

    ``inertia``: at the motor's side, kg·m². ``peak_torque``, ``nominal_torque``: at the arm, N·m,
    the latter for the speed-weighted cubic mean. ``input_speed``: the largest of the motor, rad/s.
    """

    ratio: Annotated[Positive, RATIO] = Field(
        description="a number greater than 0, motor's speed over arm's"
    )
    efficiency: Annotated[Positive, Field(le=1), EFFICIENCY] = Field(
        default=1.0, description="a number greater than 0 and at most 1"
    )
    inertia: Annotated[NonNegative, ROTOR_INERTIA] | None = optional(
        "a moment of inertia in kg·m² at the motor's side, at least 0"
    )
    peak_torque: Annotated[Positive, TORQUE] | None = optional(
        "a torque in N·m at the arm, greater than 0"
    )
    nominal_torque: Annotated[Positive, TORQUE] | None = optional(
        "a torque in N·m at the arm, greater than 0, at most the peak torque"
    )
    input_speed: Annotated[Positive, MOTOR_SPEED] | None = optional(
        "an angular speed in rad/s at the motor, greater than 0"
    )

    def require_consistent(self) -> None:
        _require_at_most_peak("nominal_torque", self.nominal_torque, self.peak_torque)


@dataclass(frozen=True)
class Part:
    """What one part of a drive makes of a quantity at the arm: ``part``, the motor for example, the
    ``value``, and the ``calculation`` that gives it."""

    part: str
    value: float
    calculation: str


@dataclass(frozen=True)
class Reduction:
    """A quantity at the arm, its ``name`` and ``unit``, and what each part makes of it.

    ``total``: whether the parts add up; otherwise the least of them counts.
    """

    name: str
    unit: str
    parts: tuple[Part, ...]
    total: bool = False

    @property
    def value(self) -> float:
        """The quantity at the arm."""
        values = [part.value for part in self.parts]
        return sum(values) if self.total else min(values)

    @property
    def set_by(self) -> Part:
        """The part that sets it, or most of it."""
        ordered = sorted(self.parts, key=lambda part: part.value)
        return ordered[-1] if self.total else ordered[0]


def gain(gear: Gear | None) -> float:
    """Torque at the arm by torque of the motor that drives it, i η; 1 without a gear."""
    return gear.ratio * gear.efficiency if gear else 1.0


def reductions(motor: Motor, brake: Brake | None, gear: Gear | None) -> dict[str, Reduction]:
    """Torque, RMS torque, speed and inertia at the arm, as far as the catalogue names them."""
    drive, ratio = gear or Gear(ratio=1.0), gear.ratio if gear else 1.0
    by_gain = f" · {ratio:g} · {drive.efficiency:g}" if gear else ""
    by_ratio = f" / {ratio:g}" if gear else ""
    by_square = f" · {ratio:g}²" if gear else ""

    def torque(part: str, value: float) -> Part:
        return Part(part, value * gain(gear), f"{value:g} N·m{by_gain}")

    def speed(part: str, value: float | None) -> list[Part]:
        given = [] if value is None else [value]
        return [Part(part, w / ratio, f"{w:.6g} rad/s{by_ratio}") for w in given]

    torques = [torque("motor", motor.peak_torque)]
    if drive.peak_torque is not None:
        torques.append(Part("gear", drive.peak_torque, f"{drive.peak_torque:g} N·m"))
    rated = [] if motor.rated_torque is None else [torque("motor", motor.rated_torque)]
    speeds = speed("motor", motor.max_speed)
    speeds += speed("end of the motor's curve", motor.curve[-1][0] if motor.curve else None)
    speeds += speed("gear", drive.input_speed)
    named = (
        ("motor", motor.inertia),
        ("brake", brake.inertia if brake else None),
        ("gear", drive.inertia),
    )
    inertias = [
        Part(part, inertia * ratio**2, f"{inertia:g} kg·m²{by_square}")
        for part, inertia in named
        if inertia is not None
    ]
    found = (
        Reduction("torque", "N·m", tuple(torques)),
        Reduction("RMS torque", "N·m", tuple(rated)),
        Reduction("speed", "rad/s", tuple(speeds)),
        Reduction("inertia", "kg·m²", tuple(inertias), total=True),
    )
    return {each.name: each for each in found if each.parts}


def at_the_arm(
    motor: Motor, brake: Brake | None, gear: Gear | None
) -> dict[str, float | Curve | None]:
    """The keys of a drive that a motor, a brake and a gear give at the arm: torques in N·m, speed
    in rad/s, inertia in kg·m²; None for what is not limited, or not modelled.

    Without a gear the motor turns the arm.
    """
    values = {name: each.value for name, each in reductions(motor, brake, gear).items()}
    ratio = gear.ratio if gear else 1.0
    curve: Curve | None = None
    if motor.curve is not None:
        geared = [(w / ratio, torque * gain(gear)) for w, torque in motor.curve]
        curve = _cut(geared, values["speed"], values["torque"])
    return {
        "torque": values["torque"],
        "speed": values.get("speed"),
        "inertia": values.get("inertia"),
        "torque_curve": curve,
        "rms_torque": values.get("RMS torque"),
    }


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


def _require_at_most_peak(key: str, torque: float | None, peak: float | None) -> None:
    if torque is not None and peak is not None and torque > peak:
        raise SceneError(None, key, torque, f"at most the peak torque, {peak:g} N·m")
