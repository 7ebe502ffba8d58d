"""Halving: of an interval until a change is found, and of parts until enough is known of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self, TypeVar

import numpy as np

from deltaopt.curves.bernstein import parts_of
from deltaopt.curves.piecewise import Array, Index, PiecewisePolynomial, Truths


def bisected_number(
    is_beyond: Callable[[float], bool], low: float, high: float, bisections: int
) -> tuple[float, float]:
    """One interval about where something changes, halved: its ends.

    ``is_beyond``: of a place, whether it has changed there already.
    """
    for _ in range(bisections):
        middle = (low + high) / 2
        low, high = (low, middle) if is_beyond(middle) else (middle, high)
    return low, high


def nearest_on_lines(
    gradient: Callable[[Array], Array], begin: Array, way: Array, error: float
) -> Array:
    """At which shares of lines, from 0 to 1, a convex function is least, (…), to within an error of
    its value.

    Where its slope changes sign is found by Ridders' method, which halves an interval at least, and
    is of second order where the slope is smooth. A convex function is nowhere in an interval less
    than at one of its places by more than its slope there times the interval.

    ``gradient``: of the function at places (N, 3). ``begin``, ``way``: of the lines, (…, 3).
    """
    low, high = np.zeros(begin.shape[:-1]), np.ones(begin.shape[:-1])

    def slopes(share: Array, which: Truths) -> Array:
        own = way[which]
        return np.asarray((gradient(begin[which] + share[:, None] * own) * own).sum(axis=1))

    everywhere = np.ones(low.shape, dtype=np.bool)
    falling = slopes(low.ravel(), everywhere).reshape(low.shape)
    rising = slopes(high.ravel(), everywhere).reshape(low.shape)
    share = np.where(falling < 0, high, low)
    is_open = (falling < 0) & (rising > 0)
    while is_open.any():
        a, b, down, up = (each[is_open] for each in (low, high, falling, rising))
        middle = (a + b) / 2
        there = slopes(middle, is_open)
        place = middle - (b - a) / 2 * there / np.sqrt(there**2 - down * up)
        slope = slopes(place, is_open)
        for each, its_slope in ((middle, there), (place, slope)):
            rises = its_slope > 0
            a, down = np.where(rises, a, each), np.where(rises, down, its_slope)
            b, up = np.where(rises, each, b), np.where(rises, its_slope, up)
        low[is_open], high[is_open], falling[is_open], rising[is_open] = a, b, down, up
        share[is_open] = place
        is_open[is_open] = np.abs(slope) * (b - a) > error
    return share


@dataclass(frozen=True)
class Parts:
    """Parts of a curve about places: piece, how far it is in it, half of the part, (N,) each."""

    curve: PiecewisePolynomial
    piece: Index
    since: Array
    half: Array

    @classmethod
    def of(cls, curve: PiecewisePolynomial, first: int) -> Self:
        """So many equal parts of each piece."""
        lengths = np.diff(curve.knots)
        piece = np.repeat(np.arange(len(lengths)), first)
        half = lengths[piece] / (2 * first)
        since = half * (2 * np.tile(np.arange(first), len(lengths)) + 1)
        return cls(curve, piece, since, half)

    def __len__(self) -> int:
        return len(self.half)

    @property
    def middles(self) -> Array:
        """The middle of each, (N,)."""
        return np.asarray(self.curve.knots[self.piece] + self.since)

    def at(self, order: int = 0) -> Array:
        """Values of the curve in the middles, or derivatives, (N, m)."""
        return self.curve.inside(self.piece, self.since, order)

    def halved(self, which: Truths) -> Self:
        """Both halves of some of them, (N,): all first halves, then all second ones."""
        piece, since, half = self.piece[which], self.since[which], self.half[which] / 2
        both = np.concatenate([since - half, since + half])
        return replace(self, piece=np.tile(piece, 2), since=both, half=np.tile(half, 2))

    def control_points(self) -> Array:
        """Of the curve in each part, by Bernstein's form, (N, d + 1, m)."""
        own = self.curve.coefficients[self.piece]
        return parts_of(own, self.since - self.half, 2 * self.half)

    def largest(self, order: int) -> Array:
        """What the norm of a derivative of the curve is at most in each part, by its Taylor series
        about the middle, (N,)."""
        found, share = np.zeros(len(self)), np.ones(len(self))
        for above in range(self.curve.coefficients.shape[1] - order):
            found += share * np.linalg.norm(self.at(order + above), axis=1)
            share = share * self.half / (above + 1)
        return found


P = TypeVar("P", bound=Parts)


def halve_until_known(
    parts: P, look: Callable[[P, bool], Truths], halvings: int, most: int
) -> None:
    """Look at parts, and at the halves of those that are not known then, until all are known.

    ``look``: of parts, and whether this is the last time, because ``halvings`` are done or ``most``
    parts were seen: which of them are not known, (N,). What is not known at last is up to it.
    """
    seen = 0
    for halving in range(halvings + 1):
        seen += len(parts)
        is_last = halving == halvings or seen > most
        unknown = look(parts, is_last)
        if is_last or not unknown.any():
            return
        parts = parts.halved(unknown)


def surely_largest(
    parts: P,
    look: Callable[[P], tuple[Array, Array, Array]],
    allowed: float,
    *,
    known: Callable[[Array], Array],
    halvings: int,
    most: int,
    fewest: int = 0,
) -> tuple[float, float]:
    """The largest value of some measures at all places of parts, and a number that says where.

    It is one that is reached, where they are known to be at most what is ``allowed`` at all others,
    and otherwise a bound that no place exceeds.

    ``look``: of N parts: values of c measures somewhere in each, (N, c), where that is, (N,), and
    what they are at most in all of the part, (N, c). ``known``: of excesses over what is allowed,
    up to which other excesses these are well known. ``halvings``, ``most``: as
    ``halve_until_known`` has them. ``fewest``: parts that are looked at in any case.
    """
    found, seen = (-np.inf, np.nan), 0

    def unknown(parts: P, is_last: bool) -> Truths:
        nonlocal found, seen
        value, where, bound = look(parts)
        over, beyond = value - allowed, bound - allowed
        is_open = ~((beyond <= 0) | ((over > 0) & (beyond <= known(over))))
        told = np.where(is_open & is_last, bound, value).max(axis=1)
        worst = int(told.argmax())
        if not told[worst] <= found[0]:
            found = float(told[worst]), float(where[worst])
        seen += len(parts)
        return np.asarray(is_open.any(axis=1) | (seen < fewest))

    halve_until_known(parts, unknown, halvings, most)
    return found
