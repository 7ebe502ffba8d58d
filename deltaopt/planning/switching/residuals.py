"""What is wrong with a stationary motion of a structure.

A structure is right if between the nodes too no limit is exceeded, and if every limit that is
held has a price of the right sign: otherwise time is gained by leaving it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.flat.constraint_rows import OPENING, SPEED, TORQUE
from deltaopt.planning.switching.arc_mesh import DENSE, Pin
from deltaopt.planning.switching.conditions import Conditions
from deltaopt.planning.switching.kkt_system import Extremal
from deltaopt.planning.switching.state_multipliers import Push, pushes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Examined:
    """A motion between its nodes, at ``DENSE`` fractions of every interval. ``finest``: of a
    limit, by how much it may be exceeded."""

    conditions: Conditions
    motion: Extremal
    finest: float

    @cached_property
    def rows(self) -> Array:
        """Of the stage, (n, dense, rows)."""
        y = self.conditions.between(self.motion)
        values = self.conditions.stage.values(y.reshape(-1, 9), self.conditions.p)
        return values.reshape(len(y), len(DENSE), -1)

    @property
    def torques(self) -> Array:
        return self.rows[..., TORQUE : TORQUE + 3]

    @cached_property
    def prices(self) -> Array:
        """Of what is held, (n, dense, 3)."""
        return self.conditions.prices_between(self.motion)

    @cached_property
    def signs(self) -> Array:
        """Of the torques that are held, (n, 1, 3)."""
        return np.asarray(self.conditions.structure.torque[self.conditions.grid.arc][:, None])

    @cached_property
    def pushes(self) -> tuple[Push, ...]:
        """Of the limits of the state."""
        return tuple(pushes(self.conditions, self.motion))

    @cached_property
    def _without_limit(self) -> Array:
        """1 of torques that no limit holds, (n, 1, 3)."""
        grid, held = self.conditions.grid, self.conditions.held
        free = np.zeros((len(grid.parts), 3))
        for a, k in held.free:
            free[a, k] = 1.0
        return np.asarray(free[grid.arc][:, None])

    @cached_property
    def highest_price(self) -> float:
        """Of the torques that are held."""
        return float(np.abs(np.where(self.signs != 0, self.prices, 0.0)).max())

    def _mean(self, each: Array) -> float:
        """Over the duration, of (n, dense, 3) summed over motors."""
        h = self.motion.intervals(self.conditions.grid)
        return float(h @ each.mean(axis=1).sum(axis=1) / h.sum())

    @property
    def sign_violation(self) -> float:
        """Largest price of the wrong sign at a held torque over the largest price."""
        return float(np.maximum(-self.prices * self.signs, 0).max()) / self.highest_price

    @property
    def free_price(self) -> float:
        """Largest price of a torque without limit, which should have none, over the largest."""
        return float(np.abs(self.prices * self._without_limit).max()) / self.highest_price

    @property
    def to_be_gained(self) -> float:
        """By torques without limit, at most and to first order, as a fraction."""
        room = 1 - np.sign(self.prices) * np.clip(self.torques, -1, 1)
        return self._mean(np.abs(self.prices) * self._without_limit * room)

    @property
    def unused(self) -> float:
        """Given away or stolen between nodes, as a fraction of the duration: prices times what
        held torques differ from their limits."""
        differ = np.where(self.signs != 0, self.signs - self.torques, 0.0)
        return abs(self._mean(self.prices * differ))

    @property
    def excess(self) -> float:
        """Of torques and speeds over their limits, and of openings under their margin."""
        over = np.abs(self.torques).max() - 1
        under = -self.rows[..., OPENING : OPENING + 3].min()
        fast = np.abs(self.rows[..., SPEED : SPEED + 3]).max(initial=0.0) - 1
        return float(max(over, under, fast, 0.0))

    @property
    def strays(self) -> Array:
        """How far what is held is from its limit between nodes, (arcs,)."""
        grid, structure = self.conditions.grid, self.conditions.structure
        strays = [np.where(self.signs != 0, self.signs - self.torques, 0.0)]
        margin = structure.opening[grid.arc][:, None]
        strays.append(margin * self.rows[..., OPENING : OPENING + 3])
        if self.rows.shape[2] > SPEED:
            speed = structure.speed[grid.arc][:, None]
            strays.append(np.where(speed, speed - self.rows[..., SPEED : SPEED + 3], 0.0))
        each = np.max([np.abs(stray).max(axis=(1, 2)) for stray in strays], axis=0)
        return np.asarray(np.maximum.reduceat(each, grid.first))

    def pins(self) -> Iterator[Pin]:
        """Ends of arcs where a torque without limit exceeds one: what it does there is hardly
        determined, and as good at the limit."""
        grid = self.conditions.grid
        for a, k in self.conditions.held.free:
            first = grid.first[a]
            for end, at in ((0, (first, 0)), (1, (first + grid.parts[a] - 1, -1))):
                torque = self.torques[at][k]
                if abs(torque) > 1 + self.finest:
                    yield Pin(a, k, end, float(np.sign(torque)))
