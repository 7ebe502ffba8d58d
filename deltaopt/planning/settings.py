"""Checks of the settings of a plan: a wrong one is told in a sentence that names it."""

from __future__ import annotations

from math import isfinite
from numbers import Integral, Real
from types import UnionType


def require_positive(name: str, value: object) -> None:
    """Raise TypeError unless a setting is a number, ValueError unless it is finite and above 0."""
    if not isinstance(value, Real):
        raise TypeError(f"{name} is {value!r}; it must be a number greater than 0")
    number = float(value)
    if not number > 0:
        raise ValueError(f"{name} is {value}; it must be greater than 0")
    if not isfinite(number):
        raise ValueError(f"{name} is {value}; it must be finite")


def require_whole(name: str, value: object, least: int, purpose: str = "") -> None:
    """Raise TypeError unless a setting is a whole number, ValueError if it is below the least.

    ``purpose``: what the least is needed for, in words such as "to stop again".
    """
    if not isinstance(value, Integral):
        raise TypeError(f"{name} is {value!r}; it must be a whole number of at least {least}")
    if value < least:
        needed = f"at least {least} {purpose}".rstrip()
        raise ValueError(f"{name} is {value}; it must be {needed}")


def require_type(name: str, value: object, kind: type | UnionType, expected: str) -> None:
    """Raise TypeError unless a setting is a value of a kind.

    ``expected``: values of that kind, in words.
    """
    if isinstance(value, type) or not isinstance(value, kind):
        raise TypeError(f"{name} is {value!r}; it must be {expected}")
