"""First motions in phases: through via points, and up and down in an approach.

A spline leads through all points, and as a last resort a motion that stops at each. Where an end
moves, slowing would change the end: of splines of many durations, that share the time among their
legs in several ways, it is the shortest that keeps the limits but for an excess; otherwise it is as
fast as the limits roughly allow.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from math import hypot, isfinite

import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial, hermite_pieces, spline_rates
from deltaopt.errors import RULED_OUT, if_possible
from deltaopt.files.validated_record import Vector3
from deltaopt.motion.time_scaling import rough_factor
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.belt import meetings_of
from deltaopt.planning.first_motions.initial_motion import Proposal
from deltaopt.planning.first_motions.moving_ends import (
    NEARLY,
    QUICK,
    first_between,
    first_moving_motions,
    from_end_of,
    moved,
    shortest_to_goal,
    stopping,
)
from deltaopt.problem.boundary import REST, Boundary
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import model_of
from deltaopt.scene.feasibility import room_at_rest, roomiest
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import given_goal

_WELL_INSIDE = 0.9
"""Share of the radius of a via point's sphere at which a first motion passes it at most: inside, so
that the solver begins there too."""
_AT_REST, _MOVING = (0.5, 1.0), (0.5, 1.0, 1.5, 2.0)
"""Powers of their lengths by which legs share a spline's time: from rest to rest, and where an end
moves. A short leg beside an end that is fast takes less than its share of the length."""
_ONWARDS = 0.1
"""Share of the way to the next point that it makes at least from one place to the next, where
spheres overlap, and that it leaves."""
_AROUND = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
_ACROSS = np.array(
    [(0.0, 0.0, 0.0)]
    + [(0.0, r * np.cos(a), r * np.sin(a)) for r in (0.3, 0.6, 0.9, 0.97) for a in _AROUND]
)
"""To places of the end of an upright cylinder that are looked at for room: its centre, and rings
about it, shares of its radius; near its rim alone it may be within reach."""


def through_gates(scene: Scene) -> Iterator[Proposal]:
    """First guesses, the best first: splines through all points, motions from point to point that
    stop at each, and from a start that moves a stop and what leads on from there. Knots are at the
    points: places of via points, or those straight above start and goal where an approach ends.

    Raises Infeasible for a belt that cannot be met.
    """
    moving, ways = scene.moves_at_ends, list(places_of_gates(scene))
    if scene.task.goal.moves:
        meetings_of(scene).require_any()
    at_rest = [partial(_spline_at_rest, power=each) for each in _AT_REST]
    in_motion = [partial(_moving_spline, most=each) for each in (QUICK, NEARLY)]
    for places in ways:
        for spline in in_motion if moving else at_rest:
            found = if_possible(RULED_OUT, spline, scene, places)
            if found is not None:
                yield Proposal("a spline through all points", found)
    for places in ways:
        found = if_possible(RULED_OUT, _stopping_at_each, scene, places)
        if found is not None:
            yield Proposal("a motion that stops at each point", found)
    stop = stopping(scene) if moving else None
    if stop is not None:
        onwards = through_gates(from_end_of(scene, stop.position))
        while (then := if_possible(RULED_OUT, next, onwards, None)) is not None:
            yield Proposal(f"a stop, then {then.name}", stop.then(then.motion))


def simple_motions(
    scene: Scene, under_way: PiecewisePolynomial | None = None
) -> Iterator[Proposal]:
    """First motions in phases or where an end moves. ``under_way``: what would follow the start."""
    return through_gates(scene) if scene.task.gates else first_moving_motions(scene, under_way)


def places_of_gates(scene: Scene) -> Iterator[Array]:
    """Places of the gates of a scene, (gates, 3), m: for via points with spheres those nearest to
    where a straight way would pass, then their centres, and then where there is most room, also at
    the end of an approach's cylinders: the places straight above may be out of reach."""
    via, columns = scene.task.via, scene.columns
    spheres = any(point.within for point in via)
    if spheres:
        yield _nearest_places(scene, via)
    above = [(column.level, column.y, column.z) for column in columns]
    middles = np.array([*(point.position for point in via), *above]).reshape(-1, 3)
    yield middles
    if spheres or columns:
        free = scene.model_copy(update={"approach": None})
        radii = [_WELL_INSIDE * point.within for point in via]
        inside = zip(middles, radii, strict=False)
        places = [roomiest(free, middle, radius) if radius else middle for middle, radius in inside]
        for middle, column in zip(middles[len(via) :], columns, strict=True):
            across = middle + column.radius * _ACROSS
            places.append(across[room_at_rest(free, across).argmax()])
        yield np.array(places)


def _nearest_places(scene: Scene, via: tuple[Boundary, ...]) -> Array:
    start, goal = scene.task.start, given_goal(scene.task)
    later = [*(point.position for point in via[1:]), goal.position]
    places = [np.array(start.position)]
    for point, after in zip(via, later, strict=True):
        centre, before = np.array(point.position), places[-1]
        way = np.array(after) - before
        share = float(((centre - before) * way).sum() / max((way**2).sum(), 1e-300))
        away = before + min(max(share, _ONWARDS), 1 - _ONWARDS) * way - centre
        distance, most = hypot(*away), _WELL_INSIDE * point.within
        places.append(centre + away * min(1.0, most / max(distance, 1e-300)))
    return np.array(places[1:])


def _spline_at_rest(scene: Scene, places: Array, power: float) -> Trajectory | None:
    """The spline from rest to rest, as fast as the limits roughly allow."""
    start, goal = scene.given_points
    points, one = np.array([start, *places, goal])[:, None], np.ones(1)
    coefficients, lengths = _splines(points, one, power * one)
    position = PiecewisePolynomial(np.append(0.0, np.cumsum(lengths)), coefficients[0])
    spline = Trajectory(position, model_of(scene.robot, scene.payload))
    factor = rough_factor(problem_of(scene), spline)
    return spline.slowed(factor) if isfinite(factor) else None


def _moving_spline(scene: Scene, places: Array, most: float) -> Trajectory | None:
    """The shortest spline between ends that move that keeps ``most`` of the limits, or the one that
    exceeds them least."""
    start, goal = scene.task.start, given_goal(scene.task)

    def splines(durations: Array) -> tuple[Array, Array]:
        T, powers = np.repeat(durations, len(_MOVING)), np.tile(_MOVING, len(durations))
        last = goal.position + T[:, None] * goal.belt
        points = [np.broadcast_to(each, last.shape) for each in (start.position, *places)]
        return _splines(np.array([*points, last]), T, powers, start.velocity, goal.velocity)

    return shortest_to_goal(scene, splines, most)


def _splines(
    points: Array, T: Array, powers: Array, first: Vector3 = REST, last: Vector3 = REST
) -> tuple[Array, Array]:
    """Cubic splines of durations T, (n,), s, through points, (K + 1, n, 3), m, with velocities at
    their ends, m/s, whose legs share the time in proportion to powers, (n,), of their lengths:
    coefficients, (n, K, 4, 3), and durations of their legs, (n, K), s."""
    shares = np.linalg.norm(np.diff(points, axis=0), axis=-1) ** powers
    lengths = T * shares / shares.sum(axis=0)
    v = spline_rates(lengths, points, np.array(first), np.array(last))
    pieces = hermite_pieces(lengths, [points[:-1], v[:-1]], [points[1:], v[1:]])
    return np.moveaxis(pieces, 2, 0), lengths.T


def _stopping_at_each(scene: Scene, places: Array) -> Trajectory | None:
    """The motion that stops at each of the places in turn; None if there is none."""
    stops: list[Vector3] = [(x, y, z) for x, y, z in places.tolist()]
    ends = zip([scene.start, *stops], [*stops, scene.goal], strict=True)
    whole: Trajectory | None = None
    for start, goal in ends:
        now = moved(goal, 0.0 if whole is None else whole.duration)
        leg = first_between(scene.model_copy(update={"start": start, "goal": now, **_ALONE}))
        if leg is None:
            return None
        whole = leg if whole is None else whole.then(leg)
    return whole


_ALONE = {"via": None, "approach": None}
