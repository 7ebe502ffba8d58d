"""Cycles whose legs take all of a period, each with the least effort in its share of it.

No prices lead to legs that would be hotter in less time and in more: what legs cost at any prices
is less elsewhere. Their durations are given here instead.
"""

from __future__ import annotations

import numpy as np

from deltaopt.curves.halving import bisected_number
from deltaopt.errors import NO_PLAN, if_possible
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.cycles.priced_legs import USED_UP, PricedLegs
from deltaopt.scene.objective import Effort

_HALVINGS = 6
"""Of the ratio of a period that is known to one that is too short."""


def filled_periods(sought: PricedLegs, best: CyclePlan, shortest: float) -> list[CyclePlan]:
    """Cycles that wait no longer than they have to, with legs that last in proportion to those of
    the ``best``: in the given period, or in periods that are halved between one that is too short,
    s, and that of the best. None where legs end moving."""
    cycle, found = sought.cycle, list[CyclePlan]()
    if any(leg.moves_at_ends for leg in cycle.legs):
        return found

    def is_kept(logarithm: float) -> bool:
        left = (float(np.exp(logarithm)) - sought.dwelt) * (1 - USED_UP)
        durations = left * best.durations / best.durations.sum()
        objectives = [Effort(duration=float(each)) for each in durations]
        filled = if_possible(NO_PLAN, sought.planned, objectives, None)
        found.extend([filled] if filled else [])
        return filled is not None and sought.is_kept(filled)

    if cycle.period is None:
        low, high = np.log([shortest, best.period]).tolist()
        bisected_number(is_kept, low, high, _HALVINGS)
    else:
        is_kept(float(np.log(cycle.period)))
    return found
