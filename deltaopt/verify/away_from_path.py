"""The largest distance of a motion from places of a path that go with it, at all instants.

A rule says which place of the path goes with an instant: the nearest, or the one to which the
motion has come on its way along the path. Between two instants the place moves evenly. What the
motion is away from it is a polynomial of time, whose square lies below the largest of its control
points in Bernstein's form. Parts of the motion are halved until that says enough: what is reported
holds at all instants.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from deltaopt.curves.bernstein import control_points_of, halves, largest_norm, parts_of, raised
from deltaopt.curves.halving import surely_largest
from deltaopt.curves.piecewise import Array, Index, PiecewisePolynomial, Truths
from deltaopt.scene.path import Path

_ENOUGH = 5e-10
"""A part is halved no further once its bound is within this share of what is asked for: half of
what verification allows."""
_KNOWN = 1e-3
"""Relative accuracy to which an excess is computed."""
_HALVINGS, _MOST = 40, 400_000
"""How often a piece is halved at most, and how many parts are looked at in all. What is not known
by then is reported as the worst that it may be."""
_FEWEST = 1000
"""How many parts are looked at in any case, so that distances within the bound are reported too."""


Inside = Callable[[Index, Array, Array, Array], Array]
"""The parameters s of the places of a path, (N,), at fractions of pieces, (N,) each, where a motion
is at x, (N, 3), between those of the ends of the parts about them, (N, 2)."""
Bound = Callable[[Array, Array], Array]
"""What parts of a motion with control points (N, d + 1, 3) are away from a path at most, (N,), m,
if the places of these parameters, (N, 2), go with their ends."""


@dataclass(frozen=True)
class _Parts:
    """Parts of a motion: piece (N,), begin and end as fractions of it (N, 2), control points
    (N, d + 1, 3), and the parameters of the places at both ends (N, 2)."""

    inside: Inside
    pieces: Index
    ends: Array
    points: Array
    s: Array

    def __len__(self) -> int:
        return len(self.pieces)

    def halved(self, which: Truths) -> _Parts:
        """Both halves of some of the parts: all first halves, then all second ones."""
        pieces, in_piece, s = self.pieces[which], self.ends[which], self.s[which]
        first, second = halves(self.points[which])
        middle = in_piece.mean(axis=1)
        passed = self.inside(pieces, middle, second[:, 0], s)
        ends, own = (
            np.concatenate([np.stack([a, m], axis=1), np.stack([m, b], axis=1)])
            for (a, b), m in ((in_piece.T, middle), (s.T, passed))
        )
        points = np.concatenate([first, second])
        return _Parts(self.inside, np.tile(pieces, 2), ends, points, own)


def largest_distance(
    path: Path,
    position: PiecewisePolynomial,
    at_knots: Array,
    inside: Inside,
    bound: Bound,
    asked: float,
) -> tuple[float, float]:
    """The largest distance (m) of a motion from places of a path, whose parameters ``at_knots`` of
    the motion, (K + 1,), are these, and when (s).

    It is that of an instant where all of the motion is known to keep what is asked for (m), and
    otherwise a bound that no instant exceeds.
    """
    knots, number = position.knots, len(position.coefficients)

    def distances(parts: _Parts) -> tuple[Array, Array, Array]:
        away = parts.points[:, [0, -1]] - path(parts.s.ravel()).reshape(-1, 2, 3)
        at_ends = np.linalg.norm(away, axis=2)
        share = parts.ends[np.arange(len(parts)), at_ends.argmax(axis=1)]
        when = knots[parts.pieces] * (1 - share) + knots[parts.pieces + 1] * share
        return at_ends.max(axis=1)[:, None], when, bound(parts.points, parts.s)[:, None]

    ends, s = np.tile([0.0, 1.0], (number, 1)), np.stack([at_knots[:-1], at_knots[1:]], axis=1)
    return surely_largest(
        _Parts(inside, np.arange(number), ends, control_points_of(position), s),
        distances,
        asked * (1 + _ENOUGH),
        known=lambda over: (1 + _KNOWN) * over,
        halvings=_HALVINGS,
        most=_MOST,
        fewest=_FEWEST,
    )


def from_moving_place(path: Path, pieces: Index, points: Array, s: Array) -> Array:
    """The largest distances, m, of parts of a motion (N, d + 1, 3) from places that move evenly
    between two, (N, 2), of a piece of the path each, (N,)."""
    begin = s[:, 0] - path.knots[pieces]
    moving = parts_of(path.coefficients[pieces], begin, s[:, 1] - s[:, 0])
    degree = max(points.shape[1], moving.shape[1]) - 1
    return largest_norm(raised(points, degree) - raised(moving, degree))
