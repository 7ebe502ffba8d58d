"""How the duration of a fastest motion depends on each of its limits, and that in words.

A bound c of a quantity is raised by a small share of itself, ε, at all instants. Its normalised row
is a share of it, r = f(motion) / cⁿ (n = 1 for a torque, 2 where the row is the square of a norm),
so that it falls by n ε where it is at its bound, 1. The multipliers λ of the row say what that is
worth, relative to the duration T:

    d ln T / d ln c = - n Σ |λ|    over all points where the row is bounded

Larger changes are extrapolated by the power law T ~ c^(d ln T / d ln c). Where gravity, friction
and limits of other orders play no part, T ~ c^(-1/2) if the torques of all motors change alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.motion.active_limits import ActiveLimit, shares_of_time

MORE = 0.1
"""Share by which words raise a limit: as much as the next size of a motor or gear may well give."""
_AT_A_GLANCE = 3
"""Most limits of one line."""
_TOLD_SHARE, _TOLD_SAVING = 0.005, 0.001
"""Share of the time that a limit is reached, or of the duration that more of it would save, from
which it is told: less would read as nothing."""


@dataclass(frozen=True, eq=False)
class Multipliers:
    """The multipliers of the limits of a fastest motion.

    ``limits``: whose they are. A plan may have been found with other limits than its scene has: a
    distance from a singularity is kept besides, bodies that are far away are left out.
    ``of_rows``: by what share the duration grows per unit by which the bound of each normalised row
    is tightened, at all instants alike, (rows,); zero or more. It may take long.
    """

    limits: SceneLimits
    of_rows: Callable[[], Array]


@dataclass(frozen=True)
class LimitSensitivity:
    """How the duration of a fastest motion depends on one bound.

    ``limit``: the limit's name. ``subject``: "motor 2". ``exponent``: d ln T / d ln bound, zero or
    less: the relative change of the duration by relative change of the bound. ``most_saved``: share
    of the duration that can be saved at most, for another reason than limits.
    """

    limit: str
    subject: str
    exponent: float
    most_saved: float = 1.0

    def saved_by(self, more: float) -> float:
        """The share of the duration that is saved if the bound is raised by a share ``more``."""
        return min(1.0 - float((1 + more) ** self.exponent), self.most_saved)


def limit_sensitivities(
    multipliers: Multipliers, most_saved: float
) -> tuple[LimitSensitivity, ...]:
    """The sensitivities to all limits that a motion must keep, the largest first.

    Those of ranges, such as an arm's, are left out: there is no share to raise them by.
    ``most_saved``: as of ``LimitSensitivity``.
    """
    limits = multipliers.limits
    slopes = -limits.bound_exponents * multipliers.of_rows()
    found = dict[tuple[str, str], float]()
    for row in np.flatnonzero(limits.constraints.promised).tolist():
        name = limits.constraints.named(row)
        found[name] = found.get(name, 0.0) + float(slopes[row])
    known = {name: slope for name, slope in found.items() if isfinite(slope)}
    each = [LimitSensitivity(*name, slope, most_saved) for name, slope in known.items()]
    return tuple(sorted(each, key=lambda one: one.exponent))


def limits_in_words(
    active: Iterable[ActiveLimit], sensitivities: Iterable[LimitSensitivity]
) -> list[str]:
    """A sentence for every limit that matters: how much of the time it is reached, and what more of
    it would save. None where no limit matters."""
    known = {(each.limit, each.subject): each for each in sensitivities}
    told = []
    for each in active:
        sensitivity = known.get((each.limit, each.subject))
        saved = 0.0 if sensitivity is None else sensitivity.saved_by(MORE)
        if saved >= _TOLD_SAVING:
            told.append(f"{each.sentence}; {100 * MORE:.0f} % more would save {100 * saved:.1f} %")
        elif each.share >= _TOLD_SHARE:
            told.append(each.sentence)
    return told


def limits_at_a_glance(
    active: Sequence[ActiveLimit], sensitivities: Iterable[LimitSensitivity], duration: float
) -> str:
    """The limits of a motion of some ``duration`` (s) that matter most in a line, each of all
    motors together: how much of the time one of them is at it, and what more of it for all of them
    would save. Empty where no limit matters.
    """
    shares, of_all = shares_of_time(active, duration), dict[str, LimitSensitivity]()
    for known in sensitivities:
        before = of_all.get(known.limit, replace(known, exponent=0.0))
        of_all[known.limit] = replace(before, exponent=before.exponent + known.exponent)
    saved = {name: each.saved_by(MORE) for name, each in of_all.items()}
    alone = {each.limit: each.takes for each in active if each.takes is not None}
    told = [f"the {name}, which takes {takes:.3f} s" for name, takes in alone.items()]
    for name in sorted(shares, key=lambda name: (-saved.get(name, 0.0), -shares[name])):
        share, saving = shares[name], saved.get(name, 0.0)
        more = f", {100 * MORE:.0f} % more would save {100 * saving:.1f} %"
        matters = max(share / _TOLD_SHARE, saving / _TOLD_SAVING) >= 1
        if matters and name not in alone:
            more = more if saving >= _TOLD_SAVING else ""
            told.append(f"{name} ({100 * share:.0f} % of the time{more})")
    return ", ".join(told[:_AT_A_GLANCE])


def as_dicts(
    active: Iterable[ActiveLimit], sensitivities: Iterable[LimitSensitivity]
) -> list[dict[str, object]]:
    """Active limits for machines; ``exponent``: d ln duration / d ln bound, None if not known."""
    exponents = {(each.limit, each.subject): each.exponent for each in sensitivities}
    return [
        {
            "limit": each.limit,
            "subject": each.subject,
            "share_of_time": each.share,
            "exponent": exponents.get((each.limit, each.subject)),
        }
        for each in active
    ]
