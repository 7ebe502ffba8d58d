"""Shares of random trials, and how sure they are."""

from __future__ import annotations

from math import sqrt


def wilson(found: int, trials: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share."""
    z = 1.96
    middle = (found + z**2 / 2) / (trials + z**2)
    half = z / (trials + z**2) * sqrt(found * (trials - found) / trials + z**2 / 4)
    return max(middle - half, 0.0), min(middle + half, 1.0)
