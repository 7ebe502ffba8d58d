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

from deltaopt.planning.extremal import DENSE, Conditions, Extremal, Pin
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
        """Largest price of the wrong sign at a held torque over the largest price."""
        signs = self.conditions.structure.torque[self.conditions.grid.arc][:, None]
        return float(np.maximum(-self.prices * signs, 0).max()) / self.highest_price

    @cached_property
    def _free_prices(self) -> Array:
        """Of torques without limit, which should have none, (n, dense, 3)."""
        free = np.zeros((len(self.conditions.grid.parts), 3))
        for a, k in self.conditions.held.free:
            free[a, k] = 1.0
        return np.abs(self.prices) * free[self.conditions.grid.arc][:, None]

    @property
    def price_of_free(self) -> float:
        """Largest price of a torque without limit over the largest price."""
        return float(self._free_prices.max()) / self.highest_price

    @property
    def to_be_gained(self) -> float:
        """By torques without limit, at most, as a fraction of the duration, to first order."""
        room = 1 + np.abs(self.rows[..., TORQUE : TORQUE + 3])
        h = self.conditions.intervals(self.motion)
        each = (self._free_prices * room).mean(axis=1).sum(axis=1)
        return float((h * each).sum() / h.sum())

    @property
    def unused(self) -> float:
        """Duration given away or stolen between nodes, as a fraction: prices times what held
        torques differ from their limits."""
        signs = self.conditions.structure.torque[self.conditions.grid.arc][:, None]
        differ = np.where(signs != 0, signs - self.rows[..., TORQUE : TORQUE + 3], 0.0)
        h = self.conditions.intervals(self.motion)
        return float(abs((h * (self.prices * differ).mean(axis=1).sum(axis=1)).sum()) / h.sum())

    @property
    def excess(self) -> float:
        """Of torques and speeds over their limits, and of openings under their margin."""
        rows = self.rows
        over = np.abs(rows[..., TORQUE : TORQUE + 3]).max() - 1
        under = -rows[..., OPENING : OPENING + 3].min()
        fast = np.abs(rows[..., SPEED : SPEED + 3]).max(initial=0.0) - 1
        return float(max(over, under, fast, 0.0))

    @property
    def worst_arcs(self) -> Array:
        """How far what is held strays from its limit between nodes, (arcs,)."""
        conditions = self.conditions
        signs = conditions.structure.torque[conditions.grid.arc][:, None]
        differ = np.where(signs != 0, signs - self.rows[..., TORQUE : TORQUE + 3], 0.0)
        each = np.abs(differ).max(axis=(1, 2))
        return np.maximum.reduceat(each, conditions.grid.first)

    def pins(self) -> Iterator[Pin]:
        """Ends of arcs where a torque without limit would exceed one."""
        grid = self.conditions.grid
        for a, k in self.conditions.held.free:
            first = grid.first[a]
            for end, at in ((0, (first, 0)), (1, (first + grid.parts[a] - 1, -1))):
                torque = self.rows[at][TORQUE + k]
                if abs(torque) > 1 + _EXCEEDED:
                    yield Pin(a, k, end, float(np.sign(torque)))

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
