"""Bands past keep-out bodies: paths that bodies push away while they are drawn tight.

Where a path runs into a body it is bent around it, to each of four sides; what it then runs into is
passed in the same way, and every bent path is drawn tight.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache, reduce
from math import dist, hypot, inf

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import Array, Index
from deltaopt.limits.solid_distance import larger
from deltaopt.mechanisms.functions import Functions
from deltaopt.motion.links import planned_distances
from deltaopt.motion.sure_bounds import are_crossed, signed_distances
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.in_tube import room_in_tube
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.links import name_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import given_points

_SAMPLES = 64
"""Pieces of a band. More follow bodies more closely, but are drawn tight more slowly."""
MARGIN = 0.02
"""How far bands stay from bodies where there is room, as a share of the way from start to goal:
a first motion that touches bodies leaves a solver no inside to begin in."""
_RISE = 0.3
"""By how much the margin grows with the distance from an end that is nearer to a body than that."""
TENSIONS = np.geomspace(300.0, 3.0, 8)
"""Tension of a band over that with which a sample stays where it is, step by step: high ones draw
it straight between bodies, low ones leave it smooth where these push it."""
_DEPTH, _WIDTH = 6, 16
"""How many bodies are passed one after the other, and how many bands are bent in all: each costs
some 0.3 ms. With 12 two of 18 hard scenes took 0.1 % and 0.9 % longer, with 24 none less."""
_FARTHEST = 2.0
"""Of the way from start to goal, how far a path is bent aside at most."""
_LITTLE = 2 * MARGIN
"""Of the way: a shift that leaves a path about where it is."""
_SHARES, _BESIDE = np.geomspace(1 / 64, 1.0, 7).tolist(), 4
"""Of that shift, which are tried, and of how many samples to both sides: of so many that a path
which leads through a plate at an angle still does when they are shifted."""
_NEAR = 0.1
"""Of the way: bodies that a path comes nearer to are named."""
_ALIGNED, _BACK = 0.03, 3
"""Squared sine of the angle between arm and bars that bands keep, if start and goal do, and how
many steps at once bring them back to it."""
_IN_WORDS = {
    -1: "above",
    1: "below",
    -2: "on the -y side of",
    2: "on the +y side of",
    -3: "on the -z side of",
    3: "on the +z side of",
    0: "beside",
}
"""Sides of a body by the number of an axis, with its sign: x points down."""
Hit = tuple[int, int, int]
"""The body that a band runs into, and the first and the last sample that are inside of it, or
between which it leads through."""


@dataclass(frozen=True)
class Bodies:
    """The bodies of a scene as functions of the place. ``ends``: of paths past them, (2, 3), m.
    ``margin``: how far paths stay from bodies where there is room, a share of the way. ``tube``:
    the radius of the scene's tube, m, if paths are to stay in it as they stay clear of bodies."""

    scene: Scene
    ends: Array
    margin: float = MARGIN
    tube: float = inf

    @classmethod
    def of(cls, scene: Scene) -> Bodies:
        """From rest to rest, in a tube if there is one."""
        return cls(scene, np.array(given_points(scene.task)), tube=scene.tube or inf)

    @classmethod
    def along(cls, scene: Scene, motion: Trajectory) -> tuple[Bodies, Array]:
        """Between the ends of a motion, and its path, (n, 3), m."""
        path = sampled(motion)
        return cls(scene, path[[0, -1]]), path

    @cached_property
    def way(self) -> float:
        """How far the ends are apart, m, and at most how wide a tube is: no path is bent more."""
        return min(dist(self.ends[1], self.ends[0]), 2 * self.tube)

    def distances(self, x: Array) -> tuple[Array, Array]:
        """How far the tool's point at places (..., 3), m, is from bodies, and then links that are
        planned to keep clear of them, and at last from a tube's wall, (..., rows), and the
        derivatives by the place, (..., rows, 3)."""
        size, x = (*x.shape[:-1], len(self.kept)), x.reshape(-1, 3)
        distance, slope = signed_distances(problem_of(self.scene), x)
        if self.scene.planned_links:
            of_links, by_place = planned_distances(self.scene, x)
            lost = np.isnan(of_links) | np.isnan(by_place).any(axis=2)  # another limit holds
            of_links[lost], by_place[lost] = inf, 0.0
            distance, slope = np.hstack([distance, of_links]), np.hstack([slope, by_place])
        if self.tube < inf:
            room, inwards = room_in_tube(self.scene.axis_of_tube, self.tube, x)
            distance = np.hstack([distance, room[:, None]])
            slope = np.hstack([slope, inwards[:, None]])
        return distance.reshape(size), slope.reshape(*size, 3)

    @cached_property
    def at_ends(self) -> Array:
        """Distances of start and goal from each body, (2, rows), m."""
        return self.distances(self.ends)[0]

    @cached_property
    def kept(self) -> Array:
        """The least distance from each body, m, then those of links that are planned to keep clear
        of one, and from a tube's wall."""
        others = [each.least for each in self.scene.kept_links] + [0.0] * (self.tube < inf)
        return np.append(problem_of(self.scene).limits.least_distances, others)

    def margins(self, x: Array) -> Array:
        """How far places (…, 3) are to be from bodies, (…, rows): less near an end that is."""
        usual = margin = self.kept + self.margin * self.way
        for end, own in zip(self.ends, self.at_ends, strict=True):
            if (own < usual).any():
                away = np.linalg.norm(x - end, axis=-1)[..., None]
                margin = np.minimum(margin, own + _RISE * away)
        return margin

    def drawn(self, bands: Array, tensions: Array, to: Array | float = 0.0) -> Array:
        """Bands (W, n, 3) drawn tight by one tension after the other, or drawn ``to`` a path,
        (n, 3), and pushed away by bodies; their ends stay."""
        for tension in tensions.tolist():
            bands = to + _smoothing(tension, bands.shape[1]) @ (bands - to)
            for _ in range(2):
                inner = bands[:, 1:-1].reshape(-1, 3)
                distance, slope = self.distances(inner)
                short = np.maximum(self.margins(inner) - distance, 0.0)
                worst, which = short.argmax(axis=1), np.arange(len(inner))
                inner = self.in_reach(inner + short[which, worst, None] * slope[which, worst])
                bands[:, 1:-1] = inner.reshape(len(bands), -1, 3)
        return bands

    def beside_corners(self, paths: Array) -> Array:
        """Paths, (W, n, 3), with both ends of every piece that leads through a body shifted by as
        much as its middle is short of the margin: beside an edge one sample may have been pushed
        out of one face and the next one out of another, so that their line cuts the edge off."""
        pierced, shifts = self.pierced(paths, self.distances(paths)[0]), np.zeros_like(paths)
        own, piece = np.nonzero(pierced >= 0)
        body, which = pierced[own, piece], np.arange(len(own))
        distance, slope = self.distances((paths[own, piece] + paths[own, piece + 1]) / 2)
        short = np.maximum(self.kept[body] + self.margin * self.way - distance[which, body], 0.0)
        shift = short[:, None] * slope[which, body]
        np.add.at(shifts, (own, piece), shift)
        np.add.at(shifts, (own, piece + 1), shift)
        shifts[:, [0, -1]] = 0.0
        return paths + shifts

    def in_reach(self, places: Array) -> Array:
        """Places, (…, 3), m, moved as little as it takes for arms and bars to be no more in line
        than ``_ALIGNED``, or than at an end, as far as the first derivative tells."""
        found, model = places.reshape(-1, 3), problem_of(self.scene).model
        which, nearest = np.arange(len(found)), _nearest_to_line(model.functions)
        for _ in range(_BACK):
            least, slope = nearest(found[which], parameters=model.parameters)
            short = self._aligned - least
            out = short[:, 0] > 0
            if not out.any():
                break
            which, short, slope = which[out], short[out], slope[out]
            found[which] += short * slope / (slope**2).sum(axis=1, keepdims=True)
        return found.reshape(places.shape)

    @cached_property
    def _aligned(self) -> float:
        at_ends = problem_of(self.scene).model.alignments(self.ends)
        return min(_ALIGNED, float(at_ends.min()) / 2)

    def hits(self, bands: Array) -> list[Hit | None]:
        """What each of some bands, (W, n, 3), runs into first; None where it is clear."""
        distance, _ = self.distances(bands)
        inside = distance < self.kept
        inside[:, [0, -1]] = False
        found: list[Hit | None] = [None] * len(bands)
        for w in np.flatnonzero(inside.any(axis=(1, 2))).tolist():
            first = int(inside[w].any(axis=1).argmax())
            body = int((distance[w, first] - self.kept).argmin())
            last = first + int(inside[w, first:, body].argmin()) - 1  # at their ends none is
            found[w] = body, first, last
        others = np.array([hit is None for hit in found])
        pierced = self.pierced(bands[others], distance[others])
        for w, bodies in zip(np.flatnonzero(others).tolist(), pierced, strict=True):
            if bodies.max() >= 0:
                first = int((bodies >= 0).argmax())
                before = min(max(first, 1), bands.shape[1] - 3)  # neither sample beside is an end
                found[w] = int(bodies[first]), before, before + 1
        return found

    def pierced(self, places: Array, distance: Array) -> Index:
        """The body that each piece of paths, (..., n, 3), leads through, -1 for none, (..., n - 1),
        however thin it is; ``distance``: of the places from each body, m, (..., n, rows).

        Distances of a point change by no more than its way: pieces are looked at that are longer
        than the room at their ends. Forearms are thicker than pieces are long.
        """
        room = (distance - self.kept)[..., : len(problem_of(self.scene).limits.least_distances)]
        begin, along = places[..., :-1, :], np.diff(places, axis=-2)
        apart = np.linalg.norm(along, axis=-1)[..., None]
        *piece, row = np.nonzero(room[..., :-1, :] + room[..., 1:, :] < apart)
        crossed = are_crossed(problem_of(self.scene), begin[*piece], along[*piece], row)
        found = np.full(along.shape[:-1], -1)
        found[*(which[crossed] for which in piece)] = row[crossed]
        return found

    def bent(self, front: list[tuple[Array, Hit]]) -> list[Array]:
        """Bands bent around the bodies that each of some bands is inside of from one sample to
        another, to the four sides of its own direction, as far as there they are clear of them."""
        lanes = [
            (band, hit, side)
            for band, hit in front
            for side in sides_of(band[hit[2] + 1] - band[hit[1] - 1])
        ]
        if not lanes:
            return []
        inside = [band[first : last + 1] for band, (_, first, last), _ in lanes]
        lane = np.repeat(np.arange(len(lanes)), [len(x) for x in inside])
        x, sides = np.concatenate(inside), np.array([side for *_, side in lanes])
        bodies = np.array([body for _, (body, _, _), _ in lanes])
        shifts, found = np.zeros(len(lanes)), np.zeros(len(lanes), dtype=np.bool)
        going = ~found
        while going.any():
            chosen = np.flatnonzero(going[lane])
            own, row = lane[chosen], np.arange(len(chosen))
            distance, slope = self.distances(x[chosen] + shifts[own, None] * sides[own])
            body = bodies[own]
            short = self.kept[body] + MARGIN * self.way - distance[row, body]
            gain = np.maximum((slope[row, body] * sides[own]).sum(axis=1), 0.2)
            begin = np.flatnonzero(np.diff(own, prepend=-1))
            found[going] = np.maximum.reduceat(short, begin) <= 1e-3 * self.way
            more = np.maximum.reduceat(np.maximum(short, 0.0) / gain, begin)
            shifts[going] += np.where(found[going], 0.0, more)
            going &= ~found & (shifts <= _FARTHEST * self.way)
        return [
            pulled(band, first, last, shifts[k] * side)
            for k, (band, (_, first, last), side) in enumerate(lanes)
            if found[k]
        ]

    def is_nearly_clear(self, band: Array) -> bool:
        """Whether a band leads through no body, however thin, though it may cut corners: whether
        where it runs into one a little shift to a side makes it clear of that, and leads into no
        body that it is clear of there: not between two that touch."""
        distance, _ = self.distances(band)
        room = distance - self.kept
        pierced = self.pierced(band, distance)
        inside = {(k + 1, body) for k, body in np.argwhere(room[1:-1] < 0).tolist()}
        inside |= {(k, body) for k, body in enumerate(pierced.tolist()) if body >= 0}
        if not inside:
            return True
        rows, (where, hit) = np.arange(len(self.kept)), np.array(sorted(inside)).T
        beside = np.abs(where - where[:, None]) <= 2 * _BESIDE
        others = (beside[:, :, None] & (hit[:, None] == rows)).any(axis=1) & (hit[:, None] != rows)
        around = np.clip(where[:, None] + np.arange(-_BESIDE, _BESIDE + 1), 0, len(band) - 1)
        sides = self.way * _LITTLE * sides_of(band[-1] - band[0])[:, None]
        for share in _SHARES:
            paths = band[around][:, None] + share * sides
            distance, _ = self.distances(paths)
            past = ((distance >= self.kept) | others[:, None, None]).all(axis=(2, 3))
            through, of = self.pierced(paths[past], distance[past]), np.nonzero(past)[0][:, None]
            past[past] = np.logical_or(through < 0, others[of, through]).all(axis=1)
            left = ~past.any(axis=1)
            if not left.any():
                return True
            around, others = around[left], others[left]
        return False

    def sides(self, band: Array) -> tuple[str, ...]:
        """On which sides a band passes the bodies that it comes near, in order of time:
        for each body the side at the middle of the places where the band is near it."""
        distance, slope = self.distances(band[1:-1])
        near = distance <= self.kept + _NEAR * self.way
        found, tools = [], [("", index) for index, _ in self.scene.obstacles]
        links = [(name_of(link), index) for link, index, _ in self.scene.planned_links]
        used = np.flatnonzero(np.isfinite(self.kept))  # rows that are of a body
        for row, (link, index) in zip(used, tools + links, strict=False):  # not of a tube
            places = np.flatnonzero(near[:, row])
            if len(places):
                place = int(places[len(places) // 2])
                side = f"{link} clear of" if link else _IN_WORDS[int(_side(slope[place, row]))]
                found.append((place, f"{side} keep_out[{index}]"))
        return tuple(dict.fromkeys(name for _, name in sorted(found)))

    def passed(self, distance: Array, slope: Array) -> Index:
        """On which sides paths pass each body where they are nearest to it, (..., rows), as of
        ``_side``, by the distances of their places and the derivatives, (..., n, rows) and
        (..., n, rows, 3); 0 for bodies that they do not come near."""
        room = distance - self.kept
        nearest = room.argmin(axis=-2)[..., None, :]
        least = np.take_along_axis(room, nearest, axis=-2)[..., 0, :]
        push = np.take_along_axis(slope, nearest[..., None], axis=-3)[..., 0, :, :]
        return np.where(least <= _NEAR * self.way, _side(push), 0)


def without_bodies(scene: Scene) -> Scene:
    """The scene as if nothing were in its way."""
    none = {"keep_out": None, "clearance": None, "planned_links": ()}
    return scene.model_copy(update=none)


def clear_bands(bodies: Bodies, base: Array) -> Iterator[Array]:
    """Bands that are clear of all bodies, from one that is not."""
    front, bent = [(base, bodies.hits(base[None])[0])], 0
    for _ in range(_DEPTH):
        around = bodies.bent([(band, hit) for band, hit in front if hit is not None])
        candidates = around[: _WIDTH - bent]
        bent += len(candidates)
        if not candidates:
            return
        bowed = bodies.in_reach(np.array(candidates))
        drawn = bodies.drawn(bowed, TENSIONS)
        hits = bodies.hits(np.concatenate([drawn, bowed]))
        front = []
        for k, hit in enumerate(hits[len(bowed) :]):
            if hits[k] is None:
                yield drawn[k]
            elif hit is None:
                yield bowed[k]
            else:
                front.append((bowed[k], hit))


@lru_cache(maxsize=32)
def _nearest_to_line(functions: Functions) -> RowFunction:
    """(x, p) -> the least squared sine of the angles between arms and bars, 1, and its derivative
    by the place, 3."""
    x, p = ca.SX.sym("x", 3), functions.symbols()
    least = -reduce(larger, ca.vertsplit(-functions.serial_distances(x, p)[3:]))
    return RowFunction.of("nearest_to_line", [x, p], [least, ca.gradient(least, x)])


@lru_cache(maxsize=64)
def _smoothing(tension: float, n: int) -> Array:
    """A linear map of the samples of a band, (n, n), that lessens its tension and its bending, and
    leaves its ends."""
    second = np.diff(np.eye(n), 2, axis=0)
    stiffness = np.zeros((n, n))
    stiffness[1:-1] = tension * (10 * (second.T @ second)[1:-1] - second)
    rows = np.hstack([np.eye(n) + stiffness, np.eye(n)])
    for k in range(n):  # Gauss and Jordan's elimination: the same bits on every processor
        pivot = rows[k] / rows[k, k]
        rows -= rows[:, k, None] * pivot
        rows[k] = pivot
    return np.asarray(rows[:, n:])


def _side(push: Array) -> Index:
    """The axis along which a body pushes away most, by its direction (..., 3): counted from 1, with
    its sign, (...); 0 where that is not known."""
    axis = np.abs(push).argmax(axis=-1)
    along = np.take_along_axis(push, axis[..., None], axis=-1)[..., 0]
    return np.asarray(np.sign(np.nan_to_num(along)).astype(int) * (axis + 1))


def sides_of(along: Array) -> Array:
    """Unit vectors up, to both sides and down, across a direction, or across y where it is zero."""
    ahead = along / hypot(*along) if along.any() else np.array([0.0, 1.0, 0.0])
    up = np.array([-1.0, 0.0, 0.0]) + ahead[0] * ahead
    if hypot(*up) < 1e-3:  # straight up or down
        up = np.array([0.0, 1.0, 0.0]) - ahead[1] * ahead
    up /= hypot(*up)
    left = np.cross(ahead, up)
    return np.array([up, left, -left, -up])


def pulled(band: Array, first: int, last: int, shift: Array) -> Array:
    """A band of which the samples from one to another are shifted, and those before and after in
    proportion."""
    n = len(band)
    share = np.ones(n)
    share[:first] = np.sin(np.pi / 2 * np.arange(first) / first)
    share[last + 1 :] = np.sin(np.pi / 2 * np.arange(n - last - 2, -1, -1) / (n - 1 - last))
    return np.asarray(band + share[:, None] * shift)


def sampled(motion: Trajectory) -> Array:
    """Places of a motion at equal distances along its path, (n, 3), m."""
    u = np.linspace(motion.knots[0], motion.knots[-1], 4 * _SAMPLES + 1)
    return resampled(motion.position.at(u))


def resampled(x: Array, pieces: int = _SAMPLES) -> Array:
    """Places at equal distances along straight lines between places (N, 3), m."""
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1)))
    wanted = np.linspace(0.0, along[-1], pieces + 1)
    return np.stack([np.interp(wanted, along, x[:, i]) for i in range(3)], axis=1)
