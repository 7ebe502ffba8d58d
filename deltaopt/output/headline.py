"""What a plan is worth in a line: how long it takes, and how many picks a minute that permits."""

from __future__ import annotations

from deltaopt.scene.task import MovingEnds, Task

ASSUMPTION = "a pick is there and back; gripping and letting go take no time"
"""What the number of picks supposes."""


def headline(duration: float) -> str:
    """A duration in s, and how many picks a minute it permits at most."""
    return f"{_seconds(duration)}, {picks_per_minute(duration)} picks per minute"


def title(task: Task, duration: float) -> str:
    """The headline; the duration alone of a motion that cannot be driven there and back, because
    an end moves."""
    return _seconds(duration) if isinstance(task, MovingEnds) else headline(duration)


def assumption(task: Task) -> str:
    """What the title supposes; empty where it counts no picks."""
    return "" if isinstance(task, MovingEnds) else ASSUMPTION


def _seconds(duration: float) -> str:
    return f"{duration:.3f} s" if duration >= 0.1 else f"{duration:.3g} s"


def picks_per_minute(duration: float) -> str:
    """60 s over twice the duration in s: there and back."""
    rate = 30 / duration
    return f"{rate:.0f}" if rate >= 10 else f"{rate:.2g}"
