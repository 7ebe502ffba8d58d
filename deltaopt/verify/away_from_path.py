"""The largest distance of a motion from places of a path that go with it, at all instants.

A rule says which place of the path goes with an instant: the nearest, or the one to which the
motion has come on its way along the path. Between two instants the place moves evenly. What the
motion is away from it is a polynomial of time, whose square lies below the largest of its control
points in Bernstein's form. Parts of the motion are halved until that says enough: what is reported
holds at all instants.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from deltaopt.curves.bernstein import largest_norm, parts_of, raised
from deltaopt.curves.halving import Parts, surely_largest
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
"""The parameters s of the places of a path, (N,), in pieces of a motion, so long since these began,
(N,) each, where it is at x, (N, 3), between those of the ends of the parts about them, (N, 2)."""
Bound = Callable[[Array, Array], Array]
"""What parts of a motion with control points (N, d + 1, 3) are away from a path at most, (N,), m,
if the places of these parameters, (N, 2), go with their ends."""


@dataclass(frozen=True)
class _Parts(Parts):
    """Parts of a motion that know the parameters of the places at both of their ends, (N, 2)."""

    inside: Inside
    s: Array

    def halved(self, which: Truths) -> Self:
        """Both halves of some of them."""
        (begin, end), x = self.s[which].T, self.at()[which]
        middle = self.inside(self.piece[which], self.since[which], x, self.s[which])
        own = [np.stack(ends, axis=1) for ends in ((begin, middle), (middle, end))]
        return replace(super().halved(which), s=np.concatenate(own))


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

    def distances(parts: _Parts) -> tuple[Array, Array, Array]:
        points = parts.control_points()
        away = points[:, [0, -1]] - path(parts.s.ravel()).reshape(-1, 2, 3)
        at_ends = np.linalg.norm(away, axis=2)
        when = parts.middles + np.where(at_ends.argmax(axis=1), parts.half, -parts.half)
        return at_ends.max(axis=1)[:, None], when, bound(points, parts.s)[:, None]

    s = np.stack([at_knots[:-1], at_knots[1:]], axis=1)
    return surely_largest(
        _Parts(**vars(Parts.of(position, 1)), inside=inside, s=s),
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
