"""The largest distance of a motion from places of a path that go with it, at all instants.

A rule says which place of the path goes with an instant: the nearest, or the one to which the
motion has come on its way along the path. Between two instants the place moves evenly. What the
motion is away from it is a polynomial of time, whose square lies below the largest of its control
points in Bernstein's form. Parts of the motion are halved until that says enough: what is reported
holds at all instants.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from deltaopt.curves.bernstein import (
    control_points_of,
    halves,
    largest_norm,
    parts_of,
    raised,
)
from deltaopt.curves.halving import surely_largest
from deltaopt.curves.piecewise import Array, Index, PiecewisePolynomial
from deltaopt.scene.path import Path

_ENOUGH = 5e-10
"""Share beyond what is asked for at which a part is not halved any more: half of what verification
allows."""
_KNOWN = 1e-3
"""Share of an excess to which it is known."""
_HALVINGS, _MOST = 40, 400_000
"""Of a piece, and parts that are looked at in all: what is not known then is told as bad as it may
be."""
_FEWEST = 1000
"""Parts that are looked at in any case, so that a distance within the bound is told too."""


class Places(Protocol):
    """Which places of a path go with a motion: their parameters s, in the path's own unit."""

    @property
    def path(self) -> Path: ...

    def at_knots(self) -> Array:
        """At the knots of the motion, (K + 1,)."""
        ...

    def inside(self, pieces: Index, fractions: Array, x: Array, s: Array) -> Array:
        """At fractions of pieces, (N,), where the motion is at x, (N, 3); ``s``: at the ends of the
        part about each, (N, 2)."""
        ...

    def bound(self, points: Array, s: Array) -> Array:
        """What parts of a motion with these control points, (N, d + 1, 3), are away from the path
        at most, (N,), m, if these places go with their ends, (N, 2)."""
        ...


@dataclass(frozen=True)
class _Parts:
    """Parts of a motion: piece (N,), begin and end as fractions of it (N, 2), control points
    (N, d + 1, 3), and the parameters of the places at both ends (N, 2)."""

    places: Places
    pieces: Index
    ends: Array
    points: Array
    s: Array

    @classmethod
    def of(cls, places: Places, position: PiecewisePolynomial) -> _Parts:
        """All pieces of a motion."""
        s, number = places.at_knots(), len(position.coefficients)
        ends, own = np.tile([0.0, 1.0], (number, 1)), np.stack([s[:-1], s[1:]], axis=1)
        return cls(places, np.arange(number), ends, control_points_of(position), own)

    def __len__(self) -> int:
        return len(self.pieces)

    def halved(self, which: NDArray[np.bool]) -> _Parts:
        """First halves of some of them, then second ones."""
        pieces, in_piece, s = self.pieces[which], self.ends[which], self.s[which]
        first, second = halves(self.points[which])
        middle = in_piece.mean(axis=1)
        passed = self.places.inside(pieces, middle, second[:, 0], s)
        ends, own = (
            np.concatenate([np.stack([a, m], axis=1), np.stack([m, b], axis=1)])
            for (a, b), m in ((in_piece.T, middle), (s.T, passed))
        )
        points = np.concatenate([first, second])
        return _Parts(self.places, np.tile(pieces, 2), ends, points, own)


def largest_distance(
    places: Places, position: PiecewisePolynomial, asked: float
) -> tuple[float, float]:
    """The largest distance (m) of a motion from the places of a path, and when (s).

    It is that of an instant where all of the motion is known to keep what is asked for (m), and
    otherwise a bound that no instant exceeds.
    """
    knots = position.knots

    def distances(parts: _Parts) -> tuple[Array, Array, Array]:
        away = parts.points[:, [0, -1]] - places.path(parts.s.ravel()).reshape(-1, 2, 3)
        at_ends = np.linalg.norm(away, axis=2)
        share = parts.ends[np.arange(len(parts)), at_ends.argmax(axis=1)]
        when = knots[parts.pieces] * (1 - share) + knots[parts.pieces + 1] * share
        return at_ends.max(axis=1)[:, None], when, places.bound(parts.points, parts.s)[:, None]

    found = surely_largest(
        _Parts.of(places, position),
        distances,
        asked * (1 + _ENOUGH),
        known=lambda over: (1 + _KNOWN) * over,
        halvings=_HALVINGS,
        most=_MOST,
        fewest=_FEWEST,
    )
    return found.value, found.where


def from_moving_place(path: Path, pieces: Index, points: Array, s: Array) -> Array:
    """The largest distances, m, of parts of a motion (N, d + 1, 3) from places that move evenly
    between two, (N, 2), of a piece of the path each, (N,)."""
    begin = s[:, 0] - path.knots[pieces]
    moving = parts_of(path.coefficients[pieces], begin, s[:, 1] - s[:, 0])
    degree = max(points.shape[1], moving.shape[1]) - 1
    return largest_norm(raised(points, degree) - raised(moving, degree))
