"""Curves made of polynomials, and the polynomials that meet given values and derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Truths = NDArray[np.bool]

QUINTIC = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
"""Coefficients of the share of a way at u = t / duration, ascending powers: at rest and without
acceleration at both ends."""


@dataclass(frozen=True, eq=False)
class PiecewisePolynomial:
    """K polynomials of degree d of one parameter, often time, in m components.

    ``knots``: parameters where the polynomials meet, increasing, (K + 1,). ``coefficients``: of the
    ascending powers of the parameter since the piece began, (K, d + 1, m). It is equal to one of
    the same numbers, to the last bit.
    """

    knots: Array
    coefficients: Array

    def __eq__(self, other: object) -> bool:
        return isinstance(other, PiecewisePolynomial) and self._bits == other._bits

    def __hash__(self) -> int:
        return hash(self._bits)

    @property
    def _bits(self) -> tuple[object, ...]:
        """All numbers, and how they are ordered."""
        return self.coefficients.shape, self.knots.tobytes(), self.coefficients.tobytes()

    @classmethod
    def hermite(cls, knots: Array, x: Array, v: Array, a: Array | None = None) -> Self:
        """Through values x with derivatives v, and second ones a if they are given, at the knots,
        (K + 1, m) each: cubics, or quintics."""
        columns = [each for each in (x, v, a) if each is not None]
        begin, end = [each[:-1] for each in columns], [each[1:] for each in columns]
        return cls(knots, hermite_pieces(np.diff(knots), begin, end))

    @cached_property
    def _derivatives(self) -> list[Array]:
        """Coefficients of the values and of all derivatives that are not zero everywhere."""
        found = [self.coefficients]
        while found[-1].shape[1] > 1:
            found.append(found[-1][:, 1:] * np.arange(1, found[-1].shape[1])[:, None])
        return found

    def derivative(self) -> PiecewisePolynomial:
        """The derivative by the parameter, a piecewise polynomial of one degree less."""
        powers = np.arange(1, self.coefficients.shape[1])
        return replace(self, coefficients=self.coefficients[:, 1:] * powers[:, None])

    def slowed(self, factor: float) -> PiecewisePolynomial:
        """These values passed ``factor`` times as slowly: the duration grows by that factor."""
        powers = np.vander([factor], self.coefficients.shape[1], increasing=True).T
        return PiecewisePolynomial(self.knots * factor, self.coefficients / powers)

    def at(self, t: ArrayLike, order: int = 0) -> Array:
        """Values or derivatives of an order, (N, m), at parameters (N,) between the first knot and
        the last; at a knot those of the piece that begins there, if any."""
        places = np.atleast_1d(np.asarray(t, dtype=float))
        pieces = self.interval(places)
        return self.inside(pieces, places - self.knots[pieces], order)

    def with_rate_at(self, t: Array) -> tuple[Array, Array]:
        """Values and their derivatives, (N, m) each, at parameters (N,)."""
        intervals = self.interval(t)
        since = t - self.knots[intervals]
        return self.inside(intervals, since), self.inside(intervals, since, 1)

    def after(self, t: float) -> PiecewisePolynomial:
        """What follows a parameter ``t`` between the first knot and the last, from 0 on."""
        first = int(self.interval(np.array([t]))[0])
        coefficients = self.coefficients[first:].copy()
        coefficients[0] = shifted(coefficients[0], t - self.knots[first])
        return PiecewisePolynomial(np.append(0.0, self.knots[first + 1 :] - t), coefficients)

    def then(self, other: PiecewisePolynomial) -> PiecewisePolynomial:
        """This and after it another, whose own knots count from its beginning."""
        powers = max(self.coefficients.shape[1], other.coefficients.shape[1])
        both = [
            np.pad(each.coefficients, ((0, 0), (0, powers - each.coefficients.shape[1]), (0, 0)))
            for each in (self, other)
        ]
        later = self.knots[-1] + (other.knots[1:] - other.knots[0])
        return PiecewisePolynomial(np.append(self.knots, later), np.concatenate(both))

    def interval(self, t: Array) -> Index:
        """The piece of each parameter, (N,); at a knot the piece that begins there, if any."""
        last = len(self.knots) - 2
        return np.clip(np.searchsorted(self.knots, t, side="right") - 1, 0, last)

    def everywhere(self, fractions: ArrayLike) -> tuple[Index, Array]:
        """Places at fractions, (n,), of every piece: the piece, and what the parameter has grown by
        since it began, (K · n,) each."""
        lengths, shares = np.diff(self.knots), np.asarray(fractions, dtype=float)
        return np.repeat(np.arange(len(lengths)), len(shares)), (lengths[:, None] * shares).ravel()

    def inside(self, intervals: Index, since: Array, order: int = 0) -> Array:
        """Values or derivatives of an order, (N, m), in given pieces, (N,), at what the parameter
        has grown by since they began, (N,)."""
        m = self.coefficients.shape[2]
        if order >= len(self._derivatives):
            return np.zeros((len(since), m))
        factor = np.repeat(since, m).reshape(-1, m)  # faster than to broadcast over so few columns
        *lower, highest = self._derivatives[order].swapaxes(0, 1)
        values: Array = highest.take(intervals, axis=0)
        for coefficient in reversed(lower):  # Horner
            values *= factor
            values += coefficient.take(intervals, axis=0)
        return values

    @classmethod
    def in_thirds(cls, knots: Array, x: Array, v: Array, a: Array) -> Self:
        """Through values x with derivatives v and second ones a at the knots, (K + 1, m) each:
        three cubics of equal length between two, whose second derivatives are continuous."""
        third = np.diff(knots)[:, None] / 3
        step = (x[1:] - x[:-1]) / third**2
        first = step - (2 * v[:-1] + v[1:]) / third - 5 / 6 * a[:-1] + a[1:] / 3
        second = -step + (v[:-1] + 2 * v[1:]) / third + a[:-1] / 3 - 5 / 6 * a[1:]
        bends = np.stack([a[:-1], first, second, a[1:]], axis=1)  # at the ends of thirds
        rate, value, pieces = v[:-1], x[:-1], []
        for begin, end in pairwise(bends.transpose(1, 0, 2)):
            jerk = (end - begin) / third
            pieces.append(np.stack([value, rate, begin / 2, jerk / 6], axis=1))
            value = value + third * (rate + third * (begin / 2 + third * jerk / 6))
            rate = rate + third * (begin + end) / 2
        coefficients = np.stack(pieces, axis=1).reshape(-1, 4, x.shape[1])
        inner = (knots[:-1, None] + third * np.arange(3)).ravel()
        return cls(np.append(inner, knots[-1]), coefficients)

    def with_derivatives(self, intervals: Index, since: Array) -> tuple[Array, Array, Array]:
        """Values and their first two derivatives, (N, m) each, in given pieces, (N,), at what the
        parameter has grown by since they began, (N,)."""
        x, v, a = (self.inside(intervals, since, order) for order in range(3))
        return x, v, a


def hermite_pieces(lengths: Array, begin: Sequence[Array], end: Sequence[Array]) -> Array:
    """Coefficients of polynomials with given values and derivatives at both ends, (K, d + 1, m).

    ``lengths``: of the pieces, (K,). ``begin``, ``end``: values and derivatives, for cubics, and
    second derivatives, for quintics, (K, m) each. Of n polynomials of each piece, cubics alone,
    lengths are (K, n), values (K, n, m) and coefficients (K, 4, n, m).
    """
    h = lengths[..., None]
    if len(begin) == 2:
        (x0, v0), (x1, v1) = begin, end
        secant = (x1 - x0) / h
        square = (3 * secant - 2 * v0 - v1) / h
        return np.stack([x0, v0, square, (v0 + v1 - 2 * secant) / h**2], axis=1)
    (x0, v0, a0), (x1, v1, a1) = begin, end
    half = a0 / 2
    value, rate = x1 - x0 - h * (v0 + h * half), h * (v1 - v0 - 2 * h * half)
    rest = quintic_rest(value, rate, h**2 * (a1 - 2 * half))
    powers = np.vander(lengths, 6, increasing=True).T[3:, :, None]
    higher = [each / power for each, power in zip(rest, powers, strict=True)]
    return np.stack([x0, v0, half, *higher], axis=1)


def quintic_rest(
    value: Array, rate: Array, bend: Array | float = 0.0
) -> tuple[Array, Array, Array]:
    """Coefficients of u³, u⁴ and u⁵ of the quintic that is zero with its first two derivatives at
    u = 0, and has this value, rate and second derivative at u = 1."""
    return (
        10 * value - 4 * rate + bend / 2,
        -15 * value + 7 * rate - bend,
        6 * value - 3 * rate + bend / 2,
    )


def spline_rates(
    lengths: Array, x: Array, first: Array | float = 0.0, last: Array | float = 0.0
) -> Array:
    """Derivatives at the knots, (K + 1, m), of the cubic spline through values x there, whose
    pieces have these ``lengths``, (K,), and whose derivatives at its ends are given. Of n splines
    lengths are (K, n), values and derivatives (K + 1, n, m).

    Its second derivative is continuous: v_{i-1}/h_{i-1} + 2 (1/h_{i-1} + 1/h_i) v_i + v_{i+1}/h_i =
    3 ((x_i - x_{i-1})/h_{i-1}² + (x_{i+1} - x_i)/h_i²), solved by Thomas's elimination.
    """
    secant = np.diff(x, axis=0) / lengths[..., None]
    v = np.zeros_like(x)
    v[0], v[-1] = first, last
    before, after = 1 / lengths[:-1, ..., None], 1 / lengths[1:, ..., None]
    diagonal = 2 * (before + after)
    b = 3 * (before * secant[:-1] + after * secant[1:])
    b[0] -= before[0] * v[0]
    for i in range(1, len(b)):
        share = before[i] / diagonal[i - 1]
        diagonal[i] -= share * after[i - 1]
        b[i] -= share * b[i - 1]
    for i in reversed(range(len(b))):
        v[i + 1] = (b[i] - after[i] * v[i + 2]) / diagonal[i]
    return v


def shifted(coefficients: Array, by: Array | float) -> Array:
    """Coefficients of p(u + by) from those of p(u), by Horner's scheme again and again.

    ``coefficients``: of ascending powers along the first axis, (d + 1, …). ``by``: a number or an
    array that goes with one power.
    """
    found = np.array(coefficients, dtype=float)
    for k in range(len(found) - 1):
        for j in reversed(range(k, len(found) - 1)):
            found[j] += by * found[j + 1]
    return found


def with_neighbours(each: Array) -> Array:
    """The largest of what every interval and the two beside it have, at least 0, (N, ...)."""
    found = np.maximum(each, 0.0)
    found[1:] = np.maximum(found[1:], each[:-1])
    found[:-1] = np.maximum(found[:-1], each[1:])
    return found


def away_from_lines(begin: Array, way: Array, x: Array) -> Array:
    """How places (N, 3) lie from the nearest place of each of some straight lines, (N, lines, 3);
    ``begin``, ``way``: where each begins, and from there to its end, (lines, 3)."""
    since = x[:, None] - begin
    shares = np.clip((since * way).sum(axis=2) / (way**2).sum(axis=1), 0.0, 1.0)
    return np.asarray(since - shares[:, :, None] * way)
