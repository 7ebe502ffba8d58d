"""Relaxation: solve without what hardly ever matters, look at what was missed, and solve again."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

Asked = TypeVar("Asked")
Found = TypeVar("Found")


def until_nothing_is_missed(
    solve: Callable[[Asked], Found],
    with_missed: Callable[[Asked, Found], Asked | None],
    relaxed: Asked,
) -> tuple[Asked, Found]:
    """What was solved last, and its solution, which misses nothing.

    ``with_missed``: what to solve next, with all that a solution misses; None where it misses
    nothing. It must add something each time, or raise an error where that leads nowhere.
    """
    found = solve(relaxed)
    while (more := with_missed(relaxed, found)) is not None:
        relaxed = more
        found = solve(relaxed)
    return relaxed, found
