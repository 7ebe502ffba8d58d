"""Units: numbers of a robot or scene that are written as text with a unit, such as "350 mm".

A field says what quantity it is by a mark on its type, ``Annotated[Positive, LENGTH]``; the mark
turns text into a number in SI units, alone or in lists, before anything else looks at it. Bare
numbers are in SI units. Each quantity has a size that nothing at a Delta robot exceeds: 350 for the
length of an arm is a number of a datasheet in millimetres. Angles have a dimension of their own
here, so that "6000 1/min" is no angular speed: read as rad/s it would be wrong by 2π.

Pint, which knows how units combine, is imported when the first unit is met: that takes half a
second or more, and files without units need not wait for it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from importlib.resources import files
from math import inf, pi
from sys import float_info
from typing import Any

from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema

_NUMBER = re.compile(r"([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?)(.*)", re.DOTALL)
_POWER = r"(?:[^\W\d_]+(?:_[^\W\d_]+)*(?:\*\*-?[1-9])?)"
_FACTOR = rf"(?:{_POWER}|\({_POWER}(?:[*/]{_POWER})*\)(?:\*\*-?[1-9])?)"
_UNIT = re.compile(rf"(?:1/)?{_FACTOR}(?:[*/]{_FACTOR})*")
"""Names, their small powers, and products and quotients of them: all that pint is given to read."""
_LONGEST = 60
"""Longest text that is read as a quantity, characters: "2.2000000000 kg*cm^2" has 20."""
_SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


class Misread(ValueError):
    """A ``value`` is no such quantity as is asked for: ``problem`` says why, ``hint`` what to write
    instead, if that is known."""

    def __init__(self, value: object, problem: str, hint: str = "") -> None:
        super().__init__(value, problem, hint)
        self.value, self.problem, self.hint = value, problem, hint

    def __str__(self) -> str:
        return self.problem


@dataclass(frozen=True)
class Quantity:
    """A quantity: its SI ``unit``, and ``others`` that count as the same.

    ``words``: what a number of it is: "a length in m". ``most``: the largest size that one at a
    Delta robot or in its cell has, in the SI unit. ``datasheets``: units in which its
    numbers are often given; a larger one is probably in these.
    """

    unit: str
    words: str
    most: float = inf
    datasheets: tuple[str, ...] = ()
    others: tuple[str, ...] = ()

    def __get_pydantic_core_schema__(self, kind: Any, rest: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_before_validator_function(self.in_si, rest(kind))

    def in_si(self, value: Any) -> Any:
        """A value with every text in it, alone or in lists, turned into a number in SI units.

        Text that begins with no number stays, for the field's type to refuse. Raises Misread where
        a text has another unit, or a number is larger than any such quantity.
        """
        if isinstance(value, list | tuple):
            return tuple(self.in_si(item) for item in value)
        number = self._number(value) if isinstance(value, str) else value
        if isinstance(number, int | float) and self.most < abs(number) <= float_info.max:
            raise self._too_large(value, number)
        return number

    def _too_large(self, value: object, number: float) -> Misread:
        """What is wrong with a value that is a number of this size in the SI unit."""
        plausible = f"where at most {self.most:.4g} is plausible"
        problem = f"would be {number:.6g} {self.unit}, {plausible}"
        problem = problem if self.unit else f"is too large, {plausible}"
        return Misread(value, problem, "" if isinstance(value, str) else self._meant(number))

    def _meant(self, number: float) -> str:
        """In which of the units of datasheets a bare number makes sense."""
        for unit in self.datasheets:
            read = self._number(f"{float(number)!r} {unit}")
            if isinstance(read, float) and abs(read) <= self.most:
                return f"; {unit} need a unit: {number:.6g} {unit}"
        return ""

    def _number(self, text: str) -> float | str:
        found = _read(text)
        if found is None:
            return text
        number, unit = Decimal(found[1]), found[2].strip()
        if not unit:
            return float(number)
        factor = next(filter(None, (_factor(unit, si) for si in (self.unit, *self.others))), None)
        if factor is None:
            expected = self.unit or "a number without unit"
            raise Misread(text, f"cannot be converted to {expected}")
        return float(number * factor)


def _read(text: str) -> re.Match[str] | None:
    """The number that a text begins with, and what follows it."""
    plain = " ".join(text.replace("\N{MINUS SIGN}", "-").split())
    return _NUMBER.fullmatch(plain) if len(plain) <= _LONGEST else None


def begins_with_number(text: str) -> bool:
    """Whether a text is read as a number with a unit or without one."""
    return _read(text) is not None


def percentage(value: object) -> float | None:
    """A text such as "85 %" as a number, 0.85; None for everything else."""
    if not (isinstance(value, str) and value.rstrip().endswith("%")):
        return None
    try:
        share = RATIO.in_si(value)
    except Misread:
        return None
    return share if isinstance(share, float) else None


@lru_cache(maxsize=256)
def _factor(unit: str, si: str) -> Decimal | None:
    """What one of a unit is in the SI unit ``si``; None if it is none or another quantity."""
    written = _in_pints_notation(unit)
    if not _UNIT.fullmatch(written):
        return None
    import pint

    units = _registry()
    try:
        return Decimal(units.Quantity(Decimal(1), units.parse_units(written)).m_as(si))
    except pint.PintError:  # no such unit, or of another quantity
        return None


def _in_pints_notation(unit: str) -> str:
    """A unit with powers by ** and products by *: "kg cm²" is kg*cm**2."""
    unit = re.sub(r"([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda found: "^" + found[1].translate(_SUPERSCRIPTS), unit)
    unit = re.sub(r"[·⋅×•]", "*", unit).replace("**", "^")
    unit = unit.replace("%", " percent").replace("°", " deg").strip()
    unit = re.sub(r"\b(k?g)(c?m)\b", r"\1*\2", unit)  # kgcm², as catalogues write it
    unit = re.sub(r" *([*/^(]) *", r"\1", unit)
    return unit.replace(" ", "*").replace("^", "**")


@lru_cache(maxsize=1)
def _registry() -> Any:
    """The units that are understood, those of units.txt."""
    import pint

    registry: Any = pint.UnitRegistry(None, non_int_type=Decimal)
    text = (files("deltaopt.files") / "units.txt").read_text(encoding="utf-8")
    registry.load_definitions(text.splitlines())
    return registry


LENGTH = Quantity("m", "a length in m", 10.0, ("mm",))
WIDTH = Quantity("m", "a length in m", 1.0, ("mm",))
"""How wide a part of a robot, a gap or a rounding is."""
EXTENT = Quantity("m", "a length in m", 100.0, ("mm",))
"""Where a body ends, which may be drawn far larger than the cell."""
MASS = Quantity("kg", "a mass in kg", 200.0, ("g",))
SMALL_MASS = Quantity("kg", "a mass in kg", 20.0, ("g",))
"""Of pins and the like."""
DURATION = Quantity("s", "a duration in s", 1e3, ("ms",))
ANGLE = Quantity("rad", "an angle in rad", 4 * pi, ("deg",))
SPEED = Quantity("m/s", "a speed in m/s", 100.0, ("mm/s",))
ANGULAR_SPEED = Quantity("rad/s", "an angular speed in rad/s", 700.0, ("deg/s", "rpm"))
"""Of a gripper or an arm, which may be at a motor's shaft, without a gear."""
MOTOR_SPEED = Quantity("rad/s", "an angular speed in rad/s", 2500.0, ("rpm",))
ACCELERATION = Quantity("m/s^2", "an acceleration in m/s²", 1e4, ("mm/s^2",))
GRAVITY = Quantity("m/s^2", "an acceleration in m/s²", 100.0, ("mm/s^2",))
ANGULAR_ACCELERATION = Quantity("rad/s^2", "an angular acceleration in rad/s²", 1e4, ("deg/s^2",))
INERTIA = Quantity("kg*m^2", "a moment of inertia in kg·m²", 50.0, ("kg*cm^2", "g*cm^2"))
ROTOR_INERTIA = Quantity("kg*m^2", "a moment of inertia in kg·m²", 2.0, ("kg*cm^2", "g*cm^2"))
"""Of a motor, a brake or a gear at the motor's side."""
TORQUE = Quantity("N*m", "a torque in N·m", 5000.0, ("N*mm",))
MOTOR_TORQUE = Quantity("N*m", "a torque in N·m", 500.0, ("N*mm",))
TORQUE_RATE = Quantity("N*m/s", "a rate of torque in N·m/s", 1e8, ("N*mm/s",))
FORCE_PER_MASS = Quantity("m/s^2", "a specific force in m/s²", 1e4, ("mm/s^2",))
JERK = Quantity("m/s^3", "a jerk in m/s³", 1e7, ("mm/s^3",))
ANGULAR_JERK = Quantity("rad/s^3", "an angular jerk in rad/s³", 1e8, ("deg/s^3",))
VISCOUS_FRICTION = Quantity(
    "N*m*s/rad", "a friction in N·m·s/rad", 1e4, ("N*mm*s/rad",), others=("N*m*s",)
)
RATIO = Quantity("", "a number")
"""A number without a unit, or in percent."""
VOLUME_OF_DIRECTIONS = Quantity("", "a distance without unit")
"""That three unit vectors span, which is 0 where they lie in a plane."""
EFFICIENCY = Quantity("", "a number", 1.0, ("%",))
EFFORT_WEIGHT = Quantity("1/(N^2*m^2)", "a weight of the effort in 1/(N²m²)")
JERK_WEIGHT = Quantity("s^6/m^2", "a weight of the squared jerk in s⁶/m²")
TORQUE_RATE_WEIGHT = Quantity("s^2/(N^2*m^2)", "a weight of the squared torque rates in s²/(N²m²)")
