"""Multipliers of state limits, of order 1 (velocity) and 0 (position), on resolved arcs.

On an arc such a limit c is held by its derivative, whose multiplier λ may have either sign, and by
itself where the arc begins, ν. The multiplier of c itself, a measure η, follows by parts:

    ∫ λ ċ dt + ν c(t₀) = ∫ c dη      η(t) = ν - λ(t)        of order 1
    ∫ λ c̈ dt + ν c(t₀) = ∫ c dη      η(t) = ν + dλ/dt       of order 0

from 0 before the arc to ν after it. What else integrating by parts leaves at the ends is zero,
since the ends are free: λ where the arc ends; and, of order 0, λ less the multiplier of ċ where it
begins. A limit can only push the motion away: η never falls at an upper limit and never rises at a
lower one. Otherwise time is gained by leaving the limit, even if every control has a multiplier of
the right sign.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from deltaopt.curves.piecewise import Array, Truths
from deltaopt.planning.switching.conditions import EntryCondition, OptimalityConditions
from deltaopt.planning.switching.unknowns import PrimalDualPoint

_VELOCITY, _VELOCITY_BESIDE_SINGULAR, _POSITION = 1e-5, 1e-4, 1e-3
"""By how much a multiplier may fall, as a fraction of the duration per unit of a row: of order 1;
of order 1 where controls are singular, which are polynomials; of order 0, whose multiplier is the
derivative of a polynomial. Tighter ones reject motions for the error of their polynomials, looser
ones accept limits that should be left."""


@dataclass(frozen=True)
class StateMultiplier:
    """The multiplier η of a state limit along an arc or at a contact point, in scaled time per
    unit of the normalised row, signed so that optimality requires it to be non-decreasing.

    ``entry``: where the limit is reached. ``active``: intervals in which it is active, (n,), none
    at a contact point. ``eta``: before the arc, at the samples of these intervals, and after it,
    (samples + 2,). ``duration``: of the motion. ``may_fall``: a fraction of the duration.
    """

    entry: EntryCondition
    active: Truths
    eta: Array
    duration: float
    may_fall: float

    @property
    def order(self) -> int:
        """The order of the limit: 0 (position) or 1 (velocity)."""
        return self.entry.rows.order

    @property
    def falls(self) -> Array:
        """By how much η is lower than some time before, or higher than some time after, as
        fractions of the duration, (samples + 2,)."""
        before = np.maximum.accumulate(self.eta)
        after = np.minimum.accumulate(self.eta[::-1])[::-1]
        return np.asarray(np.maximum(before - self.eta, self.eta - after) / self.duration)

    @property
    def has_wrong_sign(self) -> Truths:
        """Where time would be gained by leaving the limit, (samples + 2,)."""
        return np.asarray(self.falls > self.may_fall)


def state_multipliers(
    conditions: OptimalityConditions, point: PrimalDualPoint
) -> Iterator[StateMultiplier]:
    """Multipliers of all state limits that are active on arcs or at contact points, in order."""
    structure, mesh = conditions.structure, conditions.mesh
    lam, h = conditions.multipliers_between(point), point.interval_lengths(mesh)[:, None, None]
    by_time = mesh.polynomials.slope_at_dense @ conditions.multipliers(point) / h  # dλ/dt
    for entry, nu in zip(conditions.active.entries, point.entry.tolist(), strict=True):
        if entry.derivative:  # given besides the quantity itself
            continue
        order, sign = entry.rows.order, int(entry.value)
        signs = structure.state(order)[:, entry.motor]
        after = np.flatnonzero(signs[entry.arc :] != sign)
        last = entry.arc + int(after[0]) if len(after) else len(signs)
        active = np.isin(mesh.arc, np.arange(entry.arc, last))
        holding = entry.rows.holding[entry.motor]
        place = (conditions.active.row[mesh.arc[active]] == holding).argmax(axis=1)
        at = np.flatnonzero(active), slice(None), place
        eta = nu - lam[at] if order else nu + by_time[at]
        eta = sign * np.concatenate([[0.0], eta.ravel(), [nu]])
        of_velocity = _VELOCITY_BESIDE_SINGULAR if conditions.active.singular else _VELOCITY
        may_fall = of_velocity if order else _POSITION
        yield StateMultiplier(entry, active, eta, point.duration, may_fall)
