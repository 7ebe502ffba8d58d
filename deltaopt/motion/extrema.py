"""The largest values of piecewise smooth functions of time, between samples too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from deltaopt.curves.piecewise import Array, Index

Curves = Callable[[Index, Array], Array]
"""(interval (N,), fraction of it (N,)) -> values (N, c) of c functions, smooth in an interval."""

_FEWEST_STEPS = 24  # in an interval: more than the 20 points of the definition of an excess
_FEWEST_IN_ALL = 240  # over all intervals, for motions of few long ones
_ROUNDS = 2  # of refinement, each by _ZOOM: the place of a peak is known to (1/64)² of a step
_ZOOM = 8.0
_NEAR = 1e-9
"""Share of the highest value by which a sample is taken to be nearer to it: rounding."""
_NARROW = 4.0
"""Steps between samples: a valley with a lesser half-width is looked into by itself. More is looked
into for nothing, less leaves peaks in it to the parabola through samples that miss them."""
_RIDGE_STEPS, _RIDGE_ROUNDS = 8, 15
"""Parts that the steps on both sides of a ridge's highest sample are cut into, and how often: its
top is then known to 4⁻¹⁵ of a step. More parts take fewer calls of the curves, and more points."""
_TAILS = 8.0
"""Half-widths of a valley that are looked at, at least, on both of its sides: Coulomb friction, of
which one is the change of sign, is constant to 1e-6 beyond."""
_WINDOW_STEPS = 24  # in a window of a valley
_VALLEY_ROUNDS = 4  # beyond (1/8)⁴ of a step rounding hides where a valley is lowest


class Peaks:
    """Largest value so far of each of c functions, and where: value, interval, fraction (c,)."""

    def __init__(self, functions: int) -> None:
        """Before anything was seen."""
        self.values, self.fractions = np.full(functions, -np.inf), np.zeros(functions)
        self.intervals: Index = np.zeros(functions, dtype=np.intp)

    def see(self, intervals: Index, fractions: Array, values: Array) -> None:
        """Keep what is larger among values (N, c)."""
        rows = np.argmax(values, axis=0)
        found = values[rows, np.arange(values.shape[1])]
        self.see_each(intervals[rows], fractions[rows], found)

    def see_each(self, intervals: Index, fractions: Array, values: Array) -> None:
        """Keep what is larger among one value of each function, (c,) each."""
        better = values > self.values
        self.values = np.where(better, values, self.values)
        self.intervals = np.where(better, intervals, self.intervals)
        self.fractions = np.where(better, fractions, self.fractions)


def enough(intervals: int, fewest: int) -> int:
    """So many, but ``fewest`` at least, in each of so many intervals that all are well seen."""
    return max(fewest, -(-_FEWEST_IN_ALL // intervals))


@lru_cache(maxsize=64)
def sample_fractions(intervals: int, degree: int = 5) -> Array:
    """Where to sample each of so many intervals: both ends and at least 20 points inside, more in
    polynomials of a higher degree: what is wrong with these changes its sign between nodes, which
    are some 1/degree² apart at their ends."""
    return np.linspace(0.0, 1.0, enough(intervals, max(_FEWEST_STEPS, degree**2 - 1)) + 1)


def everywhere(intervals: int, fractions: Array) -> tuple[Index, Array]:
    """These fractions (n,) of every interval: interval and fraction, (K · n,) each."""
    return np.repeat(np.arange(intervals), len(fractions)), np.tile(fractions, intervals)


def peaks(curves: Curves, fractions: Array, values: Array) -> Peaks:
    """Climb every hill between samples that may be the highest.

    ``values``: of the curves at ``everywhere`` of these fractions, evenly spaced, (K · n, c).
    The top of the parabola through three neighbours is the next middle, with neighbours
    8 times as close, twice: for a smooth function the value is then right to about 1e-12.
    """
    intervals = len(values) // len(fractions)
    highest = Peaks(values.shape[1])
    highest.see(*everywhere(intervals, fractions), values)
    if np.isfinite(values).all():
        grid = values.reshape(intervals, len(fractions), -1)
        _climb(curves, highest, *_hills(grid, highest.values))
    return highest


def ridges(curves: Curves, fractions: Array, values: Array) -> Peaks:
    """The largest values of c curves that rise to a kink and fall behind it: no parabola through
    samples leads to the top of a ridge.

    ``values``: of the curves at ``everywhere`` of these fractions, evenly spaced, (K · n, c). Every
    sample that is as high as those beside it is looked about whose ridge, if it rises as steeply
    between samples as beside them, may be the highest.
    """
    grid = values.reshape(-1, len(fractions), values.shape[1])
    beside = np.pad(grid, ((0, 0), (1, 1), (0, 0)), constant_values=-np.inf)
    top = (grid >= beside[:, :-2]) & (grid >= beside[:, 2:])
    falls = np.abs(np.diff(grid, axis=1)).max(axis=(0, 1))
    highest = Peaks(values.shape[1])
    highest.see(*everywhere(len(grid), fractions), values)
    interval, sample, function = np.nonzero(top & (grid + falls >= highest.values))
    where, step = fractions[sample], float(fractions[1] - fractions[0])
    parts = np.linspace(-1.0, 1.0, _RIDGE_STEPS + 1)
    for _ in range(_RIDGE_ROUNDS):
        places = np.clip(where[:, None] + step * parts, 0.0, 1.0)
        own = np.repeat(np.arange(len(where)), len(parts))
        found = curves(interval[own], places.ravel())[np.arange(len(own)), function[own]]
        near = found.reshape(places.shape)
        best = near.argmax(axis=1)
        height, where = near.max(axis=1), places[np.arange(len(where)), best]
        tops = np.where(function[:, None] == np.arange(values.shape[1]), height[:, None], -np.inf)
        highest.see(interval, where, tops)
        falls_here = np.abs(np.diff(near, axis=1)).max(axis=1)
        kept = height + falls_here >= highest.values[function]
        interval, function, where = interval[kept], function[kept], where[kept]
        step *= 2 / _RIDGE_STEPS
    return highest


@dataclass(frozen=True)
class Windows:
    """Parts of intervals, (N,) each: which interval, and fractions where a part begins and ends."""

    intervals: Index
    begin: Array
    end: Array

    def let_see(self, highest: Peaks, curves: Curves) -> None:
        """Let the highest values so far see the peaks of curves in all windows."""
        if not len(self.begin):
            return

        def inside(windows: Index, fractions: Array) -> Array:
            begin, end = self.begin[windows], self.end[windows]
            return curves(self.intervals[windows], begin + fractions * (end - begin))

        fractions = np.linspace(0.0, 1.0, _WINDOW_STEPS + 1)
        found = peaks(inside, fractions, inside(*everywhere(len(self.begin), fractions)))
        begin, end = self.begin[found.intervals], self.end[found.intervals]
        places = begin + found.fractions * (end - begin)
        highest.see_each(self.intervals[found.intervals], places, found.values)


def narrow_valleys(curves: Curves, fractions: Array, values: Array) -> Windows:
    """Windows about minima of curves that are narrower than samples show, closer to them smaller.

    ``values``: of curves that are not negative, at ``everywhere`` of these fractions, evenly
    spaced, (K · n, c). The half-width of a valley is where its curve is twice the least: functions
    of it that grow without bound at zero, or change within a half-width, peak there, however far
    samples are apart. The windows begin at 4 steps from the minimum, or 8 half-widths if these are
    more, each half as wide as the one before.
    """
    grid = values.reshape(-1, len(fractions), values.shape[1])
    left, middle, right = grid[:, :-2], grid[:, 1:-1], grid[:, 2:]
    curvature = left - 2 * middle + right
    if 2 * values.min() >= (_NARROW**2 + 1) * curvature.max():  # no parabola reaches so far down
        return Windows(np.zeros(0, np.intp), np.zeros(0), np.zeros(0))
    slope, bent = left - right, np.where(curvature > 0, curvature, np.inf)
    offset, least = slope / (2 * bent), middle - slope**2 / (8 * bent)
    near = np.abs(offset) <= 1
    beside = np.maximum(_NARROW, _TAILS * np.sqrt(2 * np.maximum(least, 0.0) / bent))
    near[:, 0] |= (-1 - beside[:, 0] <= offset[:, 0]) & (offset[:, 0] <= 1)
    near[:, -1] |= (offset[:, -1] <= 1 + beside[:, -1]) & (offset[:, -1] >= -1)  # a part is within
    narrow = (curvature > 0) & near & (2 * least < _NARROW**2 * curvature)
    interval, sample, function = np.nonzero(narrow)
    step = 1 / (len(fractions) - 1)
    if not len(interval):
        return Windows(interval, np.zeros(0), np.zeros(0))
    bottom = (sample + 1 + offset[narrow]) * step
    bottom, width = _bottoms(curves, interval, function, bottom, step)
    widest = max(_NARROW * step, _TAILS * float(width.max()))
    return _graded(interval, bottom, widest, float(width.min()) / 4)


def _bottoms(
    curves: Curves, interval: Index, function: Index, bottom: Array, step: float
) -> tuple[Array, Array]:
    """Where valleys are lowest, fractions, and their half-widths, (N,) each. The bottom of a valley
    of which an interval holds a side alone is outside of it, by the parabola at its end."""
    n, width = len(interval), np.full(len(interval), step)
    for _ in range(_VALLEY_ROUNDS):
        step /= _ZOOM
        bottom = np.clip(bottom, step, 1 - step)
        places = np.concatenate([bottom - step, bottom, bottom + step])
        values = curves(np.tile(interval, 3), places)
        left, middle, right = values[np.arange(3 * n), np.tile(function, 3)].reshape(3, n)
        # Less curvature than rounding is none: the quotients below would overflow.
        rounding = np.finfo(float).eps * (np.abs(left) + np.abs(right)) + np.finfo(float).tiny
        curvature = np.maximum(left - 2 * middle + right, rounding)
        least_offset = np.where(bottom <= step, -np.inf, -1.0)
        largest_offset = np.where(bottom >= 1 - step, np.inf, 1.0)
        offset = np.clip((left - right) / (2 * curvature), least_offset, largest_offset)
        least = np.maximum(middle - curvature * offset**2 / 2, 0.0)
        bottom, width = bottom + offset * step, np.sqrt(2 * least / curvature) * step
    return bottom, width


def _graded(interval: Index, bottom: Array, widest: float, narrowest: float) -> Windows:
    """On both sides of each bottom windows from the widest, halved until the narrowest."""
    narrowest = min(max(narrowest, widest * 2.0**-30), widest)  # a flat bottom has no width
    halvings = int(np.ceil(np.log2(widest / narrowest))) + 1
    away = widest * 2.0 ** -np.arange(halvings)
    edges = np.concatenate([-away, away[::-1]]) + bottom[:, None]
    edges = np.clip(edges, 0.0, 1.0)
    begin, end = edges[:, :-1].ravel(), edges[:, 1:].ravel()
    kept = end > begin
    return Windows(np.repeat(interval, edges.shape[1] - 1)[kept], begin[kept], end[kept])


def _hills(grid: Array, highest: Array) -> tuple[Index, Index, Array, float]:
    """Hills in samples (K, n, c) that may top the highest (c,): interval, function, fraction
    of the top (N,) each, and the step between samples."""
    near = grid[:, :-2] - grid[:, 2:]
    # What follows asks of a hill that |slope| <= 2 |curvature|, so that its gain is at most
    # |slope| / 4: most samples are far too low for that.
    np.abs(near, out=near)
    near += grid[:, 1:-1]
    where = np.flatnonzero(near >= highest - _NEAR * np.abs(highest))
    interval, rest = np.divmod(where, near[0].size)
    sample, function = np.divmod(rest, len(highest))
    values, at = grid.ravel(), where + len(highest) * (2 * interval + 1)  # two samples less in each
    left, middle, right = values[at - len(highest)], values[at], values[at + len(highest)]
    slope = left - right
    curvature = left - 2 * middle + right
    bent = np.where(curvature < 0, curvature, -np.inf)
    offset, gain = slope / (2 * bent), -(slope**2) / (8 * bent)
    hill = (curvature < 0) & (np.abs(offset) <= 1) & (gain > 1e-13 * np.abs(middle))
    # 4: a guess of the gain, not a bound
    may_win = hill & (middle + 4 * gain >= highest[function])
    step = 1 / (grid.shape[1] - 1)
    top = (sample[may_win] + 1 + offset[may_win]) * step
    return interval[may_win], function[may_win], top, step


def _climb(
    curves: Curves, highest: Peaks, interval: Index, function: Index, top: Array, step: float
) -> None:
    """Close in on the tops of hills, (N,) each, and let ``highest`` see all on the way."""
    n = len(interval)
    if n == 0:
        return
    for _ in range(_ROUNDS):
        step /= _ZOOM
        top = np.clip(top, step, 1 - step)
        where = np.tile(interval, 3), np.concatenate([top - step, top, top + step])
        values = curves(*where)
        highest.see(*where, values)
        if not np.isfinite(values).all():
            return  # nothing can be higher
        left, middle, right = values[np.arange(3 * n), np.tile(function, 3)].reshape(3, n)
        curvature = left - 2 * middle + right
        bent = np.where(curvature < 0, curvature, -np.inf)
        top = top + np.clip((left - right) / (2 * bent), -1, 1) * step
    highest.see(interval, np.clip(top, 0, 1), curves(interval, np.clip(top, 0, 1)))
