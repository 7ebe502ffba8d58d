"""Optimality residuals of a stationary motion: by how much its switching structure is wrong.

A structure is right if no limit is exceeded between the nodes either, and if the multiplier of
every active limit has the right sign: otherwise time is gained by leaving the limit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from deltaopt.curves.piecewise import Array, Truths
from deltaopt.planning.switching.arc_mesh import DENSE
from deltaopt.planning.switching.conditions import EndValue, OptimalityConditions
from deltaopt.planning.switching.state_multipliers import StateMultiplier, state_multipliers
from deltaopt.planning.switching.unknowns import PrimalDualPoint


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
        rows, mesh, structure = (
            self.conditions.rows,
            self.conditions.mesh,
            self.conditions.structure,
        )
        limited: list[tuple[Array, Array]] = [(self.signs, self.control)]
        for state in rows.states:
            signs = np.asarray(structure.state(state.order)[mesh.arc][:, None], np.float64)
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
