"""Units: numbers of a robot or scene that are written as text with a unit, such as "350 mm".

A field says what quantity it is by a mark on its type, ``Annotated[Positive, LENGTH]``; the mark
turns text into a number in SI units, alone or in lists, before anything else looks at it. Bare
numbers are in SI units and pass as they are. Angles have a dimension of their own here, so that
"6000 1/min" is no angular speed: read as rad/s it would be wrong by 2π.

Pint, which knows how units combine, is imported when the first unit is met: that takes half a
second or more, and files without units need not wait for it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from typing import Any

from pydantic import BeforeValidator

_DEFINITIONS = """
micro- = 1e-6 = µ- = μ- = u-
milli- = 1e-3 = m-
centi- = 1e-2 = c-
deci- = 1e-1 = d-
kilo- = 1e3 = k-
mega- = 1e6 = M-

metre = [length] = m = meter
gram = [mass] = g
second = [time] = s = sec
radian = [angle] = rad

percent = 0.01
tonne = 1000 * kilogram = t
pound = 0.45359237 * kilogram = lb
ounce = pound / 16 = oz
inch = 2.54 * centimetre = in
foot = 12 * inch = ft
minute = 60 * second = min
hour = 60 * minute = h
standard_gravity = 9.80665 * metre / second ** 2 = g_n
newton = kilogram * metre / second ** 2 = N
kilogram_force = kilogram * standard_gravity = kgf = kilopond = kp
pound_force = pound * standard_gravity = lbf
ounce_force = ounce * standard_gravity = ozf
joule = newton * metre = J
watt = joule / second = W
newton_metre = newton * metre = Nm
newton_centimetre = newton * centimetre = Ncm
newton_metre_second = newton * metre * second = Nms
turn = 6.283185307179586476925286766559 * radian = _ = rev = revolution
degree = turn / 360 = deg
gradian = turn / 400 = grad = gon
revolutions_per_minute = turn / minute = rpm
revolutions_per_second = turn / second = rps
"""
"""Every unit that is understood, in pint's notation; most take the prefixes above. A list of our
own, since in pint's the radian is the number 1, and Nm a unit of yarn."""

_NUMBER = re.compile(r"([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,3})?)(.*)", re.DOTALL)
_POWER = r"(?:[^\W\d_]+(?:_[^\W\d_]+)*(?:\*\*-?[1-9])?)"
_FACTOR = rf"(?:{_POWER}|\({_POWER}(?:[*/]{_POWER})*\)(?:\*\*-?[1-9])?)"
_UNIT = re.compile(rf"(?:1/)?{_FACTOR}(?:[*/]{_FACTOR})*")
"""Names, their small powers, and products and quotients of them: all that pint is given to read."""
_LONGEST = 60
"""Longest text that is read as a quantity, characters: "2.2000000000 kg*cm^2" has 20."""
_SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


class WrongUnit(ValueError):
    """A text ``text`` has no unit of the quantity that is asked for, whose SI unit is ``unit``."""

    def __init__(self, text: str, unit: str) -> None:
        super().__init__(text, unit)
        self.text, self.unit = text, unit

    def __str__(self) -> str:
        return f"cannot be converted to {self.unit.replace('**', '^') or 'a number without unit'}"


@dataclass(frozen=True)
class Quantity:
    """A quantity: its SI ``unit``, and ``others`` that count as the same."""

    unit: str
    others: tuple[str, ...] = ()

    def in_si(self, value: Any) -> Any:
        """A value with every text in it, alone or in lists, turned into a number in SI units.

        Text that begins with no number stays, for the field's type to refuse. Raises WrongUnit.
        """
        if isinstance(value, list | tuple):
            return tuple(self.in_si(item) for item in value)
        return self._number(value) if isinstance(value, str) else value

    def _number(self, text: str) -> float | str:
        plain = " ".join(text.replace("\N{MINUS SIGN}", "-").split())
        found = _NUMBER.fullmatch(plain) if len(plain) <= _LONGEST else None
        if found is None:
            return text
        number, unit = Decimal(found[1]), found[2].strip()
        if not unit:
            return float(number)
        factor = next(filter(None, (_factor(unit, si) for si in (self.unit, *self.others))), None)
        if factor is None:
            raise WrongUnit(text, self.unit)
        return float(number * factor)


def percentage(value: object) -> float | None:
    """A text such as "85 %" as a number, 0.85; None for everything else."""
    if not (isinstance(value, str) and value.rstrip().endswith("%")):
        return None
    try:
        share = _SHARE.in_si(value)
    except WrongUnit:
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
    """The units that are understood."""
    import pint

    registry: Any = pint.UnitRegistry(None, non_int_type=Decimal)
    registry.load_definitions(_DEFINITIONS.strip().splitlines())
    return registry


_SHARE = Quantity("")


def _mark(unit: str, *others: str) -> BeforeValidator:
    return BeforeValidator(Quantity(unit, others).in_si)


LENGTH = _mark("m")
MASS = _mark("kg")
DURATION = _mark("s")
ANGLE = _mark("rad")
SPEED = _mark("m/s")
ANGULAR_SPEED = _mark("rad/s")
ACCELERATION = _mark("m/s**2")
ANGULAR_ACCELERATION = _mark("rad/s**2")
INERTIA = _mark("kg*m**2")
TORQUE = _mark("N*m")
VISCOUS_FRICTION = _mark("N*m*s/rad", "N*m*s")
RATIO = _mark("")
"""A number without a unit, or in percent."""
EFFORT_WEIGHT = _mark("1/(N**2*m**2)")
