"""What is wrong with a stationary motion of a structure, and what to hold instead.

A structure is right if between its nodes too no limit is exceeded, and if every limit that is
held has a price of the right sign: otherwise time is gained by leaving it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.extremal import DENSE, Conditions, Extremal
from deltaopt.planning.stage import OPENING, SPEED, TORQUE
from deltaopt.planning.structure import Limit, Stretch

Array = NDArray[np.float64]

_EXCEEDED = 1e-6
"""Of a limit: what is less is left to the grid."""
_WRONG_SIGN = 1e-5
"""Of the largest price."""


@dataclass(frozen=True)
class Examined:
    """A motion between its nodes."""

    conditions: Conditions
    motion: Extremal

    @cached_property
    def rows(self) -> Array:
        """(n, dense, rows)."""
        y = self.conditions.between(self.motion)
        values = self.conditions.stage.values(y.reshape(-1, 9), self.conditions.p)
        return values.reshape(len(y), len(DENSE), -1)

    @cached_property
    def times(self) -> Array:
        """Fractions of the duration, (n, dense)."""
        h = self.conditions.intervals(self.motion)
        begin = np.concatenate([[0.0], np.cumsum(h)[:-1]])
        return np.asarray((begin[:, None] + h[:, None] * DENSE) / h.sum())

    @cached_property
    def prices(self) -> Array:
        """Of what is held, (n, dense, 3)."""
        return np.asarray(self.conditions.grid.dense[2] @ self.conditions.prices(self.motion))

    @cached_property
    def highest_price(self) -> float:
        """Of torques that are held."""
        held = self._torque_held
        return float(np.abs(np.where(held[:, None], self.prices, 0.0)).max())

    @property
    def _torque_held(self) -> Array:
        return np.asarray((self.conditions.structure.torque != 0)[self.conditions.grid.arc])

    @property
    def sign_violation(self) -> float:
        """Largest price of the wrong sign at a held torque, or of any at a torque without
        limit, over the largest price."""
        signs = self.conditions.structure.torque[self.conditions.grid.arc][:, None]
        wrong = np.maximum(-self.prices * signs, 0).max()
        return float(max(wrong, self._price_of_free) / self.highest_price)

    @property
    def _price_of_free(self) -> float:
        prices = self.conditions.prices(self.motion)
        arc = self.conditions.grid.arc
        free = [np.abs(prices[arc == a, :, k]).max() for a, k in self.conditions.held.free]
        return float(max(free, default=0.0))

    @property
    def modes_missing(self) -> float:
        """Price of torques without limit over the largest: zero if they are what they should."""
        return self._price_of_free / self.highest_price

    @property
    def unused(self) -> float:
        """Duration given away or stolen between nodes, as a fraction: prices times what held
        torques differ from their limits."""
        signs = self.conditions.structure.torque[self.conditions.grid.arc][:, None]
        differ = np.where(signs != 0, signs - self.rows[..., TORQUE : TORQUE + 3], 0.0)
        h = self.conditions.intervals(self.motion)
        return float(abs((h * (self.prices * differ).mean(axis=1).sum(axis=1)).sum()) / h.sum())

    @property
    def worst_arcs(self) -> Array:
        """How far what is held strays from its limit between nodes, (arcs,)."""
        conditions = self.conditions
        signs = conditions.structure.torque[conditions.grid.arc][:, None]
        differ = np.where(signs != 0, signs - self.rows[..., TORQUE : TORQUE + 3], 0.0)
        each = np.abs(differ).max(axis=(1, 2))
        return np.maximum.reduceat(each, conditions.grid.first)

    def patches(self) -> Iterator[tuple[int, Stretch]]:
        """(motor, stretch) to be held otherwise."""
        structure, arc = self.conditions.structure, self.conditions.grid.arc
        least = -_WRONG_SIGN * self.highest_price
        for k in range(3):
            limits = [structure.limits[a][k] for a in arc]
            torque = self.rows[..., TORQUE + k]
            opening = self.rows[..., OPENING + k]
            held = np.array([limit.torque for limit in limits])[:, None]
            folded = np.array([limit.opening for limit in limits])[:, None]
            for sign in (1, -1):
                wrong = (held == -sign) & (self.prices[..., k] * -sign < least)
                yield from self._stretches(k, wrong, Limit(torque=sign))
                over = (held == 0) & (sign * torque > 1 + _EXCEEDED)
                yield from self._stretches(k, over, Limit(torque=sign))
                if self.rows.shape[2] > SPEED:
                    at_speed = np.array([limit.speed for limit in limits])[:, None]
                    fast = (at_speed == 0) & (
                        sign * self.rows[..., SPEED + k] > 1 + _EXCEEDED
                    )
                    yield from self._stretches(k, fast, Limit(speed=sign))
            yield from self._stretches(
                k, (folded == 0) & (opening < -_EXCEEDED), Limit(opening=1)
            )

    def _stretches(
        self, motor: int, where: NDArray[np.bool], limit: Limit
    ) -> Iterator[tuple[int, Stretch]]:
        """From samples, (n, dense), to times."""
        flat, times = where.ravel(), self.times.ravel()
        edges = np.flatnonzero(np.diff(np.concatenate([[0], flat.astype(int), [0]])))
        for begin, end in edges.reshape(-1, 2).tolist():
            first, last = max(begin - 1, 0), min(end, len(times) - 1)
            stretch = Stretch(
                (times[first] + times[begin]) / 2, (times[end - 1] + times[last]) / 2, limit
            )
            yield motor, stretch
