"""Optimality residuals of a stationary motion: by how much its switching structure is wrong.

A structure is right if no limit is exceeded between the nodes either, and if the multiplier of
every active limit has the right sign: otherwise time is gained by leaving the limit.

State limits are of order 1 (velocity) and 0 (position).
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
from functools import cached_property

import numpy as np

from deltaopt.curves.piecewise import Array, Truths
from deltaopt.planning.switching.arc_mesh import DENSE
from deltaopt.planning.switching.conditions import EndValue, EntryCondition, OptimalityConditions
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


@dataclass(frozen=True)
class OptimalityResiduals:
    """Residuals of a stationary point at samples between its nodes, ``DENSE`` fractions of every
    interval. ``finest``: by how much a normalised row may exceed its limit."""

    conditions: OptimalityConditions
    point: PrimalDualPoint
    finest: float

    @cached_property
    def rows(self) -> Array:
        """All rows at the samples, (n, dense, rows)."""
        y = self.conditions.between(self.point)
        values = self.conditions.rows.values(y.reshape(-1, y.shape[2]), self.conditions.p)
        return values.reshape(len(y), len(DENSE), -1)

    @property
    def control(self) -> Array:
        """Control rows at the samples, (n, dense, m)."""
        return self.rows[..., self.conditions.rows.control]

    @cached_property
    def multipliers(self) -> Array:
        """Multipliers of the active rows at the samples, (n, dense, m)."""
        return self.conditions.multipliers_between(self.point)

    @cached_property
    def signs(self) -> Array:
        """Signs of the active limits of controls in the intervals, (n, 1, m)."""
        signs = self.conditions.structure.control[self.conditions.mesh.arc][:, None]
        return np.asarray(signs, np.float64)

    @cached_property
    def state_multipliers(self) -> tuple[StateMultiplier, ...]:
        """Multipliers of the active state limits."""
        return tuple(state_multipliers(self.conditions, self.point))

    @cached_property
    def _singular(self) -> Truths:
        """Where controls are singular, (n, 1, m)."""
        return self.conditions.active.is_singular()[self.conditions.mesh.arc][:, None]

    @cached_property
    def largest_multiplier(self) -> float:
        """Largest multiplier of an active limit of a control."""
        return float(np.abs(np.where(self.signs != 0, self.multipliers, 0.0)).max())

    def _mean(self, each: Array) -> float:
        """The mean over the duration of samples (n, dense, m), summed over motors."""
        h = self.point.interval_lengths(self.conditions.mesh)
        return float(h @ each.mean(axis=1).sum(axis=1) / h.sum())

    @property
    def sign_violation(self) -> float:
        """Largest multiplier of the wrong sign of an active limit of a control, over the
        largest multiplier."""
        wrong = float(np.maximum(-self.multipliers * self.signs, 0).max())
        return wrong / self.largest_multiplier

    @property
    def singular_multiplier(self) -> float:
        """Largest multiplier of a singular control, which should have none, over the largest
        multiplier."""
        return float(np.abs(self.multipliers * self._singular).max()) / self.largest_multiplier

    @property
    def to_be_gained(self) -> float:
        """By what fraction of the duration singular controls could shorten the motion, at most and
        to first order."""
        room = 1 - np.sign(self.multipliers) * np.clip(self.control, -1, 1)
        return self._mean(np.abs(self.multipliers) * self._singular * room)

    @property
    def unused(self) -> float:
        """What fraction of the duration is lost or gained illegally between nodes: multipliers
        times what controls differ from their active limits."""
        differ = np.where(self.signs != 0, self.signs - self.control, 0.0)
        return abs(self._mean(self.multipliers * differ))

    @property
    def excess(self) -> float:
        """By how much a normalised row exceeds its limit at most."""
        rows = self.conditions.rows
        limited = [rows.control, *(state.value for state in rows.states)]
        return max(0.0, *(float(np.abs(self.rows[..., each]).max()) - 1 for each in limited))

    @property
    def strays(self) -> Array:
        """How far active rows are from their limits between nodes, on each arc, (arcs,)."""
        of, mesh = self.conditions, self.conditions.mesh
        limited: list[tuple[Array, Array]] = [(self.signs, self.control)]
        for state in of.rows.states:
            signs = np.asarray(of.structure.state(state.order)[mesh.arc][:, None], np.float64)
            limited.append((signs, self.rows[..., state.value]))
        strays = [np.where(signs != 0, signs - row, 0.0) for signs, row in limited]
        each = np.max([np.abs(stray).max(axis=(1, 2)) for stray in strays], axis=0)
        return np.asarray(np.maximum.reduceat(each, mesh.first))

    def end_values(self) -> Iterator[EndValue]:
        """End values to be given: where a singular control exceeds a limit at an end of its arc. It
        is hardly determined there, and as good at the limit."""
        mesh = self.conditions.mesh
        for a, k in self.conditions.active.singular:
            first = mesh.first[a]
            for end, at in ((0, (first, 0)), (1, (first + mesh.parts[a] - 1, -1))):
                control = self.control[at][k]
                if abs(control) > 1 + self.finest:
                    yield EndValue(a, k, end, float(np.sign(control)))
