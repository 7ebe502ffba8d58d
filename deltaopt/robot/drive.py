"""The drive of an arm: its torque, speed, inertia and friction, or the motor and gear it has."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import SerializerFunctionWrapHandler, model_serializer

from deltaopt.errors import SceneError
from deltaopt.files.units import ANGULAR_SPEED, INERTIA, TORQUE, TORQUE_RATE, VISCOUS_FRICTION
from deltaopt.files.validated_record import (
    NonNegative,
    PerMotor,
    Positive,
    Record,
    optional,
    per_motor,
)
from deltaopt.robot.catalogue import (
    CURVE,
    Brake,
    CurvePoints,
    Gear,
    Motor,
    at_the_arm,
    require_torque_curve,
)

_REDUCED = ("torque", "speed", "inertia", "torque_curve", "rms_torque")
"""Keys of a drive at the arm that follow from motor, brake and gear."""
_SIGN_CHANGES_WITHIN = 0.05
"""Speed of an arm, rad/s, about which Coulomb friction changes its sign: below a hundredth of what
arms reach, so that a narrower one hardly changes a plan, and wide enough for a reversal, at some
hundred rad/s², to last half a millisecond, a step of a controller."""


class Friction(Record):
    """The friction of a drive at its arm, at speed θ̇: viscous · θ̇ + coulomb · tanh(θ̇ / speed).

    ``viscous`` in N·m·s/rad, ``coulomb`` in N·m; None where that part is not modelled. ``speed``:
    in rad/s, within which Coulomb friction changes its sign, 0.05 unless it is given; with
    ``coulomb`` alone.
    """

    viscous: Annotated[NonNegative, VISCOUS_FRICTION] | None = None
    coulomb: Annotated[NonNegative, TORQUE] | None = None
    speed: Annotated[Positive, ANGULAR_SPEED] | None = optional(
        "an angular speed in rad/s, greater than 0, within which Coulomb friction "
        f"changes its sign: {_SIGN_CHANGES_WITHIN:g} unless given"
    )

    @classmethod
    def _read(cls, content: dict[str, Any]) -> dict[str, Any]:
        if content.get("coulomb") is None:
            return content
        given = content.get("speed")
        return {**content, "speed": _SIGN_CHANGES_WITHIN if given is None else given}

    def require_consistent(self) -> None:
        if self.viscous is None and self.coulomb is None:
            expected = "viscous (N·m·s/rad), coulomb (N·m) or both"
            raise SceneError(None, "", None, expected, "names no friction")
        if self.coulomb is None and self.speed is not None:
            raise SceneError(None, "speed", self.speed, "coulomb beside it, which it belongs to")


class Drive(Record):
    """The drive of an arm: largest ``torque`` in N·m and ``speed`` in rad/s, at the arm.

    Both, and ``rms_torque`` in N·m, are one number for all motors or three. ``inertia``: of rotor,
    brake and gear at the arm, kg·m². ``torque_curve``: points (speed, torque) that the torque falls
    along when it drives the arm, in rad/s and N·m; its last speed is a limit. ``torque_rate``: the
    largest, N·m/s at the arm. What is None is not limited, or not modelled.

    A ``motor``, with a ``brake`` and a ``gear`` if there are any, stands in place of ``torque`` and
    of those of the other numbers that follow from it. Friction is that at the arm in any case.
    """

    torque: Annotated[PerMotor, TORQUE]
    speed: Annotated[PerMotor, ANGULAR_SPEED] | None = None
    inertia: Annotated[NonNegative, INERTIA] | None = optional(
        "a moment of inertia in kg·m² at the arm, at least 0"
    )
    friction: Friction | None = optional("a mapping with some of the keys viscous, coulomb, speed")
    torque_curve: CurvePoints | None = optional(CURVE)
    rms_torque: Annotated[PerMotor, TORQUE] | None = None
    torque_rate: Annotated[PerMotor, TORQUE_RATE] | None = None
    motor: Motor | None = optional(
        "a mapping with the key peak_torque and, as far as known, rated_torque, "
        "max_speed, inertia, curve"
    )
    brake: Brake | None = optional("a mapping with the key inertia")
    gear: Gear | None = optional(
        "a mapping with the key ratio and, as far as known, efficiency, inertia, "
        "peak_torque, nominal_torque, input_speed"
    )

    @classmethod
    def _read(cls, content: dict[str, Any]) -> dict[str, Any]:
        given = {key for key, value in content.items() if value is not None}
        if "motor" not in given:
            for key in given & {"brake", "gear"}:
                problem = "is of no use without drive.motor"
                raise SceneError(None, key, content[key], "a motor beside it", problem)
            return content
        for key in _REDUCED:
            if key in given:
                expected = f"either {key} or motor, since it follows from motor, brake and gear"
                raise SceneError(None, key, content[key], expected, "is given beside motor")
        parts = {key: cls._valid(key, content.get(key)) for key in ("motor", "brake", "gear")}
        reduced = at_the_arm(**parts)
        for key, value in reduced.items():
            try:
                cls._valid(key, value)
            except SceneError as error:  # its parts are plausible
                problem = f"gives {key} at the arm that {error.problem}"
                expected = "its numbers in SI units, or with the unit they have in the catalogue"
                raise SceneError(None, "motor", value, expected, problem) from None
        return {**content, **parts, **reduced}

    def require_consistent(self) -> None:
        if self.torque_curve is not None:
            require_torque_curve(self.torque_curve, min(per_motor(self.torque)), "torque_curve")

    @model_serializer(mode="wrap")
    def _write_what_was_given(self, rest: SerializerFunctionWrapHandler) -> dict[str, object]:
        """The keys of a file: without the numbers that follow from a motor."""
        content: dict[str, object] = rest(self)
        if self.motor is None:
            return content
        return {key: value for key, value in content.items() if key not in _REDUCED}

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with other fields, all held against each other; see ``Record.model_copy``."""
        if self.motor is None and not {"motor", "brake", "gear"} & set(update or {}):
            return super().model_copy(update=update, deep=deep)
        return type(self).model_validate({**self.model_dump(), **(update or {})})
