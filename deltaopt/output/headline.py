"""What a plan is worth in a line: how long it takes, and how many picks a minute that permits."""

from __future__ import annotations

ASSUMPTION = "a pick is there and back; gripping and letting go take no time"
"""What the number of picks supposes."""


def headline(duration: float) -> str:
    """A duration in s, and how many picks a minute it permits at most."""
    seconds = f"{duration:.3f}" if duration >= 0.1 else f"{duration:.3g}"
    return f"{seconds} s, {picks_per_minute(duration)} picks per minute"


def picks_per_minute(duration: float) -> str:
    """60 s over twice the duration in s: there and back."""
    rate = 30 / duration
    return f"{rate:.0f}" if rate >= 10 else f"{rate:.2g}"
