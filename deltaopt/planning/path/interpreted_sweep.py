"""The sweep of ``sweep.c``, function by function, where there is no compiler: a hundred times as
slow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.planning.path.path_rows import AffineRows

_LARGE, _VANISHING, _ROUNDING, _STEPS = 1e30, 1e-13, 1e-12, 60
_LOSING, _STEEPEST = 0.1, 50.0

Range = tuple[float, float]
_NOTHING = (1.0, 0.0)


def interpreted(
    h: Array, rows: AffineRows, start: float, goal: float, most: float, convex: bool
) -> tuple[Array, Array] | int | None:
    """b at the nodes, (N + 1,), and u at both ends of every cell, (N, 2); the node where no speed
    is possible; or None where the motion cannot begin at b = ``start``."""
    n, sweep = len(h), _Sweep(h, rows, convex)
    K: list[Range] = [_NOTHING] * (n + 1)
    K[n] = sweep.allowed(2 * n - 1, (goal, goal))
    for i in range(n, -1, -1):
        if i < n:
            K[i] = sweep.controllable(i, (0.0, most), K[i + 1])
        if _is_empty(K[i]):
            return i
    slack = _ROUNDING * (1 + K[0][1])
    if not K[0][0] - slack <= start <= K[0][1] + slack:
        return None
    b, u = np.empty(n + 1), np.empty((n, 2))
    b[0] = start
    for i in range(n):
        low, high = sweep.reachable(i, b[i], K[i + 1]).b
        b[i + 1] = min(max(high if high >= low else (high + low) / 2, K[i + 1][0]), K[i + 1][1])
        u[i] = sweep.accelerations_between(i, b[i], b[i + 1])
    return b, u


def _is_empty(b: Range) -> bool:
    return b[0] > b[1] + _ROUNDING * (abs(b[0]) + abs(b[1]))


@dataclass(frozen=True)
class _Sweep:
    h: Array
    rows: AffineRows
    convex: bool

    def accelerations(self, end: int, b: float) -> tuple[Range, Range]:
        """The u that the rows at an end of a cell allow at b, and their slopes by b."""
        a, by = self.rows.alpha[end], self.rows.beta[end]
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (self.rows.high[end] - by * b) / a, (self.rows.low[end] - by * b) / a
            slope = -by / a
        counts = np.abs(a) >= _VANISHING
        most = np.where(counts, np.where(a > 0, one, other), _LARGE)
        least = np.where(counts, np.where(a > 0, other, one), -_LARGE)
        top, bottom = int(most.argmin()), int(least.argmax())
        u, slopes = (least[bottom], most[top]), (slope[bottom], slope[top])
        none = (u[0] <= -_LARGE, u[1] >= _LARGE)
        (low, high), (at_low, at_high) = u, slopes
        return (
            (max(low, -_LARGE), min(high, _LARGE)),
            (0.0 if none[0] else at_low, 0.0 if none[1] else at_high),
        )

    @staticmethod
    def narrowed(b: Range, factor: Array, bound: Array) -> Range:
        """The part of a range where factor b <= bound."""
        reach = _Reach(*b)
        reach.narrow(factor, bound, np.zeros_like(bound))
        return reach.b

    def allowed(self, end: int, b: Range) -> Range:
        """The part of a range where the rows of an end allow some u."""
        a, by = self.rows.alpha[end], self.rows.beta[end]
        low, high = self.rows.low[end], self.rows.high[end]
        still = np.abs(a) < _VANISHING
        b = self.narrowed(b, by[still], high[still])
        b = self.narrowed(b, -by[still], -low[still])
        fixed = still & (np.abs(by) < _VANISHING)
        if (fixed & ((high < -_ROUNDING) | (low > _ROUNDING))).any():
            return _NOTHING
        if _is_empty(b):
            return b
        ends = [b[1], b[0]]
        for side, sign in ((0, -1), (1, 1)):
            for _ in range(_STEPS):
                u, slope = self.accelerations(end, ends[side])
                room, rate = u[1] - u[0], slope[1] - slope[0]
                if room >= -_ROUNDING * (abs(u[0]) + abs(u[1])):
                    break
                if sign * rate <= 0:
                    return _NOTHING
                ends[side] -= room / rate
        if ends[0] < ends[1]:
            u, _ = self.accelerations(end, ends[1])
            ends[0] = ends[1] if u[1] >= u[0] else ends[0]
        return ends[1], ends[0]

    def steepest(self, cell: int) -> float:
        """By how much u may change in a cell; infinite for any change."""
        if not self.convex:
            return np.inf
        a = np.abs(self.rows.alpha[2 * cell : 2 * cell + 2])
        width = (self.rows.high - self.rows.low)[2 * cell : 2 * cell + 2]
        there = a > _VANISHING
        u_range = float((width[there] / a[there]).min(initial=np.inf))
        if u_range < np.inf and (there.any(axis=0) & (a.min(axis=0) * u_range < _LOSING)).any():
            return float(_STEEPEST * self.h[cell] * u_range)
        return np.inf

    def reachable(self, cell: int, b: float, within: Range) -> _Reach:
        """The b at the end of a cell that can be reached from b at its begin, with slopes by b."""
        (slow, fast), by = self.accelerations(2 * cell, b)
        end, h, found = 2 * cell + 1, self.h[cell], _Reach(*within)
        a, beta = self.rows.alpha[end], self.rows.beta[end]
        low, high = self.rows.low[end], self.rows.high[end]
        still = fast >= _LARGE and slow <= -_LARGE
        change = 0.0 if still else self.steepest(cell)
        if not still:
            up, down = (fast, by[1]), (slow, by[0])
            above, below = np.where(a > 0, *_pairs(up, down)), np.where(a > 0, *_pairs(down, up))
            found.narrow(a + h * beta, h * high + a * (b + h * above[0]), a * (1 + h * above[1]))
            lowest, rate = -a * (b + h * below[0]), -a * (1 + h * below[1])
            found.narrow(-a - h * beta, lowest - h * low, rate)
        if change < np.inf:
            more = np.abs(a) * h * change
            found.narrow(a + 2 * h * beta, 2 * h * high + a * b + more, a)
            found.narrow(-a - 2 * h * beta, -2 * h * low - a * b + more, -a)
        if np.abs(a).max() < _VANISHING:
            change = 0.0
        if not still and change < np.inf:
            bounds = np.array([b + h * (2 * fast + change), -b - h * (2 * slow - change)])
            rates = np.array([1 + 2 * h * by[1], -1 - 2 * h * by[0]])
            found.narrow(np.array([1.0, -1.0]), bounds, rates)
        return found

    def controllable(self, cell: int, b: Range, target: Range) -> Range:
        """The b at the begin of a cell from which a range at its end can be reached."""
        b = self.allowed(2 * cell, b)
        if cell:
            b = self.allowed(2 * cell - 1, b)
        if _is_empty(b):
            return b
        low, high = b
        for sign in (-1, 1):
            for _ in range(_STEPS):
                at = high if sign < 0 else low
                reach = self.reachable(cell, at, target)
                room, rate = reach.room
                if room >= -_ROUNDING * (abs(reach.low) + abs(reach.high) + at):
                    break
                if sign * rate <= 0:
                    return _NOTHING
                root = at - room / rate
                if abs(root - at) <= _ROUNDING * at:
                    break
                if high <= low:
                    return _NOTHING
                at = max(low, min(high, root))
                low, high = (low, at) if sign < 0 else (at, high)
            else:
                return _NOTHING
        return low, high

    def accelerations_between(self, cell: int, b0: float, b1: float) -> Range:
        """u at both ends of a cell, as even as the rows allow."""
        (slow0, fast0), _ = self.accelerations(2 * cell, b0)
        (slow1, fast1), _ = self.accelerations(2 * cell + 1, b1)
        total, change = (b1 - b0) / self.h[cell], self.steepest(cell)
        least = max(slow0, total - fast1, (total - change) / 2)
        most = min(fast0, total - slow1, (total + change) / 2)
        first = (least + most) / 2 if least > most else max(min(total / 2, most), least)
        return first, total - first


def _pairs(one: Range, other: Range) -> tuple[Array, Array]:
    """Each as a column, to choose from for many rows."""
    return np.array(one)[:, None], np.array(other)[:, None]


@dataclass
class _Reach:
    """A range, and slopes of its ends; ``spare``: of bounds that do not depend on what is in the
    range the least, negative where it is exceeded, and its slope."""

    low: float
    high: float
    slopes: Range = (0.0, 0.0)
    spare: tuple[float, float] = (np.inf, 0.0)

    @property
    def b(self) -> Range:
        return self.low, self.high

    @property
    def room(self) -> tuple[float, float]:
        """What is left, negative for nothing, and its slope."""
        return min((self.high - self.low, self.slopes[1] - self.slopes[0]), self.spare)

    def narrow(self, factor: Array, bound: Array, rate: Array) -> None:
        """Leave the part where factor b <= bound, which changes at a ``rate``."""
        with np.errstate(divide="ignore", invalid="ignore"):
            at, slope = bound / factor, rate / factor
        above = np.where(factor > _VANISHING, at, np.inf)
        below = np.where(factor < -_VANISHING, at, -np.inf)
        neither = np.where(np.abs(factor) <= _VANISHING, bound, np.inf)
        if above.min(initial=np.inf) < self.high:
            self.high, self.slopes = float(above.min()), (self.slopes[0], slope[above.argmin()])
        if below.max(initial=-np.inf) > self.low:
            self.low, self.slopes = float(below.max()), (slope[below.argmax()], self.slopes[1])
        if neither.min(initial=np.inf) < self.spare[0]:
            self.spare = float(neither.min()), float(rate[neither.argmin()])
