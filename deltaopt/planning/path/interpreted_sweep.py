"""The sweep of ``sweep.c``, function by function, where there is no compiler: a hundred times as
slow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deltaopt.planning.path.path_rows import AffineRows
from deltaopt.scene.path import Array

_LARGE, _VANISHING, _ROUNDING, _HALVINGS = 1e30, 1e-13, 1e-12, 60

Range = tuple[float, float]
_NOTHING = (1.0, 0.0)


def interpreted(
    h: Array, rows: AffineRows, start: float, goal: float, most: float
) -> tuple[Array, Array] | int | None:
    """b at the nodes, (N + 1,), and u at both ends of every cell, (N, 2); the node where no speed
    is possible; or None where the motion cannot begin at b = ``start``."""
    n, sweep = len(h), _Sweep(h, rows)
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
        low, high = sweep.reachable(i, b[i], K[i + 1])
        b[i + 1] = min(max(high if high >= low else (high + low) / 2, K[i + 1][0]), K[i + 1][1])
        u[i] = sweep.accelerations_between(i, b[i], b[i + 1])
    return b, u


def _is_empty(b: Range) -> bool:
    return b[0] > b[1] + _ROUNDING * (abs(b[0]) + abs(b[1]))


@dataclass(frozen=True)
class _Sweep:
    h: Array
    rows: AffineRows

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
        with np.errstate(divide="ignore", invalid="ignore"):
            at = bound / factor
        high = np.where(factor > _VANISHING, at, np.inf).min(initial=b[1])
        low = np.where(factor < -_VANISHING, at, -np.inf).max(initial=b[0])
        return float(low), float(high)

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
            for _ in range(_HALVINGS):
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

    def reachable(self, cell: int, b: float, within: Range) -> Range:
        """The b at the end of a cell that can be reached from b at its begin."""
        (slow, fast), _ = self.accelerations(2 * cell, b)
        end, h = 2 * cell + 1, self.h[cell]
        still = fast >= _LARGE and slow <= -_LARGE
        step, a = (2 * h if still else h), self.rows.alpha[end]
        factor = a + step * self.rows.beta[end]
        fastest, slowest = (b, b) if still else (b + h * fast, b + h * slow)
        up, down = np.where(a > 0, fastest, slowest), np.where(a > 0, slowest, fastest)
        within = self.narrowed(within, factor, step * self.rows.high[end] + a * up)
        within = self.narrowed(within, -factor, -step * self.rows.low[end] - a * down)
        if np.abs(a).max() < _VANISHING:
            within = max(within[0], b + 2 * h * slow), min(within[1], b + 2 * h * fast)
        return within

    def slowing(self, cell: int, b: float) -> tuple[float, float]:
        u, slope = self.accelerations(2 * cell + 1, b)
        return b - self.h[cell] * u[0], 1 - self.h[cell] * slope[0]

    def most_slowing(self, cell: int, b: Range) -> float:
        most, rate = self.slowing(cell, b[1])
        if rate >= 0:
            return most
        low, high = b
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            value, rate = self.slowing(cell, middle)
            most = max(most, value)
            low, high = (middle, high) if rate > 0 else (low, middle)
        return most

    def controllable(self, cell: int, b: Range, target: Range) -> Range:
        """The b at the begin of a cell from which a range at its end can be reached."""
        begin, h, most = 2 * cell, self.h[cell], self.most_slowing(cell, target)
        a, factor = self.rows.alpha[begin], self.rows.alpha[begin] - h * self.rows.beta[begin]
        up = a > 0
        b = self.narrowed(b, factor[up], a[up] * most - h * self.rows.low[begin][up])
        down = np.logical_not(up)
        b = self.narrowed(b, -factor[down], -a[down] * most + h * self.rows.high[begin][down])
        b = self.allowed(begin, b)
        if cell:
            b = self.allowed(begin - 1, b)
        if _is_empty(b):
            return b

        def reaches(at: float) -> bool:
            return not _is_empty(self.reachable(cell, at, target))

        ends = [reaches(each) for each in b]
        if all(ends):
            return b
        shares = np.concatenate([np.arange(1, 64), 2.0 ** -np.arange(1, 66)]) / 64
        places = (b[0] + (b[1] - b[0]) * shares).tolist()
        inside = b[1] if ends[1] else next((each for each in places if reaches(each)), None)
        if inside is None:
            return _NOTHING
        low, high = (
            each if good else _border(reaches, inside, each)
            for each, good in zip(b, ends, strict=True)
        )
        return low, high

    def accelerations_between(self, cell: int, b0: float, b1: float) -> Range:
        """u at both ends of a cell, as even as the rows allow."""
        (slow0, fast0), _ = self.accelerations(2 * cell, b0)
        (slow1, fast1), _ = self.accelerations(2 * cell + 1, b1)
        total = (b1 - b0) / self.h[cell]
        least, most = max(slow0, total - fast1), min(fast0, total - slow1)
        first = (least + most) / 2 if least > most else max(min(total / 2, most), least)
        return first, total - first


def _border(reaches: Callable[[float], bool], does: float, does_not: float) -> float:
    for _ in range(_HALVINGS):
        middle = (does + does_not) / 2
        does, does_not = (middle, does_not) if reaches(middle) else (does, middle)
    return does
