"""What to hold instead where a stationary motion of a structure is wrong.

By Pontryagin's principle the torques minimise H = p · (V, A) at every instant, and A is affine in
them: a linear program, whose vertices are what an arc may hold. Of three torques as many are at
their limits as no speed and no opening is held. Where a held torque has a price of the wrong sign,
or one that follows from a speed exceeds its own limit, the best vertex says what else to hold: not
always the torque's other limit, for another motor's may give way.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.flat.constraint_rows import OPENING, SPEED, TORQUE
from deltaopt.planning.switching.arc_mesh import DENSE, held_states
from deltaopt.planning.switching.residuals import Examined
from deltaopt.planning.switching.state_multipliers import Push
from deltaopt.planning.switching.structure import Arc, Stretch

Array = NDArray[np.float64]
Truths = NDArray[np.bool]

Patch = tuple[tuple[int, Stretch], ...]
"""(motor, stretch) of every motor."""

_WRONG_SIGN = 1e-5
"""Of the largest price."""
_INSERTED = 0.04
"""Of a stretch amid an arc: where prices have the wrong sign for long, what is missing is short."""
_ALIKE = 1e-9
"""Of the duration."""
_FLAT = 1e-12
"""Determinant of what no torque can change."""


def patches(examined: Examined) -> list[Patch]:
    """What is to be held otherwise, the worst first."""
    return _Repair(examined).patches


@dataclass(frozen=True)
class _Repair:
    """Samples are those of ``Examined``, (n, dense)."""

    examined: Examined

    @property
    def patches(self) -> list[Patch]:
        before, after = self._held, self._wanted
        bad = np.ravel(self._lengths[:, None] * np.maximum(self._violations, 0.0).sum(axis=(2, 3)))
        found, begin = [], 0
        for end in range(1, len(after) + 1):
            if end < len(after) and after[end] == after[begin]:
                continue
            if after[begin:end] != before[begin:end]:
                stretch = self._between(begin, end)
                patch = tuple((k, Stretch(*stretch, limit)) for k, limit in enumerate(after[begin]))
                found.append((float(bad[begin:end].sum()), patch))
            begin = end
        return [patch for _, patch in sorted(found, key=lambda each: -each[0])]

    @property
    def _lengths(self) -> Array:
        """Of the intervals, fractions of the duration, (n,)."""
        h = self.examined.motion.intervals(self.examined.conditions.grid)
        return np.asarray(h / h.sum())

    @cached_property
    def _times(self) -> Array:
        """Of the samples, fractions of the duration, (n · dense,)."""
        h = self._lengths
        return np.ravel((np.cumsum(h) - h)[:, None] + h[:, None] * DENSE)

    @property
    def _held(self) -> list[Arc]:
        """At the samples, in their order."""
        limits = self.examined.conditions.structure.limits
        return [limits[a] for a in self.examined.conditions.grid.arc for _ in DENSE]

    @property
    def _wanted(self) -> list[Arc]:
        """What to hold at the samples, in their order."""
        wanted = self._held
        wrong = self._wrong.any(axis=(2, 3)) | self._to_leave.any(axis=(2, 3))
        for i, j in np.argwhere(wrong).tolist():
            wanted[i * len(DENSE) + j] = self._better(i, j)
        for arc, motor in self._touched_in_vain:
            for s in np.flatnonzero(
                np.repeat(self.examined.conditions.grid.arc, len(DENSE)) == arc
            ):
                limits = list(wanted[s])
                limits[motor] = limits[motor].later
                wanted[s] = tuple(limits)
        return wanted

    def _between(self, begin: int, end: int) -> tuple[float, float]:
        """The stretch of samples from ``begin``, without ``end``; only a part of it amid an arc."""
        number, motion = len(self._times), self.examined.motion
        first = self._edge(begin - 1, begin) if begin else 0.0
        last = self._edge(end, end - 1) if end < number else 1.0
        switches = np.concatenate([[0.0], np.cumsum(motion.lengths) / motion.duration])
        if min(np.abs(switches - first).min(), np.abs(switches - last).min()) > _ALIKE:
            middle, half = (first + last) / 2, _INSERTED * (last - first) / 2
            first, last = middle - half, middle + half
        return first, last

    def _edge(self, outside: int, inside: int) -> float:
        """When something begins or ends to be wrong, between neighbouring samples."""
        good_at, bad_at = self._times[outside], self._times[inside]
        good, bad = (self._violations.reshape(-1, 9)[i] for i in (outside, inside))
        worst = int(bad.argmax())
        if not (bad[worst] > 0 > good[worst] > -np.inf):
            return float(good_at + bad_at) / 2
        return float(good_at + (bad_at - good_at) * good[worst] / (good[worst] - bad[worst]))

    @cached_property
    def _violations(self) -> Array:
        """By how much a price has the wrong sign, of the largest, or something exceeds a limit, (n,
        dense, motors, 3): of torque, of speed, of opening; where it does not, by how much not."""
        e = self.examined
        structure, arc = e.conditions.structure, e.conditions.grid.arc
        found = np.full((*e.torques.shape[:2], 3, 3), -np.inf)
        by_price = -e.prices * e.signs / e.highest_price
        found[..., 0] = np.where(e.signs != 0, by_price, np.abs(e.torques) - 1)
        if e.rows.shape[2] > SPEED:
            over = np.abs(e.rows[..., SPEED : SPEED + 3]) - 1
            found[..., 1] = np.where(structure.speed[arc][:, None], -np.inf, over)
        under = -e.rows[..., OPENING : OPENING + 3]
        found[..., 2] = np.where(structure.opening[arc][:, None], -np.inf, under)
        return found

    @cached_property
    def _wrong(self) -> Truths:
        """Where something is, as ``_violations``."""
        wrong = self._violations > self.examined.finest
        by_price = self._violations[..., 0] > _WRONG_SIGN
        wrong[..., 0] = np.where(self.examined.signs != 0, by_price, wrong[..., 0])
        return wrong

    @cached_property
    def _pulling(self) -> list[tuple[Push, Truths]]:
        """Limits of the state, and where they pull: before, at the samples, and after."""
        found = [(push, push.pulls) for push in self.examined.pushes]
        return [(push, pulls) for push, pulls in found if pulls.any()]

    @cached_property
    def _to_leave(self) -> Truths:
        """Where time would be gained by leaving a speed or an opening, (n, dense, motors, 2)."""
        leave = np.zeros((*self.examined.torques.shape[:2], 3, 2), bool)
        for push, pulls in self._pulling:
            inside = pulls[1:-1].reshape(-1, len(DENSE))
            leave[push.held, :, push.entry.motor, int(not push.entry.of_speed)] |= inside
        return leave

    @property
    def _touched_in_vain(self) -> list[tuple[int, int]]:
        """(arc, motor) where a limit is touched that pulls."""
        return [(p.entry.arc, p.entry.motor) for p, _ in self._pulling if not p.held.any()]

    def _better(self, i: int, j: int) -> Arc:
        """What to hold at a sample: the best vertex or, where a torque has no limit and so no
        price, what is exceeded."""
        e, wrong, leave = self.examined, self._wrong[i, j], self._to_leave[i, j]
        arc = e.conditions.grid.arc[i]
        limits = list(e.conditions.structure.limits[arc])
        for k in range(3):
            if wrong[k, 1]:
                limits[k] = limits[k]._replace(speed=int(np.sign(e.rows[i, j, SPEED + k])))
            if wrong[k, 2]:
                limits[k] = limits[k]._replace(opening=1)
            if leave[k, 0]:
                limits[k] = limits[k]._replace(speed=0)
            if leave[k, 1]:
                limits[k] = limits[k]._replace(opening=0)
        if not leave[:, 1].any() and all(a != arc for a, _ in e.conditions.held.free):
            signs = self._vertex(i, j, tuple(limits))
            if signs is None:  # no torques hold all of this
                limits = [limit._replace(speed=0, opening=0) for limit in limits]
                signs = self._vertex(i, j, tuple(limits))
            if signs is not None:
                return tuple(
                    limit._replace(torque=s) for limit, s in zip(limits, signs, strict=True)
                )
        for k in range(3):
            if wrong[k, 0]:
                sign = -limits[k].torque or int(np.sign(e.torques[i, j, k]))
                limits[k] = limits[k]._replace(torque=sign)
        return tuple(limits)

    def _vertex(self, i: int, j: int, limits: Arc) -> list[int] | None:
        """Limits of torque, 1, -1 or 0, at which H is least of all that keep the speeds and
        openings which ``limits`` holds; None if nothing does."""
        e, J = self.examined, self._slopes[i, j]
        by_torque = np.linalg.inv(J[TORQUE : TORQUE + 3])
        row = e.conditions.held.row[e.conditions.grid.arc[i]]
        cost = -(e.prices[i, j] @ J[row]) @ by_torque
        states = [state for _, state in held_states(limits)]
        if len(states) > 3:
            return None
        plane, now = J[states] @ by_torque, e.torques[i, j]
        aim = plane @ now - e.rows[i, j, states]
        least, best = np.inf, None
        for held in combinations(range(3), 3 - len(states)):
            others = [k for k in range(3) if k not in held]
            square = plane[:, others]
            if abs(np.linalg.det(square)) < _FLAT:
                continue
            for signs in product((1.0, -1.0), repeat=len(held)):
                tau = np.zeros(3)
                tau[list(held)] = signs
                tau[others] = np.linalg.solve(square, aim - plane @ tau)
                if np.abs(tau).max() <= 1 + e.finest and cost @ tau < least:
                    least = float(cost @ tau)
                    best = [int(tau[k]) if k in held else 0 for k in range(3)]
        return best

    @cached_property
    def _slopes(self) -> Array:
        """Of the rows by A, (n, dense, rows, 3)."""
        e = self.examined
        y, stage = e.conditions.between(e.motion).reshape(-1, 9), e.conditions.stage
        J = stage.derivatives(y, np.zeros((len(y), stage.rows)), e.conditions.p)[1]
        return J[..., 6:].reshape(*e.torques.shape[:2], stage.rows, 3)
