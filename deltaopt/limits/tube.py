"""d(x) ≤ r: the distance of the tool's point from the path of the scene, the axis of a tube.

The path is numbers: polynomials of degree four at most, of which legs are straight and roundings
bend. Roundings are cut into parts, between whose normal planes, at both ends, a point may lie. Of
these parts the one is taken whose place is nearest at the share to which the point projects on its
chord; from there Newton's method finds the nearest place. Nearer to the path than its radius of
curvature the distance is then exact to rounding; elsewhere it is that from some place of the path,
and so never too small.

The best motion slides along the wall of a tube, where it would touch other limits of position at an
instant.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import casadi as ca
import numpy as np

from deltaopt.curves.piecewise import Array, Index, PiecewisePolynomial, away_from_lines, shifted
from deltaopt.limits.limit import SX, Bounds, Described, DividedLimit, Instant, Numbers, OwnMeasure
from deltaopt.limits.solid_distance import root

_PARTS = 8
"""Of a rounding: with fewer Newton's method needs more steps, more take longer to compare."""
_SHRUNK = float(_PARTS) ** np.arange(5)[:, None]
"""By which the coefficients of a polynomial over such a part are less than those over all."""
_STEPS = 3
"""Of Newton's method from a chord: a rounding of 90 degrees then leaves less than 1e-12 m."""
_PLACES = (1, 10, 19, 64)
"""Parts of a path: of a line, with one rounding, with two, with up to seven. The count is rounded
up to one of these, each of which is compiled when it is first met."""
MOST_PARTS = _PLACES[-1]
_COEFFICIENTS, _OF_PART = 15, 17
"""Numbers of a part: five coefficients of three coordinates over shares from 0 to 1 of it, and the
shares between which the nearest place may be."""
_BEYOND = 1e3
"""Added to the squared distance, m², of parts beside which a point does not lie."""
_OVERLAP = 1e-9
"""Share of a part by which it reaches past its ends there, so that rounding leaves no point beside
neither of two parts."""
_LEAST_BEND = 0.25
"""Of ‖p′‖²: least curvature of the squared distance in a step of Newton's method, for places beyond
the path's centre of curvature."""
_LOOKED_AT = np.linspace(0.0, 1.0, 9)
"""Shares of a part where its curvature is looked at."""
_ROUNDING = 1e-10
"""m by which the planned tube is thinner: rounding of the distance between two programs."""


class Tube(DividedLimit):
    """Largest distance of the tool's point from the path of the scene, m: the key ``tube``."""

    name, unit, subject, order = "distance from the path", "m", "tool", 0
    own_measure = OwnMeasure.TUBE
    slid_along = True
    has_ridges = True

    def items(self, scene: Described) -> Sequence[Numbers]:
        if scene.tube is None:
            return []
        parts = parts_of(scene.axis_of_tube)
        places = next(n for n in _PLACES if n >= len(parts))
        numbers = [_of_part(part, i == 0, i == len(parts) - 1) for i, part in enumerate(parts)]
        numbers += [numbers[-1]] * (places - len(parts))
        return [(scene.tube - _ROUNDING, *(number for each in numbers for number in each))]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.at_most(numbers[0], out_of_reach=True)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return root(_squared_distance(motion.x, numbers))

    def rows(self, motion: Instant, numbers: SX) -> SX:
        # The distance has no derivative on the axis.
        return _squared_distance(motion.x, numbers) / numbers[0] ** 2

    def regions(self, numbers: Array) -> int:
        """Tubes about the stretches of the path between the middles of bends whose radius of
        curvature is less than the tube's radius.

        Inside of such a bend the nearest place of the path jumps from one side of it to the other:
        the distance has no derivative there, and the wall an edge.
        """
        return len(_divisions(numbers)) + 1

    def of_regions(self, numbers: Array, first: int, end: int) -> Array:
        parts = numbers[1:].reshape(-1, _OF_PART)
        begins = [0, *_divisions(numbers), len(parts)]
        begin, last = begins[first], begins[end] - 1
        own = parts[np.clip(np.arange(len(parts)), begin, last)]
        own[: begin + 1, 15], own[last:, 16] = 0.0, 1.0
        return np.append(numbers[0], own)

    def nearest(self, numbers: Array, x: Array) -> Index:
        # By chords, for where a motion passes from one region to the next is free.
        pieces = _pieces(numbers)
        away = away_from_lines(pieces[:, 0], pieces[:, 1:].sum(axis=1), x)
        nearest = np.linalg.norm(away, axis=2).argmin(axis=1)
        return np.asarray(np.searchsorted(_divisions(numbers), nearest, side="right"))


def _pieces(numbers: Array) -> Array:
    """The polynomials of all parts, over shares from 0 to 1 of each, (parts, 5, 3), m."""
    return numbers[1:].reshape(-1, _OF_PART)[:, :_COEFFICIENTS].reshape(-1, 5, 3)


def _divisions(numbers: Array) -> list[int]:
    """The parts with which the second halves of bends begin whose radius of curvature is less than
    the tube's radius."""
    pieces = _pieces(numbers)
    axis = PiecewisePolynomial(np.arange(len(pieces) + 1.0), pieces)
    rate, second = (axis.inside(*axis.everywhere(_LOOKED_AT), order) for order in (1, 2))
    speed = np.linalg.norm(rate, axis=1)
    curvature = np.linalg.norm(np.cross(rate, second), axis=1) / speed**3
    is_sharp = (numbers[0] * curvature > 1).reshape(len(pieces), -1).any(axis=1)
    bends = pieces[:, 2:].any(axis=(1, 2))
    ends = np.flatnonzero(np.diff(bends, prepend=False, append=False)).reshape(-1, 2)
    # Fewer than all parts of a rounding are copies that fill unused places.
    firsts = chain.from_iterable(range(a, b - _PARTS + 1, _PARTS) for a, b in ends.tolist())
    return [k + _PARTS // 2 for k in firsts if is_sharp[k : k + _PARTS].any()]


def parts_of(pieces: Array) -> list[Array]:
    """The parts of a path, each (5, 3), from its pieces over shares from 0 to 1, (K, powers, 3), m:
    straight pieces as they are, and others cut."""
    found = list[Array]()
    for piece in pieces:
        whole = np.zeros((5, 3))
        whole[: len(piece)] = piece
        cut = (shifted(whole, i / _PARTS) / _SHRUNK for i in range(_PARTS))
        found += cut if whole[2:].any() else [whole]
    return found


def _of_part(part: Array, is_first: bool, is_last: bool) -> Numbers:
    """A part as numbers; only the ends of the path are ends of where the nearest place may be."""
    return (*part.ravel().tolist(), 0.0 if is_first else -1.0, 1.0 if is_last else 2.0)


def _squared_distance(x: SX, numbers: SX) -> SX:
    """Of a point from the path, m²."""
    parts = ca.vertsplit(numbers[1:], _OF_PART)
    least, nearest = _roughly(x, parts[0]), parts[0]
    for part in parts[1:]:
        square = _roughly(x, part)
        is_nearer = square < least
        least = ca.if_else(is_nearer, square, least)
        nearest = ca.if_else(is_nearer, part, nearest)
    return ca.sumsqr(x - _at(nearest, _nearest_share(x, nearest)))


def _roughly(x: SX, part: SX) -> SX:
    """The squared distance from about the nearest place of a part, m², for comparison, and much
    more where the point does not lie beside the part."""
    begin, end = part[:3], _at(part, SX(1))
    first, last = part[3:6], _rate(part, SX(1))
    before = (ca.dot(x - begin, first) < -_OVERLAP * ca.sumsqr(first)) * (part[15] < 0)
    behind = (ca.dot(x - end, last) > _OVERLAP * ca.sumsqr(last)) * (part[16] > 1)
    share = _clipped(ca.dot(x - begin, end - begin) / ca.sumsqr(end - begin), SX(0), SX(1))
    return ca.sumsqr(x - _at(part, share)) + _BEYOND * (before + behind)


def _nearest_share(x: SX, part: SX) -> SX:
    """Where on a part the place nearest to a point is, by Newton's method from its chord."""
    chord = _at(part, SX(1)) - part[:3]
    share = ca.dot(x - part[:3], chord) / ca.sumsqr(chord)
    for _ in range(_STEPS):
        share = _clipped(share, part[15], part[16])
        away, rate = x - _at(part, share), _rate(part, share)
        square = ca.sumsqr(rate)
        bend = square - ca.dot(away, _second(part, share))
        least = _LEAST_BEND * square
        share = share + ca.dot(away, rate) / ca.if_else(bend > least, bend, least)
    return _clipped(share, part[15], part[16])


def _at(part: SX, share: SX) -> SX:
    c = ca.vertsplit(part[:_COEFFICIENTS], 3)
    return c[0] + share * (c[1] + share * (c[2] + share * (c[3] + share * c[4])))


def _rate(part: SX, share: SX) -> SX:
    c = ca.vertsplit(part[:_COEFFICIENTS], 3)
    return c[1] + share * (2 * c[2] + share * (3 * c[3] + share * 4 * c[4]))


def _second(part: SX, share: SX) -> SX:
    c = ca.vertsplit(part[:_COEFFICIENTS], 3)
    return 2 * c[2] + share * (6 * c[3] + share * 12 * c[4])


def _clipped(value: SX, least: SX, most: SX) -> SX:
    return ca.if_else(value < least, least, ca.if_else(value > most, most, value))
