"""The largest speed at which several quantities of a slowed motion stay within their bounds.

A motion at s times its speed has, at an instant, excesses e(s) over the bounds of its limits: safe
speeds are those where none is positive. They need not form an interval: 0.1 + 4.5 s - 4.5 s² ≤ 1
holds at rest and at full speed and fails between. So the safe speeds of all excesses are
intersected, and the largest is taken.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from deltaopt.curves.piecewise import Array

Excesses = Callable[[Array], Array]
"""Speeds (S,) -> excesses (S, n), positive where a bound is exceeded."""

_TRIED, _SLOWEST = 400, 1e-6
"""How many speeds are tried where those are unsafe that are tried first, and the least. Safe speeds
between two tried ones, 3.5 % apart, may be missed: then the result is a lower safe speed."""
_NEARLY_ALL = 1 - np.append(0.0, 2.0 ** np.arange(-25.0, -1.0))
"""Shares of the largest speed that are tried first of all: most motions are to be slowed little."""
_ABOUT = np.concatenate([-(8.0 ** -np.arange(1.0, 17.0)), [0.0], 8.0 ** -np.arange(16.0, 0.0, -1)])
"""Where speeds are tried next, about the one that a line through both ends of an interval leads to,
as shares of the interval: ever closer to it, since it is nearly right once the interval is short.
"""


def largest_safe_speed(excesses: Excesses, most: float) -> float | None:
    """A safe speed, no more than ``most``, found by comparing ever closer ones, the largest unless
    safe speeds lie between two that are tried; None if none is found."""
    for speeds in (most * _NEARLY_ALL, most * np.geomspace(_NEARLY_ALL[-1], _SLOWEST, _TRIED)):
        found = _largest_of(excesses, speeds)
        if found is not None:
            return found
    return None


def _largest_of(excesses: Excesses, speeds: Array) -> float | None:
    """The largest safe speed of some, falling, or between it and the next faster one of them; None
    if none of them is safe."""
    while True:
        found = excesses(speeds)
        safe = np.flatnonzero((found <= 0).all(axis=1))
        if not len(safe):
            return None
        first = int(safe[0])
        if first == 0 or speeds[first] >= speeds[first - 1] * (1 - 1e-15):
            return float(speeds[first])
        fast, slow = float(speeds[first - 1]), float(speeds[first])
        towards = _along_lines(fast, slow, found[first - 1], found[first])
        among = np.clip(towards + (fast - slow) * _ABOUT, slow, fast)
        speeds = np.unique(np.concatenate([[fast, slow, (fast + slow) / 2], among]))[::-1]


def _along_lines(fast: float, slow: float, above: Array, below: Array) -> float:
    """The speed at which none is positive of lines through excesses at two speeds, (n,) each: at
    the faster one some are, at the slower one none."""
    rising = above > 0
    share = below[rising] / (below[rising] - above[rising])
    return slow + (fast - slow) * float(share.min(initial=1.0))
