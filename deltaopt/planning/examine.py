"""What is wrong with a stationary motion of a structure, and what to hold instead.

A structure is right if between the nodes too no limit is exceeded, and if every limit that is
held has a price of the right sign: otherwise time is gained by leaving it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.extremal import Conditions
from deltaopt.planning.grid import DENSE, Pin
from deltaopt.planning.newton import Extremal
from deltaopt.planning.stage import OPENING, SPEED, TORQUE
from deltaopt.planning.structure import Limit, Stretch

Array = NDArray[np.float64]
Truths = NDArray[np.bool]

_WRONG_SIGN = 1e-5
"""Of the largest price."""


@dataclass(frozen=True)
class Examined:
    """A motion between its nodes, at ``DENSE`` fractions of every interval. ``finest``: of a
    limit, by how much it may be exceeded."""

    conditions: Conditions
    motion: Extremal
    finest: float

    @cached_property
    def _rows(self) -> Array:
        """Of the stage, (n, dense, rows)."""
        y = self.conditions.between(self.motion)
        values = self.conditions.stage.values(y.reshape(-1, 9), self.conditions.p)
        return values.reshape(len(y), len(DENSE), -1)

    @property
    def _torques(self) -> Array:
        return self._rows[..., TORQUE : TORQUE + 3]

    @cached_property
    def _prices(self) -> Array:
        """Of what is held, (n, dense, 3)."""
        return self.conditions.prices_between(self.motion)

    @cached_property
    def _signs(self) -> Array:
        """Of the torques that are held, (n, 1, 3)."""
        return np.asarray(self.conditions.structure.torque[self.conditions.grid.arc][:, None])

    @cached_property
    def _without_limit(self) -> Array:
        """1 of torques that no limit holds, (n, 1, 3)."""
        grid, held = self.conditions.grid, self.conditions.held
        free = np.zeros((len(grid.parts), 3))
        for a, k in held.free:
            free[a, k] = 1.0
        return np.asarray(free[grid.arc][:, None])

    @cached_property
    def _highest_price(self) -> float:
        """Of the torques that are held."""
        return float(np.abs(np.where(self._signs != 0, self._prices, 0.0)).max())

    def _mean(self, each: Array) -> float:
        """Over the duration, of (n, dense, 3) summed over motors."""
        h = self.motion.intervals(self.conditions.grid)
        return float(h @ each.mean(axis=1).sum(axis=1) / h.sum())

    @property
    def sign_violation(self) -> float:
        """Largest price of the wrong sign at a held torque over the largest price."""
        return float(np.maximum(-self._prices * self._signs, 0).max()) / self._highest_price

    @property
    def free_price(self) -> float:
        """Largest price of a torque without limit, which should have none, over the largest."""
        return float(np.abs(self._prices * self._without_limit).max()) / self._highest_price

    @property
    def to_be_gained(self) -> float:
        """By torques without limit, at most and to first order, as a fraction."""
        room = 1 - np.sign(self._prices) * np.clip(self._torques, -1, 1)
        return self._mean(np.abs(self._prices) * self._without_limit * room)

    @property
    def unused(self) -> float:
        """Given away or stolen between nodes, as a fraction of the duration: prices times what
        held torques differ from their limits."""
        differ = np.where(self._signs != 0, self._signs - self._torques, 0.0)
        return abs(self._mean(self._prices * differ))

    @property
    def excess(self) -> float:
        """Of torques and speeds over their limits, and of openings under their margin."""
        over = np.abs(self._torques).max() - 1
        under = -self._rows[..., OPENING : OPENING + 3].min()
        fast = np.abs(self._rows[..., SPEED : SPEED + 3]).max(initial=0.0) - 1
        return float(max(over, under, fast, 0.0))

    @property
    def strays(self) -> Array:
        """How far what is held is from its limit between nodes, (arcs,)."""
        grid, structure = self.conditions.grid, self.conditions.structure
        strays = [np.where(self._signs != 0, self._signs - self._torques, 0.0)]
        margin = structure.opening[grid.arc][:, None]
        strays.append(margin * self._rows[..., OPENING : OPENING + 3])
        if self._rows.shape[2] > SPEED:
            speed = structure.speed[grid.arc][:, None]
            strays.append(np.where(speed, speed - self._rows[..., SPEED : SPEED + 3], 0.0))
        each = np.max([np.abs(stray).max(axis=(1, 2)) for stray in strays], axis=0)
        return np.asarray(np.maximum.reduceat(each, grid.first))

    def pins(self) -> Iterator[Pin]:
        """Ends of arcs where a torque without limit exceeds one: what it does there is hardly
        determined, and as good at the limit."""
        grid = self.conditions.grid
        for a, k in self.conditions.held.free:
            first = grid.first[a]
            for end, at in ((0, (first, 0)), (1, (first + grid.parts[a] - 1, -1))):
                torque = self._torques[at][k]
                if abs(torque) > 1 + self.finest:
                    yield Pin(a, k, end, float(np.sign(torque)))

    def patches(self) -> Iterator[tuple[int, Stretch]]:
        """(motor, stretch) to be held otherwise."""
        structure, arc = self.conditions.structure, self.conditions.grid.arc
        least = -_WRONG_SIGN * self._highest_price
        for k in range(3):
            limits = [structure.limits[a][k] for a in arc]
            torque, opening = self._rows[..., TORQUE + k], self._rows[..., OPENING + k]
            held = np.array([limit.torque for limit in limits])[:, None]
            at_speed = np.array([limit.speed for limit in limits])[:, None]
            at_margin = np.array([limit.opening for limit in limits])[:, None]
            for sign in (1, -1):
                wrong = (held == -sign) & (-sign * self._prices[..., k] < least)
                yield from self._stretches(k, wrong, Limit(torque=sign))
                over = (held == 0) & (sign * torque > 1 + self.finest)
                yield from self._stretches(k, over, Limit(torque=sign))
                if self._rows.shape[2] > SPEED:
                    speed = sign * self._rows[..., SPEED + k]
                    fast = (at_speed == 0) & (speed > 1 + self.finest)
                    yield from self._stretches(k, fast, Limit(speed=sign))
            yield from self._stretches(
                k, (at_margin == 0) & (opening < -self.finest), Limit(opening=1)
            )

    @cached_property
    def _times(self) -> Array:
        """Of the samples, fractions of the duration, (n · dense,)."""
        h = self.motion.intervals(self.conditions.grid)
        begin = np.cumsum(h) - h
        return np.ravel((begin[:, None] + h[:, None] * DENSE) / h.sum())

    def _stretches(self, motor: int, where: Truths, limit: Limit) -> Iterator[tuple[int, Stretch]]:
        """From samples, (n, dense), to times halfway to those around."""
        inside, times = where.ravel().astype(int), self._times
        edges = np.flatnonzero(np.diff(np.concatenate([[0], inside, [0]])))
        for begin, end in edges.reshape(-1, 2).tolist():
            before, after = times[max(begin - 1, 0)], times[min(end, len(times) - 1)]
            first, last = (before + times[begin]) / 2, (times[end - 1] + after) / 2
            yield motor, Stretch(float(first), float(last), limit)
