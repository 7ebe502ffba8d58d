"""Checks of the settings of a plan: a wrong one is told in a sentence that names it."""

from __future__ import annotations

from math import inf
from numbers import Integral, Real
from sys import float_info
from types import UnionType

import numpy as np

from deltaopt.errors import shown

MOST, MOST_INTERVALS = 9999, 1000
"""Most first guesses, and most intervals of a first mesh. Hardly a second is taken for each guess,
which is said, and a tenth of it for each interval by Ipopt: beyond, a plan takes hours."""
TOLERANCES = 1e-9, 1.0
"""Least optimality gap that may be asked for, and largest: by less a verified motion may exceed its
limits, and a motion of twice the least duration says nothing of it."""
RESOLVED_BELOW = 1e-4
"""Tolerance of the optimality gap below which the instants of switching become unknowns of their
own. It trades the cost of switch resolution against that of fine meshes, which grows steeply as
the tolerance falls."""


def require_positive(
    name: str, value: object, least: float = 0.0, most: float = float_info.max
) -> None:
    """Raise TypeError unless a setting is a number, ValueError unless it is finite, above 0, at
    least as large as the least, and at most as large as the most."""
    if not isinstance(value, Real) or isinstance(value, bool):
        raise TypeError(f"{name} is {shown(value)}; it must be a number greater than 0")
    if not value > 0:  # type: ignore[operator]  # numbers compare
        raise ValueError(f"{name} is {shown(value)}; it must be greater than 0")
    if value > float_info.max:  # type: ignore[operator]
        raise ValueError(f"{name} is {shown(value)}; it must be finite")
    if value < least:
        raise ValueError(f"{name} is {shown(value)}; it must be at least {least:g}")
    if value > most:  # type: ignore[operator]
        raise ValueError(f"{name} is {shown(value)}; it must be at most {most:g}")


def require_whole(
    name: str, value: object, least: int, purpose: str = "", most: float = inf
) -> None:
    """Raise TypeError unless a setting is a whole number, ValueError if it is below the least or
    above the most.

    ``purpose``: what the least is needed for, in words such as "to stop again".
    """
    if not isinstance(value, Integral) or isinstance(value, bool):
        raise TypeError(f"{name} is {shown(value)}; it must be a whole number of at least {least}")
    if value < least:
        needed = f"at least {least} {purpose}".rstrip()
        raise ValueError(f"{name} is {shown(value)}; it must be {needed}")
    if value > most:  # type: ignore[operator]
        raise ValueError(f"{name} is {shown(value)}; it must be at most {most}")


def require_type(name: str, value: object, kind: type | UnionType, expected: str) -> None:
    """Raise TypeError unless a setting is a value of a kind.

    ``expected``: values of that kind, in words.
    """
    if isinstance(value, type) or not isinstance(value, kind):
        raise TypeError(f"{name} is {shown(value)}; it must be {expected}")


def holds_numbers(values: object) -> bool:
    """Whether an array has real numbers, and all of them: no mask, none masked or complex."""
    return not isinstance(values, np.ma.MaskedArray) and np.asarray(values).dtype.kind not in "bc"
