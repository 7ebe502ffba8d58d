"""How far a motion is from the path, the tube, the via points or the approach of its scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.polynomial import Polynomial

from deltaopt.curves.bernstein import control_points_of, largest_norm, parts_of
from deltaopt.curves.nodes import gauss
from deltaopt.curves.passages import passages
from deltaopt.curves.piecewise import Array, Index, PiecewisePolynomial
from deltaopt.curves.roots import real_roots, sure_largest
from deltaopt.limits.limit import Column, OwnMeasure
from deltaopt.motion.trajectory import Trajectory
from deltaopt.scene.path import Path
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import OnPath, Task
from deltaopt.verify.away_from_path import from_moving_place, largest_distance
from deltaopt.verify.measures import Excess, excess_of

_IN_PIECE = 64
"""How many places of every piece of the path are compared before Newton's method refines the
nearest."""
_STEPS = 50
"""Of Newton's method at most: where the path turns back it gains one digit in three steps."""
_AT_ONCE = 1_000_000
"""How many distances are computed at once, in 8 MB."""
_AS_NEAR = 1e-10
"""By how much a place must be nearer, m, to count instead of an earlier one: less is rounding."""
_NODES, _WEIGHTS = gauss(24)
"""Fractions of an interval, and weights, for the length of a way."""


def off_path(task: OnPath, trajectory: Trajectory, asked: float) -> float:
    """The largest distance, m, of the motion from the path of a task, followed from its beginning
    to its end and never back: that of an instant where all of it is known to keep what is asked for
    (m), and otherwise a bound."""
    path, position = task.path, trajectory.position
    places = _FollowedPlaces(path, position)
    at_knots = places.at_knots()
    return largest_distance(path, position, at_knots, places.inside, places.bound, asked)[0]


class _FollowedPlaces:
    """The places of a path that a motion comes to on its way along it, in their order.

    The motion has gone as far as the path is long up to there, whatever crosses itself or turns
    back; near that place the nearest one is looked for. Whatever places are taken, if they go on
    from the beginning to the end, the largest distance from them is no less than Fréchet's.

    ``marks``: parameters of the path, and ``ways``: how long it is up to there, as shares of its
    length, (M,) each. ``gone``: how far the motion has gone until each knot, as shares, (K + 1,).
    """

    def __init__(self, path: Path, position: PiecewisePolynomial) -> None:
        """Of a path and a motion that is to follow it."""
        self.path, self.position = path, position
        pieces = np.repeat(np.arange(len(path.knots) - 1), _IN_PIECE)
        length = np.diff(path.knots)[pieces] / _IN_PIECE
        since = length * np.tile(np.arange(_IN_PIECE), len(path.knots) - 1)
        places = np.repeat(pieces, len(_NODES))
        rates = path.inside(places, (since[:, None] + length[:, None] * _NODES).ravel(), 1)
        ways = _summed(_integrals(rates, length))
        self.marks = np.append(path.knots[pieces] + since, path.knots[-1])
        self.ways, lengths = ways / ways[-1], np.diff(position.knots)
        self.gone = _summed(self._way(np.arange(len(lengths)), lengths))

    def at_knots(self) -> Array:
        x, (first, last) = self.position.at(self.position.knots), self.path.knots[[0, -1]]
        guess = self._guess(self.gone)
        _, s = _closest(self.path, x, guess, np.full(len(x), first), np.full(len(x), last))
        s[0], s[-1] = first, last
        return np.asarray(np.maximum.accumulate(s))

    def inside(self, pieces: Index, since: Array, x: Array, s: Array) -> Array:
        guess = self._guess(self.gone[pieces] + self._way(pieces, since))
        return _closest(self.path, x, np.clip(guess, *s.T), *s.T)[1]

    def bound(self, points: Array, s: Array) -> Array:
        first, on, last = (self.path.interval(each) for each in (s[:, 0], s.mean(axis=1), s[:, 1]))
        begin, end = self.path.knots[on], self.path.knots[on + 1]
        moving = np.clip(s, begin[:, None], end[:, None])
        bound = from_moving_place(self.path, on, points, moving)
        # At both ends the motion waits until the place has passed what is on other pieces.
        for piece, a, b, x in (
            (np.maximum(on - 1, 0), s[:, 0], moving[:, 0], points[:, :1]),
            (np.minimum(on + 1, len(self.path.knots) - 2), moving[:, 1], s[:, 1], points[:, -1:]),
        ):
            passed = parts_of(self.path.coefficients[piece], a - self.path.knots[piece], b - a)
            waited = np.linalg.norm(passed - x, axis=2).max(axis=1)
            bound = np.where(b > a, np.maximum(bound, waited), bound)
        # No place of the path is farther than the path's middle and the path from there.
        middle = self.path.coefficients[:, 0].mean(axis=0)
        within = np.linalg.norm(control_points_of(self.path) - middle, axis=2)
        anywhere = np.linalg.norm(points - middle, axis=2).max(axis=1) + within.max()
        return np.asarray(np.where((first >= on - 1) & (last <= on + 1), bound, anywhere))

    def _guess(self, gone: Array) -> Array:
        return np.asarray(np.interp(gone / self.gone[-1], self.ways, self.marks))

    def _way(self, pieces: Index, length: Array) -> Array:
        """How far the motion goes in so long since the beginning of pieces, (N,), m."""
        since = (length[:, None] * _NODES).ravel()
        return _integrals(self.position.inside(np.repeat(pieces, len(_NODES)), since, 1), length)


def _integrals(rates: Array, lengths: Array) -> Array:
    """Lengths of ways, (N,), of rates at ``_NODES`` of intervals of these lengths."""
    speeds = np.linalg.norm(rates, axis=1).reshape(-1, len(_NODES))
    return np.asarray(speeds @ _WEIGHTS * lengths)


def _summed(lengths: Array) -> Array:
    return np.append(0.0, np.cumsum(lengths))


def off_via_points(task: Task, trajectory: Trajectory) -> float:
    """The largest distance, m, at which the motion passes a via point of a task or the sphere about
    one, each looked for after the one before it."""
    spheres = [(point.position, point.within) for point in task.via]
    return max(missed for missed, _ in passages(trajectory.position, spheres))


def off_approach(columns: tuple[Column, Column], trajectory: Trajectory) -> float:
    """How far, m, the motion is outside its approach at most: from the axis of the cylinder about
    the start beyond its radius until it is first at its height, and about the goal since it was
    last at that height; in between below the lower height. Where it never is so high, by how much.

    Depths and squared distances are polynomials in an interval, largest at its ends or where their
    derivative is zero. Heights need not be reached at knots.
    """
    start, goal = columns
    pieces = list(zip(np.diff(trajectory.knots), trajectory.position.coefficients, strict=True))
    highest = max(sure_largest(-Polynomial(c[:, 0]), 0.0, length) for length, c in pieces)
    missed = max(-highest - column.level for column in columns)
    if missed > _AS_NEAR:
        return missed
    up = next(_high(pieces, start.level, last=False))
    down = next(_high(pieces[::-1], goal.level, last=True))
    down = len(pieces) - 1 - down[0], down[1]
    low, worst = max(start.level, goal.level), 0.0
    for k, (length, c) in enumerate(pieces):
        x, y, z = (Polynomial(each) for each in c.T)
        ends = [np.clip(t if k == j else length * (k < j), 0, length) for j, t in (up, down)]
        for column, begin, end in ((start, 0.0, ends[0]), (goal, ends[1], length)):
            square = (y - column.y) ** 2 + (z - column.z) ** 2
            away = sure_largest(square, begin, end) ** 0.5 if begin < end else 0.0
            worst = max(worst, away - column.radius)
        if ends[0] < ends[1]:
            worst = max(worst, sure_largest(x - low, ends[0], ends[1]))
    return worst


Pieces = list[tuple[float, Array]]
"""The length of each interval, s, and its coefficients, (powers, 3)."""


def _high(pieces: Pieces, level: float, last: bool) -> Iterator[tuple[int, float]]:
    """The intervals in which a motion is as high as a level (m), in the order given, each with the
    first or last time since it began, s."""
    for k, (length, c) in enumerate(pieces):
        below = Polynomial(c[:, 0]) - level - _AS_NEAR
        times = sorted([0.0, *real_roots(below, 0.0, length), length], reverse=last)
        # A root itself may be below by rounding: within a thousandth of what counts as high.
        high = [t for t in times if below(t) <= 1e-3 * _AS_NEAR]
        if high:
            yield k, high[0]


def nearest_places(path: Path, x: Array) -> tuple[Array, Array]:
    """Where on a path the places are that are nearest to points (N, 3), m: the path's parameter
    there, and how far they are, m, (N,) each.

    A point beyond the centre of a bend has a nearest place on each side of it: all places that are
    nearer than those beside them are looked at, unless another is nearer by more than they can be.
    """
    shares = np.arange(_IN_PIECE) / _IN_PIECE
    lengths = np.diff(path.knots)[:, None]
    looked = np.append((path.knots[:-1, None] + lengths * shares).ravel(), path.knots[-1])
    places = path(looked)
    apart = float(np.linalg.norm(np.diff(places, axis=0), axis=1).max())
    at, best = np.zeros(len(x)), np.full(len(x), np.inf)
    for part in np.array_split(np.arange(len(x)), -(-len(x) * len(places) // _AT_ONCE)):
        point, nearest = _low_places(x[part], places, apart)
        around = [looked[np.clip(nearest + k, 0, len(looked) - 1)] for k in (-1, 0, 1)]
        own = part[point]
        for begin in (0, 2):  # Newton's method goes nowhere from where the path turns back
            distance, s = _closest(path, x[own], around[begin], around[0], around[2])
            by_distance = np.argsort(-distance, kind="stable")  # the nearest is written last
            distance, s, to = distance[by_distance], s[by_distance], own[by_distance]
            nearer = distance < best[to]
            at[to[nearer]], best[to[nearer]] = s[nearer], distance[nearer]
    return at, best


def _low_places(x: Array, places: Array, apart: float) -> tuple[Index, Index]:
    """Points (N, 3) and the places (M, 3) that are no farther from them than the places before and
    after, as indices, (n,) each: those that are, or are beside, the nearest of the path.

    ``apart``: how far one place is from the next at most, m.
    """
    squares = (places**2).sum(axis=1) - 2 * x @ places.T + (x**2).sum(axis=1)[:, None]
    distances = np.sqrt(np.maximum(squares, 0.0))
    low = distances <= distances.min(axis=1)[:, None] + apart
    low[:, 1:] &= distances[:, 1:] <= distances[:, :-1]
    low[:, :-1] &= distances[:, :-1] <= distances[:, 1:]
    point, place = np.nonzero(low)
    return point, place


def _closest(path: Path, x: Array, s: Array, least: Array, most: Array) -> tuple[Array, Array]:
    """The least distances from points (N, 3) that Newton's method finds from places s (N,) between
    others, (N,) each, and where."""
    best, at = np.full(len(x), np.inf), s.copy()
    moving, s, rounding = np.arange(len(x)), s.copy(), 1e-15 * np.abs(path.knots).max()
    for _ in range(_STEPS):
        if not len(moving):
            break
        p, dp, ddp = (path(s[moving], order) for order in range(3))
        away, square = p - x[moving], (dp**2).sum(axis=1)
        distance = np.linalg.norm(away, axis=1)
        nearer = distance < best[moving]
        best[moving[nearer]], at[moving[nearer]] = distance[nearer], s[moving[nearer]]
        bend = square + np.maximum((away * ddp).sum(axis=1), -square / 2)
        step = (away * dp).sum(axis=1) / np.where(bend > 0, bend, np.inf)
        before = s[moving]
        s[moving] = np.clip(before - step, least[moving], most[moving])
        moving = moving[np.abs(s[moving] - before) > rounding]
    return best, at


def tube_excess(scene: Scene, trajectory: Trajectory) -> Excess | None:
    """By how much the motion leaves the tube of its scene, as a share of the tube; negative where
    it stays inside. None if there is no tube."""
    blank = excess_of(scene, OwnMeasure.TUBE)
    if blank is None or scene.path is None or scene.tube is None:
        return None
    path = scene.path.between(*scene.given_points)
    farthest, t = farthest_from(path, trajectory.position, scene.tube)
    over = farthest - scene.tube
    return replace(blank, t=t, value=over / scene.tube, amount=over)


def farthest_from(path: Path, position: PiecewisePolynomial, asked: float) -> tuple[float, float]:
    """The largest distance (m) of a motion from a path, and when (s): that of an instant where all
    of the motion is known to keep what is asked for (m), and otherwise a bound that no instant
    exceeds."""

    def bound(points: Array, s: Array) -> Array:
        on = path.interval(s.mean(axis=1))
        begin, end = path.knots[on, None], path.knots[on + 1, None]
        bound = from_moving_place(path, on, points, np.clip(s, begin, end))
        # Where the nearest place leaps from one side of a bend to the other, one that stays is
        # nearer.
        for place in s.T:
            bound = np.minimum(bound, largest_norm(points - path(place)[:, None]))
        return bound

    return largest_distance(
        path,
        position,
        nearest_places(path, position.at(position.knots))[0],
        lambda pieces, since, x, s: nearest_places(path, x)[0],
        bound,
        asked,
    )
