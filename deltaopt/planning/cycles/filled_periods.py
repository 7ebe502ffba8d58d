"""Cycles whose legs take all of a period, each with the least effort in its share of it.

No prices lead to legs that would be hotter in less time and in more: what legs cost at any prices
is less elsewhere. Their durations are given here instead.
"""

from __future__ import annotations

from deltaopt.curves.piecewise import Array
from deltaopt.errors import NO_PLAN, if_possible
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.cycles.priced_legs import USED_UP, PricedLegs
from deltaopt.scene.objective import Effort

_LONGER, _MOST = 1.15, 10
"""By what factor one period is longer than the one before, and how many there are at most."""


def filled_periods(
    sought: PricedLegs, shares: Array, shortest: float, longest: float
) -> list[CyclePlan]:
    """Cycles that wait no longer than they have to, whose legs have these ``shares`` of what is
    left, (legs,): in the given period, or in longer and longer ones between two, s, until motors
    stay cool. None where legs end moving."""
    cycle, found = sought.cycle, list[CyclePlan]()
    if any(leg.moves_at_ends for leg in cycle.legs):
        return found
    longer = (shortest * _LONGER**k for k in range(1, _MOST + 1))
    periods = [cycle.period] if cycle.period else [p for p in longer if p < longest]
    for period in periods:
        durations = (period - sought.dwelt) * (1 - USED_UP) * shares
        objectives = [Effort(duration=float(each)) for each in durations]
        filled = if_possible(NO_PLAN, sought.planned, objectives, None)
        if filled is not None:
            found.append(filled)
            if sought.is_kept(filled):
                break
    return found
