"""A crude planner: from rest to rest on quintics through random points, as slowly as need be."""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from itertools import pairwise, product

import numpy as np
from numpy.random import Generator

import deltaopt
from deltaopt import Belt, Scene, State, Trajectory
from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.robot.model import model_of
from deltaopt.verify.clearance import distance_from

_SLOW = 4.0
"""Seconds for each straight piece."""
_TRIES = 30
"""Ways of each leg that are tried."""
_SOON = np.geomspace(0.02, 1.0, 8)
"""Durations of stops and run-ups that are tried, s."""
_MEETINGS, _FAR = np.geomspace(0.3, 30.0, 8), 5.0
"""Times at which a belt may be met, s, and how far it may be then, m."""
_ALONE = dict.fromkeys(("via", "approach", "rotation"))


def crude_motion(scene: Scene, rng: Generator) -> Trajectory | None:
    """A motion that verification finds right; None where none is found."""
    start, goal = scene.given_points[0], scene.given_points[-1]
    places = *(point.position for point in scene.task.via), *_above(scene)
    for meeting, end in _goals(scene):
        for first, last in product(_ended(scene, scene.start, 1), _ended(scene, end, -1)):
            begin = start if first is None else first.at(first.knots[-1:])[0]
            stop = goal if last is None else last.at(last.knots[:1])[0]
            pairs = pairwise(np.array([begin, *places, stop]))
            found = [_leg(scene, one, other, rng) for one, other in pairs]
            legs = [leg for leg in found if leg]
            if len(legs) < len(found):
                break
            between = reduce(PiecewisePolynomial.then, legs)
            ends = sum(float(each.knots[-1]) for each in (first, last) if each)
            left = meeting - ends if meeting else float(between.knots[-1])
            if left <= 0:
                continue
            slowed = between.slowed(left / float(between.knots[-1]))
            parts = [each for each in (first, slowed, last) if each]
            whole = reduce(PiecewisePolynomial.then, parts)
            motion = Trajectory(whole, model_of(scene.robot, scene.payload))
            if deltaopt.verify(scene, motion).ok:
                return motion
    return None


def _above(scene: Scene) -> list[tuple[float, float, float]]:
    return [(column.level, column.y, column.z) for column in scene.columns]


def _goals(scene: Scene) -> Iterator[tuple[float, object]]:
    """When a goal is met, s, and what it is then; 0 where any time will do."""
    if not isinstance(scene.goal, Belt):
        yield 0.0, scene.goal
        return
    for meeting in _MEETINGS.tolist():
        at = np.array(scene.goal.at) + meeting * np.array(scene.goal.belt)
        if np.abs(at).max() < _FAR:
            yield meeting, State(at=tuple(at.tolist()), velocity=scene.goal.belt)


def _ended(scene: Scene, end: object, way: int) -> Iterator[PiecewisePolynomial | None]:
    """Stops from a state (``way`` 1) or run-ups to one (-1) that are right by themselves; one None
    at rest."""
    if not isinstance(end, State):
        yield None
        return
    for T in _SOON.tolist():
        x, v = np.array([end.at, end.at]), np.array([end.velocity, np.zeros(3)])
        x[1] += way * T / 2 * v[0]
        quintic = PiecewisePolynomial.hermite(
            np.array([0, T]), x[::way], v[::way], np.zeros((2, 3))
        )
        rest = tuple(x[1].tolist())
        ends = {"start": end, "goal": rest} if way > 0 else {"start": rest, "goal": end}
        if _is_right(scene.model_copy(update={**_ALONE, **ends}), quintic):
            yield quintic


def _leg(scene: Scene, one: Array, other: Array, rng: Generator) -> PiecewisePolynomial | None:
    """From rest to rest, at rest at random places between."""
    ends = {"start": tuple(one.tolist()), "goal": tuple(other.tolist())}
    alone, size = scene.model_copy(update={**_ALONE, **ends}), float(np.linalg.norm(other - one))
    for attempt in range(_TRIES if scene.keep_out else 1):
        number = min(attempt, int(rng.integers(1, 3)))
        shares = (1 + np.arange(number)[:, None]) / (1 + number)
        aside = scene.tube / 2 if scene.tube else size * (0.1 + attempt / _TRIES)
        between = one + shares * (other - one) + aside * rng.normal(size=(number, 3))
        x = np.array([one, *between, other])
        knots, rest = np.linspace(0.0, _SLOW * (number + 1), len(x)), np.zeros_like(x)
        found = PiecewisePolynomial.hermite(knots, x, rest, rest)
        if _is_right(alone, found):
            return found
    return None


def _is_right(scene: Scene, position: PiecewisePolynomial) -> bool:
    begin, end = position.knots[[0, -1]]
    places = position.at(np.linspace(begin, end, 200))
    near = (distance_from(body, places)[0].min() for _, body in scene.obstacles)
    if any(distance < scene.least_clearance for distance in near):
        return False  # as verification says, in a hundredth of its time
    motion = Trajectory(position, model_of(scene.robot, scene.payload))
    return deltaopt.verify(scene, motion).ok
