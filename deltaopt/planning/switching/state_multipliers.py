"""Prices of limits of the state: of speeds, and of the margin of a fold, on resolved arcs.

On an arc such a limit c is held by its derivative, whose price λ may have either sign, and by
itself where the arc begins, ν. The price of c itself, a measure η, follows by parts:

    ∫ λ ċ dt + ν c(t₀) = ∫ c dη      η(t) = ν - λ(t)        of a speed
    ∫ λ c̈ dt + ν c(t₀) = ∫ c dη      η(t) = ν + dλ/dt       of an opening

from 0 before the arc to ν after it. (What else integrating by parts leaves at the ends is zero
since these are free: λ where the arc ends, and where it begins, of an opening, λ less the
multiplier of its derivative.) A limit can only push the motion away: η never falls where
c has an upper limit, and never rises where it has a lower one. Otherwise time is gained by
leaving it, though every torque have a price of the right sign.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.flat.constraint_rows import OPENING_BEND, OPENING_RATE, SPEED_RATE
from deltaopt.planning.switching.arc_mesh import Entry
from deltaopt.planning.switching.conditions import Conditions
from deltaopt.planning.switching.kkt_system import Extremal

Array = NDArray[np.float64]
Truths = NDArray[np.bool]

_OF_SPEED, _BESIDE_FREE, _OF_OPENING = 1e-5, 1e-4, 1e-3
"""By how much a price may fall: of a speed; of one where torques are at no limit, these being
polynomials; of an opening, whose price is a polynomial's derivative."""


@dataclass(frozen=True)
class Push:
    """η of a limit that is held for a time or touched, made so that it should rise; in the
    scales' time, per limit of speed or per unit of sin² of a fold.

    ``price``: from before the arc to after it, (samples + 2,); ``held``: the intervals in which
    the samples between are, (n,). ``may_fall``: a fraction of the duration.
    """

    entry: Entry
    held: Truths
    price: Array
    duration: float
    may_fall: float

    @property
    def falls(self) -> Array:
        """By how much it is lower than before, or higher than after, fractions of the duration,
        (samples + 2,)."""
        before = np.maximum.accumulate(self.price)
        after = np.minimum.accumulate(self.price[::-1])[::-1]
        return np.asarray(np.maximum(before - self.price, self.price - after) / self.duration)

    @property
    def pulls(self) -> Truths:
        """Where time would be gained by leaving the limit, (samples + 2,)."""
        return np.asarray(self.falls > self.may_fall)


def pushes(conditions: Conditions, motion: Extremal) -> Iterator[Push]:
    """Of every limit of the state that is held for a time or touched, in their order."""
    structure, grid = conditions.structure, conditions.grid
    lam, slope = conditions.prices_between(motion), _slopes_between(conditions, motion)
    for entry, nu in zip(conditions.held.entries, motion.entry.tolist(), strict=True):
        if OPENING_RATE <= entry.row < OPENING_BEND:  # held besides the opening itself
            continue
        k = entry.motor
        signs = structure.speed[:, k] if entry.of_speed else -structure.opening[:, k]
        sign = int(entry.value) or -1  # that of an opening
        after = np.flatnonzero(signs[entry.arc :] != sign)
        last = entry.arc + int(after[0]) if len(after) else len(signs)
        held = np.isin(grid.arc, np.arange(entry.arc, last))
        row = k + (SPEED_RATE if entry.of_speed else OPENING_BEND)
        slot = (conditions.held.row[grid.arc[held]] == row).argmax(axis=1)
        at = np.flatnonzero(held), slice(None), slot
        eta = nu - lam[at] if entry.of_speed else nu + slope[at]
        price = sign * np.concatenate([[0.0], eta.ravel(), [nu]])
        of_speed = _BESIDE_FREE if conditions.held.free else _OF_SPEED
        may_fall = of_speed if entry.of_speed else _OF_OPENING
        yield Push(entry, held, price, motion.duration, may_fall)


def _slopes_between(conditions: Conditions, motion: Extremal) -> Array:
    """Derivatives by time of the prices λ of what is held, (n, dense, 3)."""
    grid, h = conditions.grid, motion.intervals(conditions.grid)[:, None, None]
    return np.asarray(grid.slope_at_dense @ conditions.prices(motion) / h)
