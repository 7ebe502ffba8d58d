"""Curves along a piecewise motion, known between samples: piecewise Chebyshev interpolation.

A cell is a part of one polynomial piece of a motion. In each cell every curve is sampled at
``DEGREE`` + 1 Chebyshev points, both ends among them, and stands for the polynomial through these
samples. Where a curve is smooth its Chebyshev coefficients fall geometrically, so that the last of
them bound what the polynomial misses (Trefethen, Approximation Theory and Approximation Practice,
chapters 7 and 8). Where they have not fallen to a tolerance, the cell is halved. A peak that is
narrower than the samples are apart, of torque where a chain grazes its singularity, cannot hide: on
its two sides the curves, or their rates, differ by a jump, whose coefficients do not fall.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np
from numpy.polynomial import chebyshev

from deltaopt.curves.piecewise import Array, Index, Truths
from deltaopt.errors import DeltaOptError

Curves = Callable[[Index, Array], Array]
"""(piece (N,), fraction of it (N,)) -> values (N, c) of c curves, smooth in a piece."""
Tolerance = Callable[[Array], Array]
"""Values of curves in cells (M, DEGREE + 1, c) -> to what each is to be known there, (M, c)."""

DEGREE = 24
"""Degree of the interpolating polynomials: 23 samples inside of a cell, and one at each end. A
lower one needs more cells, a higher one is wasted on the short pieces of a plan."""
_TAIL = 4
"""How many of the last coefficients are added up to bound the error: of a single one nothing
follows, as the odd or the even ones of a curve may vanish."""
_NARROWEST = 2.0**-32
"""Width of a cell, as a share of its piece, that is halved no further: so narrow a cell may hide a
jump, but no peak."""
_MOST = 6000
"""How many cells there are at most, or twice as many as the motion has pieces if that is more: what
needs more cannot be told from rounding."""
_ROUNDING = 1e3
"""Errors up to so many tolerances are taken for rounding, as of a polynomial whose terms cancel, if
halving a cell reduces them in neither half. A jump stays in one half only."""
_NEARLY = 1e-12
"""Share of the largest value that is added to bounds of polynomials, for rounding."""
_FINE = 4 * DEGREE
_STEPS = 4  # of Newton's method from a place known to 1/4 of the samples' distance

_ANGLES = np.linspace(pi, 0.0, DEGREE + 1)
POINTS = (1 + np.cos(_ANGLES)) / 2
"""Of the samples, fractions of a cell, increasing from 0 to 1."""
_COEFFICIENTS: Array = np.asarray(
    np.linalg.inv(chebyshev.chebvander(np.cos(_ANGLES), DEGREE)), np.float64
)
_MOMENTS = np.array([0.0 if k % 2 else 1 / (1 - k**2) for k in range(DEGREE + 1)])
WEIGHTS: Array = _MOMENTS @ _COEFFICIENTS
"""Of the samples in a mean over a cell: Clenshaw and Curtis's rule."""
_FINE_PLACES = np.cos(np.linspace(pi, 0.0, _FINE + 1))
_AT_FINE: Array = np.asarray(chebyshev.chebvander(_FINE_PLACES, DEGREE), np.float64)
_RATE: Array = np.vstack([chebyshev.chebder(np.eye(DEGREE + 1), axis=0), np.zeros(DEGREE + 1)])
"""From coefficients to those of the derivative."""


class TooRough(DeltaOptError):
    """The curves of a motion change too fast to be interpolated on thousands of cells."""


@dataclass(frozen=True)
class Cells:
    """M cells: the ``piece`` that each is a part of, and where it begins and ends in it, as
    fractions of the piece, (M,) each."""

    piece: Index
    begin: Array
    end: Array

    def __len__(self) -> int:
        return len(self.piece)

    def __getitem__(self, which: Index | Truths) -> Cells:
        return Cells(self.piece[which], self.begin[which], self.end[which])

    @classmethod
    def even(cls, pieces: int, parts: int) -> Cells:
        """Each piece divided into so many cells of equal width."""
        bounds = np.linspace(0.0, 1.0, parts + 1)
        piece = np.repeat(np.arange(pieces), parts)
        return cls(piece, np.tile(bounds[:-1], pieces), np.tile(bounds[1:], pieces))

    def cut(self, piece: Index, fraction: Array) -> Cells:
        """These cells, divided at N places: a piece and a fraction of it each, (N,)."""
        kept = self.joined([self, Cells(piece, fraction, fraction)])
        kept = kept[np.lexsort([kept.begin, kept.piece])]
        begin, piece = kept.begin, kept.piece
        last = np.append(piece[1:] != piece[:-1], True)
        end = np.where(last, 1.0, np.append(begin[1:], 1.0))
        return Cells(piece, begin, end)[end > begin]

    def halved(self) -> Cells:
        """Both halves of each."""
        middle = (self.begin + self.end) / 2
        halves = Cells(self.piece, self.begin, middle), Cells(self.piece, middle, self.end)
        return self.joined(halves)

    def places(self, share: Array) -> Array:
        """Fractions of the pieces, (M, n), at these shares of the cells, (n,)."""
        return np.asarray(self.begin[:, None] * (1 - share) + self.end[:, None] * share)

    @staticmethod
    def joined(parts: Sequence[Cells]) -> Cells:
        """All cells of all parts."""
        arrays = zip(*(vars(part).values() for part in parts), strict=True)
        return Cells(*map(np.concatenate, arrays))


@dataclass(frozen=True)
class ResolvedPeaks:
    """The highest value of each of c curves, and where: value, piece, fraction of it, (c,) each."""

    values: Array
    pieces: Index
    fractions: Array


@dataclass(frozen=True)
class ResolvedCurves:
    """Curves sampled in cells; ``values``: (M, DEGREE + 1, c)."""

    curves: Curves
    cells: Cells
    values: Array

    @classmethod
    def of(cls, curves: Curves, cells: Cells, tolerance: Tolerance) -> ResolvedCurves:
        """Curves in these cells, halved until ``tails`` are within a tolerance.

        Raises TooRough where they do not come within it.
        """
        done: list[ResolvedCurves] = []
        todo, number = cls.sampled(curves, cells), len(cells)
        most = max(_MOST, 2 * number)
        before: Array | None = None
        while True:
            tails, allowed = todo.tails, tolerance(todo.values)
            unknown = tails > allowed
            if before is not None:
                unknown &= ~(_as_rough(tails, before) & (tails < _ROUNDING * allowed))
            rough = unknown.any(axis=1)
            rough &= todo.cells.end - todo.cells.begin > _NARROWEST
            done.append(cls(curves, todo.cells[~rough], todo.values[~rough]))
            if not rough.any():
                cells = Cells.joined([each.cells for each in done])
                return cls(curves, cells, np.concatenate([each.values for each in done]))
            number += int(rough.sum())
            if number > most:
                raise TooRough("the motion changes too fast to be measured between samples")
            before = np.tile(tails[rough], (2, 1))
            todo = cls.sampled(curves, todo.cells[rough].halved())

    @classmethod
    def sampled(cls, curves: Curves, cells: Cells) -> ResolvedCurves:
        """Curves in these cells as they are."""
        pieces = np.repeat(cells.piece, len(POINTS))
        values = curves(pieces, cells.places(POINTS).ravel())
        return cls(curves, cells, values.reshape(len(cells), len(POINTS), -1))

    @cached_property
    def coefficients(self) -> Array:
        """Of Chebyshev polynomials, (M, DEGREE + 1, c)."""
        return np.asarray(np.einsum("ij,mjc->mic", _COEFFICIENTS, self.values, optimize=True))

    @property
    def tails(self) -> Array:
        """What the polynomials may miss, (M, c)."""
        return np.asarray(np.abs(self.coefficients[:, -_TAIL:]).sum(axis=1))

    def means(self) -> Array:
        """The mean of each curve over each cell, (M, c)."""
        return np.asarray(np.einsum("j,mjc->mc", WEIGHTS, self.values))

    def roots(self, curve: int, negligible: float) -> tuple[Index, Array]:
        """Where a curve changes its sign: piece and fraction, (N,) each. Cells in which it is
        negligible all along have none."""
        values = self.values[:, :, curve]
        changes = (values.min(axis=1) < 0) & (values.max(axis=1) > 0)
        changes &= np.abs(values).max(axis=1) > negligible
        found: list[tuple[int, float]] = []
        for m in np.flatnonzero(changes).tolist():
            roots = chebyshev.chebroots(self.coefficients[m, :, curve])
            real = roots.real[(np.abs(roots.imag) < 1e-9) & (np.abs(roots.real) < 1)]
            cell = self.cells[np.array([m])]
            found += [(int(cell.piece[0]), s) for s in cell.places((1 + real) / 2)[0].tolist()]
        return np.array([m for m, _ in found], np.intp), np.array([s for _, s in found])

    def highest(self, number: int) -> ResolvedPeaks:
        """The highest value of each of the first ``number`` curves: of its polynomials, or of its
        samples where one is higher."""
        cell, curve, place = self._candidates(number)
        coefficients = self.coefficients[cell, :, curve].T  # (DEGREE + 1, candidates)
        rate = _RATE @ coefficients
        bend, step = _RATE @ rate, pi / _FINE
        top = place
        for _ in range(_STEPS):
            slope, curvature = (chebyshev.chebval(top, c, tensor=False) for c in (rate, bend))
            change = np.where(curvature < 0, -slope / np.where(curvature < 0, curvature, 1.0), 0.0)
            top = np.clip(top + change, np.maximum(place - step, -1), np.minimum(place + step, 1))
        values = chebyshev.chebval(top, coefficients, tensor=False)
        order = np.lexsort([values, curve])
        last = order[np.append(np.flatnonzero(np.diff(curve[order])), len(order) - 1)]
        cells = self.cells[cell[last]]
        fractions = np.diagonal(cells.places((1 + top[last]) / 2)).copy()
        reached = np.diagonal(self.curves(cells.piece, fractions))
        return self._better(ResolvedPeaks(reached, cells.piece, fractions))

    def _candidates(self, number: int) -> tuple[Index, Index, Array]:
        """Hills of the polynomials that may be the highest of their curve: cell, curve, place in
        the cell from -1 to 1."""
        # A polynomial is nowhere above the sum of its coefficients' sizes, but for the first.
        first, rest = self.coefficients[:, 0, :number], self.coefficients[:, 1:, :number]
        most = first + np.abs(rest).sum(axis=1)
        sampled = self.values[:, :, :number].max(axis=(0, 1))
        beyond = sampled - _NEARLY * np.maximum(np.abs(sampled), np.abs(first).max(axis=0))
        cell, curve = np.nonzero(most >= beyond)
        grid = self.coefficients[cell, :, curve] @ _AT_FINE.T
        # A hill between two points of the fine grid is higher than these by 2 % of the cell's
        # range at most: (12 π / 96)² / 8 for a curve that oscillates six times in a cell.
        room = 0.02 * np.ptp(grid, axis=1)[:, None]
        padded = np.pad(grid, ((0, 0), (1, 1)), constant_values=-np.inf)
        hill = (grid >= padded[:, :-2]) & (grid >= padded[:, 2:])
        highest = np.full(number, -np.inf)
        np.maximum.at(highest, curve, grid.max(axis=1))
        hill &= grid + room >= highest[curve][:, None]
        pair, fine = np.nonzero(hill)
        return cell[pair], curve[pair], _FINE_PLACES[fine]

    def _better(self, tops: ResolvedPeaks) -> ResolvedPeaks:
        """These, or samples that are higher still."""
        number = len(tops.values)
        flat = self.values[:, :, :number].reshape(-1, number)
        best = flat.argmax(axis=0)
        values = flat[best, np.arange(number)]
        cell, point = np.divmod(best, len(POINTS))
        cells = self.cells[cell]
        fractions = np.diagonal(cells.places(POINTS[point]))
        higher = values > tops.values
        return ResolvedPeaks(
            np.where(higher, values, tops.values),
            np.where(higher, cells.piece, tops.pieces),
            np.where(higher, fractions, tops.fractions),
        )


def _as_rough(tails: Array, before: Array) -> Truths:
    """Whether both halves of a cell are hardly smoother than the whole, (M, c): first halves come
    before all second halves."""
    stuck = (tails > before / 4).reshape(2, -1, tails.shape[1]).all(axis=0)
    return np.tile(stuck, (2, 1))
