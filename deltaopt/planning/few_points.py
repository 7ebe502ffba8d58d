"""Via points whose spheres overlap: the planner asks for as few of them as it has to.

A motion may pass two such spheres in one place, with no time between them, but a phase between two
via points lasts some time. A scene without some of its points asks for less: where its best motion
passes all the points, in their order, no motion is better. Points that it misses are asked for in
the next round.

Where the best motion through either of two spheres misses the other, the best motion through both
may pass the circle in which they meet. Let a and b be their centres. Every sphere through that
circle whose centre lies between a and b holds all places that are in both:
(1 - s) (|x - a|² - r_a²) + s (|x - b|² - r_b²) <= 0 with a share s from 0 to 1. A scene with this
sphere in place of both asks for less, too. The planner looks for the share with which the motion
passes as far from the first sphere as from the second: on the circle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import groupby, pairwise, starmap
from math import dist, inf, isfinite, sqrt

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import NO_PLAN, if_possible
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.planning.journal import Progress
from deltaopt.planning.plan import Plan, quicker
from deltaopt.problem.boundary import Boundary
from deltaopt.scene.scene import Scene
from deltaopt.scene.way import Near, Via, via_point

_PASSED = 1e-9
"""m; of a via point that a motion passes, how far it is off at most: rounding."""
_ROUNDS = 6
"""In how many rounds other points are asked for. From then on a point that was missed and one
beside it are passed in the largest sphere inside both of theirs, which costs some time: otherwise a
plan through 60 points would take minutes."""
_AT_MOST = 1.1
"""About how many times as much a motion costs at most that passes two spheres in the largest sphere
inside both, as the best that passes them in one place."""
_SHARES, _ON_BOTH = 10, 1e-3
"""How many shares are tried at most, and how far outside either sphere a motion may pass them, as a
share of the smaller radius, for the place on the circle that is nearest to it to be taken."""


@dataclass(frozen=True)
class FewPoints:
    """Plans scenes with via points whose spheres overlap, asking for as few of these as it has to.

    ``planned``: plans a scene for all of its points. ``at_once``: the same from the best first
    motion alone. Both raise that there is no plan. ``tell``: is called with what is planned.
    """

    planned: Callable[[Scene], Plan]
    at_once: Callable[[Scene], Plan]
    tell: Progress

    def plan(self, scene: Scene) -> Plan:
        """The plan of a scene. Raises what ``planned`` raises of it."""
        via, given = scene.task.via, list(scene.via or ())
        overlap = [False, *starmap(_overlap, pairwise(via)), False]  # with the one before; the last
        everything, asked = set(range(len(via))), _first_asked(scene, overlap)
        tried, least = list[set[int]](), 0.0
        while asked != everything and len(tried) < 2 * _ROUNDS:
            tried.append(asked)
            less = _with_via(scene, [given[number] for number in sorted(asked)])
            if _stands_still(less):
                break
            self.tell(f"through {len(asked)} of the {len(via)} via points, whose spheres overlap:")
            found = if_possible(NO_PLAN, self._through_all, less)
            if found is None:
                break
            if len(tried) <= _ROUNDS:
                least = max(least, found.cost / (1 + found.gap))
            else:  # some spheres are smaller than was asked for
                found = replace(found, gap=inf)
            missed = [off if off >= _PASSED else 0.0 for off, _ in _passed(scene, found)]
            if not any(missed):
                return _told(scene, found, least)
            new = {
                min(everything - asked, key=lambda number: abs(number - worst))
                for worst in _worst_of_each_run(missed)
            }
            if len(tried) < _ROUNDS:
                beside = {k - 1 for k in new if overlap[k]} | {k + 1 for k in new if overlap[k + 1]}
                instead = asked - beside | new
                asked = asked | new if instead in tried else instead
                continue
            for number in new:
                pairs = ((k, via_point(given[k])) for k in (number - 1, number + 1) if k in asked)
                pair = next(((k, near) for k, near in pairs if _overlap(near, via[number])), None)
                if pair is None:
                    asked = asked | {number}
                else:
                    given[pair[0]] = _inside_both(pair[1], via[number])
        return _told(scene, self._through_all(scene), least)

    def _through_all(self, scene: Scene) -> Plan:
        """The plan of a scene through all of its points, of those whose spheres overlap two in one
        place, where that is best, or else in phases."""
        number = _first_pair(scene)
        if number is None:
            return self.planned(scene)
        inside = if_possible(NO_PLAN, self.planned, _inside_pairs(scene))
        found = if_possible(NO_PLAN, self.at_once, scene)
        most = inf if inside is None else inside.cost / _AT_MOST
        if found is not None and found.within_tolerance and found.cost <= most:
            return found
        in_one = if_possible(NO_PLAN, self._through_one_place, scene, number)
        if in_one is None or _turns_back(scene, number, in_one):
            return in_one or self.planned(scene)
        apart = if_possible(NO_PLAN, self.planned, scene)
        return quicker(in_one, apart) if apart else in_one

    def _through_one_place(self, scene: Scene, number: int) -> Plan | None:
        """The plan that passes a via point and the next one in one place; None where their spheres
        do not meet in a circle. Its gap is to the least of all that do, and infinite where other
        pairs are passed inside both spheres meanwhile."""
        given, via = list(scene.via or ()), scene.task.via
        one, next_one = via[number], via[number + 1]
        if dist(one.position, next_one.position) <= abs(one.within - next_one.within):
            return None

        def through(place: Via) -> Scene:
            return _with_via(scene, [*given[:number], place, *given[number + 2 :]])

        farther, least = dict[float, float](), 0.0
        while len(farther) < _SHARES:
            share = _next_share(farther)
            instead = through(_between(one, next_one, share))
            found = self.planned(_inside_pairs(instead))
            if max(off for off, _ in _passed(scene, found)) < _PASSED:
                return replace(found, scene=scene)
            if _first_pair(instead) is None:
                least = max(least, found.cost / (1 + found.gap))
            _, when = _passed(instead, found)[number]
            at = found.trajectory.position.at(np.array([when]))[0]
            off, of_next = (dist(at, each.position) - each.within for each in (one, next_one))
            farther[share] = off - of_next
            if max(off, of_next) < _ON_BOTH * min(one.within, next_one.within):
                break
        found = self._through_all(through(_on_circle(one, next_one, at)))
        gap = max(found.gap, found.cost / least - 1) if least else inf
        return replace(found, scene=scene, gap=gap)


def _told(scene: Scene, found: Plan, least: float) -> Plan:
    """The plan as one of a scene. ``least``: a cost that no plan undercuts, as far as the gaps of
    plans that asked for less are right; 0 where none is known. Where the plan's own gap is
    not known, this tells it."""
    if isfinite(found.gap) or not 0 < least <= found.cost:
        return replace(found, scene=scene)
    return replace(found, scene=scene, gap=found.cost / least - 1)


def _first_pair(scene: Scene) -> int | None:
    """The number of the first via point whose sphere overlaps the next one's."""
    pairs = enumerate(pairwise(scene.task.via))
    return next((number for number, pair in pairs if _overlap(*pair)), None)


def _inside_pairs(scene: Scene) -> Scene:
    """A scene with one sphere, inside both, in place of each two that overlap."""
    while (number := _first_pair(scene)) is not None:
        given, (one, next_one) = list(scene.via or ()), scene.task.via[number : number + 2]
        given[number : number + 2] = [_inside_both(one, next_one)]
        scene = _with_via(scene, given)
    return scene


def _stands_still(scene: Scene) -> bool:
    """Whether a point of a scene is the one before it."""
    start, via, goal = scene.task.start, scene.task.via, scene.task.goal
    places = [start.position, *(point.position for point in via)]
    places += [goal.position] if goal.is_given else []
    return any(a == b for a, b in pairwise(places))


def any_overlap(scene: Scene) -> bool:
    """Whether spheres of via points overlap those of the ones before them."""
    return _first_pair(scene) is not None


def _first_asked(scene: Scene, overlap: list[bool]) -> set[int]:
    """Numbers of the via points whose spheres overlap no other's, and where there are none of the
    one that is farthest from the start."""
    found = {number for number, each in enumerate(pairwise(overlap)) if not any(each)}
    away = [dist(each.position, scene.task.start.position) - each.within for each in scene.task.via]
    return found or {away.index(max(away))}


def _worst_of_each_run(missed: list[float]) -> list[int]:
    """The number of the largest of each run of numbers that are not 0."""
    runs = groupby(range(len(missed)), key=lambda number: missed[number] > 0)
    return [max(run, key=missed.__getitem__) for is_missed, run in runs if is_missed]


def _turns_back(scene: Scene, number: int, found: Plan) -> bool:
    """Whether motions near one that passes a via point and the next in one place would turn back to
    pass them one after the other: it enters the sphere of the first as it leaves the second's."""
    _, when = _passed(scene, found)[number]
    x, v = (found.trajectory.position.at(np.array([when]), order)[0] for order in (0, 1))
    into, out = (v @ (x - each.position) for each in scene.task.via[number : number + 2])
    return bool(into < 0 < out)


def _next_share(farther: dict[float, float]) -> float:
    """The share to look at after some, from how much farther from the first sphere than from the
    second motions pass with these, m: first 0 and 1, then by turns in the middle and where a line
    is zero between the nearest on both sides."""
    if len(farther) < 2:
        return float(len(farther))
    low = max(share for share, each in farther.items() if each < 0 or share == 0)
    high = min(share for share, each in farther.items() if share > low)
    if len(farther) % 2 or farther[low] >= farther[high]:
        return (low + high) / 2
    return low - farther[low] * (high - low) / (farther[high] - farther[low])


def _between(first: Boundary, second: Boundary, share: float) -> Near:
    """The sphere through the circle in which two meet, whose centre is at a share of the way from
    that of the first to that of the second."""
    a, b = np.array(first.position), np.array(second.position)
    square = (1 - share) * first.within**2 + share * second.within**2
    square -= share * (1 - share) * float(((b - a) ** 2).sum())
    return Near(at=vector3(a + share * (b - a)), within=sqrt(max(square, _PASSED**2)))


def _inside_both(first: Boundary, second: Boundary) -> Near:
    """The largest sphere inside two that overlap."""
    a, b = np.array(first.position), np.array(second.position)
    apart = dist(first.position, second.position)
    within = min((first.within + second.within - apart) / 2, first.within, second.within)
    way = min(max(first.within - within, 0.0), apart)
    return Near(at=vector3(a + (b - a) * (way / max(apart, 1e-300))), within=within)


def _on_circle(first: Boundary, second: Boundary, near: Array) -> Vector3:
    """The place nearest to another on the circle in which two spheres meet, m."""
    a, b = np.array(first.position), np.array(second.position)
    apart = dist(first.position, second.position)
    along = (b - a) / apart
    middle = (apart**2 + first.within**2 - second.within**2) / (2 * apart)
    across = near - a - along * ((near - a) @ along)
    radius = sqrt(max(first.within**2 - middle**2, 0.0))
    across *= radius / max(float(np.linalg.norm(across)), _PASSED)
    return vector3(a + middle * along + across)


def _overlap(first: Boundary, second: Boundary) -> bool:
    return dist(first.position, second.position) < first.within + second.within


def _passed(scene: Scene, found: Plan) -> list[tuple[float, float]]:
    """By how much a plan misses each via point of a scene, m, and when it is nearest, s."""
    return list(found.trajectory.passing(scene.task.via))


def _with_via(scene: Scene, via: list[Via]) -> Scene:
    return scene.model_copy(update={"via": tuple(via)})
