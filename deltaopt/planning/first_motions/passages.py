"""Paths of straight lines past keep-out bodies, where no simple bend of a motion leads around them.

Places beside the edges of every body, at several distances, places of a coarse grid, and places
halfway between bodies are connected by straight lines. The nearest places of two convex bodies tell
a plane between them, of which all is at least half as far from both as these are from each other:
so narrow passages are found whatever bounds them. Distances from convex bodies are convex along a
line, so that two tangents bound them between samples: a line that counts as clear is clear. The
shortest path is looked for as if all lines were clear; those that leave the places on it are then
checked, until the path is made of clear lines (a lazy probabilistic roadmap with places that are
not random, after Bohlin and Kavraki 2000).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations, islice, pairwise, product
from math import dist, inf

import numpy as np

from deltaopt.curves.piecewise import Array, Index, Truths
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.motion.links import planned_distances
from deltaopt.motion.sure_bounds import signed_distances
from deltaopt.planning.first_motions.bands import without_bodies
from deltaopt.planning.first_motions.beside_bodies import beside_body
from deltaopt.planning.first_motions.roadmap import path_over_grid, spacing
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.feasibility import room_at_rest
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import given_points

BESIDE = (4e-4, 3e-3, 1.5e-2)
"""Distances beside bodies of the places that are connected, m. A passage is found if it is wider
than the first and its ends are beside edges of a body."""
_COARSE, _FINE = (5, 7, 7), (9, 13, 13)
"""Places of grids: depths, and both ways across. The finer one finds ways along the edge of the
workspace, and takes several times as long."""
_SPARE = 2e-4
"""m beyond the clearance asked for: corners of a path that touches bodies cannot be rounded."""
_PLACES, _MOST_PLACES, _MOST_PLANES = 2000, 12_000, 48
"""How many places are connected, and where these lead to no path, and how many planes between
bodies are looked at: those with the least detour. Of eight bodies there may be thirteen thousand
places, of thirty forty thousand and four hundred planes."""
_TRIED = (
    (_COARSE, False, _SPARE, 400, _PLACES),
    (_COARSE, True, _SPARE, 400, _PLACES),
    (_COARSE, True, 0.0, 400, _PLACES),
    (_FINE, True, _SPARE, 60, _PLACES),
    (_COARSE, True, _SPARE, 400, _MOST_PLACES),
)
"""In turn: the grid, whether places on long edges and between bodies are looked at too, what is to
spare (m), how many searches for a shortest path are made, and over how many places. Each search
finds that at least one line is blocked, or ends; with the finer grid one takes some 20 ms where
there is no way."""
_STEPS = (16, 24, 32, 48)
"""Of grids over all that the robot reaches, along the reach of a chain, which are looked at where
none of these leads to the goal: a passage in which one has no place may hold one of another."""
_FARTHER = (0.0, 0.5)
"""Of the distance of neighbours in such a grid: how far from bodies its places are besides. Between
places that are nearer lines may lead through their corners."""
_ANOTHER = 0.2
"""Of the way from start to goal: another path has no corner nearer to one of the shortest."""
_ROOM = 0.6
"""By what share of the way from start to goal the grid reaches beyond both."""
_ALONG = 3
"""Places on the straight line from start to goal, to which the nearest ones on edges and planes are
tried."""
_PROJECTIONS = 30
"""From one body to the other, to find the nearest places of both: between flat sides two suffice,
and what is not exact is only a plane that is somewhat nearer to one of them."""
_NARROWEST, _WIDEST = 1e-5, 0.5
"""Of passages whose middle is looked at: m, and of the way from start to goal. Bodies that touch
leave none, and the grid has places in wider ones."""
_PARALLEL = 1e-6
"""Sine of the angle between planes that are taken not to cross."""
_BETWEEN, _CLOSELY = np.linspace(0.0, 1.0, 9), np.linspace(0.0, 1.0, 65)
"""Of a line, where distances and their slopes are taken; and where links are looked at, whose
distances are not convex along it."""
_TOUCHED = 1e-6
"""m from a body. A line that touches two leads through where they meet, unless they are touched
where it begins or ends."""
_LEAST_ROOM = 1e-12
"""Room for the platform at rest, without unit, below which links are not looked at: where arms and
bars are in line their angles are not known."""
_KNOWN, _ROUNDING = 0.5, 1e-12
"""Least length of the slope of a distance, which is 1 where it is known, and m by which a line may
be too near to a body: it may begin on one."""


def shortest_paths(scene: Scene) -> Iterator[Array]:
    """The corners of the shortest path of clear lines from start to goal, (n, 3), m, both ends
    among them, and of the shortest that has none near these, as far as there are such paths. Their
    lines touch bodies only where no others lead there."""
    path = next(paths_of_lines(scene), None)
    if path is not None:
        yield path
        yield from islice(_over_places(scene, tuple(map(vector3, path[1:-1]))), 1)


def paths_of_lines(scene: Scene) -> Iterator[Array]:
    """Shortest paths of clear lines over one set of places after the other, (n, 3) each, m, as far
    as there is one; over all that the robot reaches if there is none between start and goal or not
    far beyond."""
    found = False
    for path in _over_places(scene, ()):
        found = True
        yield path
    far = None if found else _far_around(scene)
    if far is not None:
        yield far


def _over_places(scene: Scene, known: tuple[Vector3, ...]) -> Iterator[Array]:
    """Shortest paths of clear lines over places about start and goal, (n, 3) each, m, over one set
    of places after the other, all of them without what is near ``known`` places, m."""
    found = (_over_set(scene, number, known) for number in range(len(_TRIED)))
    return (path for path in found if path is not None)


@lru_cache(maxsize=64)
def _over_set(scene: Scene, number: int, known: tuple[Vector3, ...]) -> Array | None:
    """The path over one set of places. What is asked for again, as where all ways along such paths
    have failed, is not looked for again."""
    grid, between, spare, searches, most = _TRIED[number]
    ends = np.array(given_points(scene.task))
    places = _places(scene, ends, grid, between=between)
    apart = np.linalg.norm(places[:, None] - np.reshape(known, (-1, 3)), axis=2)
    places = places[(apart > _ANOTHER * dist(*ends)).all(axis=1)]
    if most > _PLACES >= len(places):
        return None  # they all have been looked at
    return _path(_StraightLines(scene, spare), ends, places, searches, most)


@lru_cache(maxsize=16)
def _far_around(scene: Scene) -> Array | None:
    """A path over a grid of all that the robot reaches, cut short; None if there is none of clear
    lines."""
    lines = _StraightLines(scene, _SPARE)
    for steps in _STEPS:
        for share in _FARTHER:
            spare = share * spacing(scene, steps)
            path = path_over_grid(lines.without, steps, replace(lines, spare=spare).room)
            if path is None:
                break  # nor is there one farther from bodies
            if all(lines.are_clear(a, b[None])[0] for a, b in pairwise(path)):
                return lines.cut_short(path)
    return None


def _path(
    lines: _StraightLines, ends: Array, others: Array, searches: int, most: int
) -> Array | None:
    """The shortest clear path over places (N, 3), m, with so many searches, and over so many of
    them, at most."""
    held = others[lines.room(others) > 0]
    places = np.vstack([ends, held[_least_detours(ends, held, most)]])
    n = len(places)
    length = np.stack([np.linalg.norm(places - place, axis=1) for place in places])
    ahead, known = length[:, 1].copy(), np.zeros(n, dtype=np.bool)
    length[np.arange(n), np.arange(n)] = inf
    for _ in range(searches):
        path = _shortest(length, ahead)
        if path is None:
            return None
        new = [place for place in path if not known[place]]
        if not new:
            return np.asarray(places[path])
        for place in new:
            known[place] = True
            joined = np.flatnonzero(np.isfinite(length[place]) & ~known)
            blocked = joined[~lines.are_clear(places[place], places[joined])]
            length[place, blocked] = length[blocked, place] = inf
    return None


def _least_detours(ends: Array, places: Array, number: int) -> Index:
    """Those of places, (N, 3), by way of which it is least far from end to end, so many at most, in
    their order."""
    lengths = np.linalg.norm(places[:, None] - ends, axis=2).sum(axis=1)
    return np.sort(np.argsort(lengths, kind="stable")[:number])


def what_was_searched(scene: Scene) -> str:
    """In words."""
    distances = ", ".join(f"{1e3 * each:g}" for each in BESIDE)
    return (
        "neither bends to four sides of each body nor straight lines between places "
        f"{distances} mm beside its edges, halfway between bodies, a grid of "
        f"{' x '.join(map(str, _FINE))} places, and one over all that the robot reaches, "
        f"{1e3 * spacing(scene, _STEPS[-1]):.3g} mm apart,"
    )


@dataclass(frozen=True)
class _StraightLines:
    """What a straight line must stay clear of, with how much to ``spare``, m."""

    scene: Scene
    spare: float

    @cached_property
    def without(self) -> Scene:
        """The scene without bodies, for where the platform can be held."""
        return without_bodies(self.scene)

    @cached_property
    def _kept(self) -> Array:
        return problem_of(self.scene).limits.least_distances + self.spare

    @cached_property
    def _touched_by_ends(self) -> Truths:
        """Which bodies the start and the goal touch, (2, rows): in a corner of a tray two."""
        distance, _ = signed_distances(problem_of(self.scene), np.array(self.scene.given_points))
        return np.asarray(distance < self._kept + _TOUCHED)

    def room(self, places: Array) -> Array:
        """The room for the platform at rest at places, (N,), negative where they are not clear."""
        distance, _ = signed_distances(problem_of(self.scene), places)
        is_clear = (distance > self._kept).all(axis=1)
        room = np.where(is_clear, room_at_rest(self.without, places), -1.0)
        return np.where(self._have_links_clear(places, room), room, -1.0)

    def cut_short(self, path: Array) -> Array:
        """A path, (n, 3), from each corner by a clear line to the last that one leads to."""
        kept, here = [0], 0
        while here < len(path) - 1:
            later = np.flatnonzero(self.are_clear(path[here], path[here + 1 :]))
            here += 1 + int(later[-1]) if len(later) else 1
            kept.append(here)
        return np.asarray(path[kept])

    def are_clear(self, begin: Array, ends: Array) -> Truths:
        """Whether the lines from a place to others, (N, 3), are clear, (N,)."""
        x = begin + _BETWEEN[:, None] * (ends - begin)[:, None]
        distance, slope = signed_distances(problem_of(self.scene), x.reshape(-1, 3))
        distance = distance.reshape(len(ends), len(_BETWEEN), distance.shape[1])
        clear = np.asarray((distance >= self._kept - _ROUNDING).all(axis=(1, 2)))
        way, distance = (ends - begin)[clear], distance[clear]  # tangents take longer than samples
        slope = slope.reshape(len(ends), *distance.shape[1:], 3)[clear]
        rate = np.einsum("nsrc,nc->nsr", slope, way)
        known = np.einsum("nsrc,nsrc->nsr", slope, slope) > _KNOWN**2  # on a surface it may be 0
        most = np.linalg.norm(way, axis=1)[:, None, None]
        least = _least(distance, np.where(known, rate, -most), np.where(known, rate, most))
        touched = least < self._kept + _TOUCHED
        by_ends = (touched <= self._touched_by_ends[:, None]).all(axis=2).any(axis=0)
        leads_between = (touched.sum(axis=1) > 1) & ~by_ends
        clear[clear] = (least >= self._kept - _ROUNDING).all(axis=1) & ~leads_between
        held = room_at_rest(self.without, x[clear].reshape(-1, 3))
        clear[clear] = (held.reshape(-1, len(_BETWEEN)) > 0).all(axis=1)
        if self.scene.planned_links:
            x = (begin + _CLOSELY[:, None] * (ends - begin)[clear][:, None]).reshape(-1, 3)
            links = self._have_links_clear(x, room_at_rest(self.without, x))
            clear[clear] = links.reshape(-1, len(_CLOSELY)).all(axis=1)
        return clear

    def _have_links_clear(self, places: Array, room: Array) -> Truths:
        """At which places, (N, 3), links that are planned to keep clear of bodies do, (N,); nowhere
        where there is no ``room`` for the platform at rest, (N,), as in a singularity."""
        if not self.scene.planned_links:
            return np.ones(len(places), np.bool)
        held = np.asarray(room > _LEAST_ROOM)
        distance, _ = planned_distances(self.scene, places[held])
        held[held] = (distance > [each.least for each in self.scene.kept_links]).all(axis=1)
        return held


def _least(distance: Array, onwards: Array, so_far: Array) -> Array:
    """Least values of convex functions by their tangents at samples, (N, samples, rows) each, of
    which the rates ``onwards`` bound what follows, and ``so_far`` what was before."""
    h = _BETWEEN[1] - _BETWEEN[0]
    before, after, down, up = distance[:, :-1], distance[:, 1:], onwards[:, :-1], so_far[:, 1:]
    dips = (down < 0) & (up > 0)
    t = (after - before - up * h) / np.where(dips, down - up, 1.0)
    lowest = np.where(dips, before + down * t, np.minimum(before, after))
    return np.asarray(lowest.min(axis=1))


def _places(scene: Scene, ends: Array, numbers: tuple[int, ...], *, between: bool) -> Array:
    """Places beside all bodies and of a grid, (N, 3), m; ``between``: all along edges and in the
    planes between bodies too. ``numbers``: of the grid's places along x, y and z."""
    margin = _ROOM * dist(ends[1], ends[0])
    low, high = ends.min(axis=0) - margin, ends.max(axis=0) + margin
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, numbers, strict=True)]
    grid = np.array(list(product(*axes)))
    line = ends[0] + np.linspace(0.0, 1.0, _ALONG)[:, None] * (ends[1] - ends[0])
    near = line if between else np.zeros((0, 3))
    beside = [
        beside_body(body, scene.least_clearance + distance, near)
        for body in scene.kept_out
        for distance in BESIDE
    ]
    found = [grid, *beside]
    if not between:
        return np.vstack(found)
    planes = _planes_between(scene, line)
    around = np.vstack([line, *beside[len(BESIDE) - 1 :: len(BESIDE)]])
    around = around[((around > low) & (around < high)).all(axis=1)]
    for i, plane in enumerate(planes):
        inside = plane.foot(around)
        crossings = [plane.crossing(line, other) for other in planes[:i]]
        found += [inside, *crossings]
    return np.vstack(found)


@dataclass(frozen=True)
class _Plane:
    """A plane between two bodies: a place in it, m, and its unit normal."""

    place: Array
    normal: Array

    def foot(self, x: Array) -> Array:
        """The nearest places of the plane to places (N, 3), m."""
        return np.asarray(x - ((x - self.place) @ self.normal)[:, None] * self.normal)

    def crossing(self, x: Array, other: _Plane) -> Array:
        """The nearest places to places (N, 3) on the line where it crosses another plane, m; none
        if they are parallel."""
        normals = np.stack([self.normal, other.normal])
        if np.linalg.norm(np.cross(*normals)) < _PARALLEL:
            return np.zeros((0, 3))
        heights = np.stack([(x - each.place) @ each.normal for each in (self, other)])
        return np.asarray(x - np.linalg.lstsq(normals, heights, rcond=None)[0].T)


def _planes_between(scene: Scene, line: Array) -> list[_Plane]:
    """A plane between each two bodies that leave a passage between them, as far as projections from
    places (n, 3), m, to one and the other find their nearest places."""
    kept = problem_of(scene).limits.least_distances
    used = np.flatnonzero(np.isfinite(kept))
    widest = _WIDEST * dist(line[-1], line[0])
    planes = list[_Plane]()
    for one, other in combinations(used.tolist(), 2):
        begin = end = line
        for _ in range(_PROJECTIONS):
            begin = _projected(scene, end, one)
            end = _projected(scene, begin, other)
        apart = np.linalg.norm(end - begin, axis=1)
        nearest = int(apart.argmin())
        if _NARROWEST < apart[nearest] - 2 * kept[one] < widest:
            normal = (end - begin)[nearest] / apart[nearest]
            planes.append(_Plane((begin + end)[nearest] / 2, normal))
    middles = np.reshape([plane.place for plane in planes], (-1, 3))
    return [planes[k] for k in _least_detours(line[[0, -1]], middles, _MOST_PLANES)]


def _projected(scene: Scene, x: Array, row: int) -> Array:
    """The nearest places of a body, grown by the tool, to places (N, 3), m."""
    distance, slope = signed_distances(problem_of(scene), x)
    return np.asarray(x - np.maximum(distance[:, row, None], 0.0) * slope[:, row])


def _shortest(length: Array, ahead: Array) -> list[int] | None:
    """The shortest path from place 0 to place 1, as places; None if there is none (A*).

    ``ahead``: the least that is left from each place, (N,).
    """
    n = len(length)
    cost, before, done = np.full(n, inf), np.zeros(n, dtype=np.intp), np.zeros(n, dtype=np.bool)
    cost[0] = 0.0
    for _ in range(n):
        place = int(np.where(done, inf, cost + ahead).argmin())
        if cost[place] == inf or done[place]:
            return None
        if place == 1:
            path = [1]
            while path[-1] != 0:
                path.append(int(before[path[-1]]))
            return path[::-1]
        done[place] = True
        through = cost[place] + length[place]
        better = through < cost
        cost[better], before[better] = through[better], place
    return None
