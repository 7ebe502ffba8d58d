"""A crude planner: from rest to rest on quintics through random points, as slowly as need be."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.random import Generator

import deltaopt
from deltaopt import Belt, Scene, State, Trajectory
from deltaopt.curves.piecewise import Array, PiecewisePolynomial, quintic_rest
from deltaopt.robot.model import model_of
from tests.oracles.body_distances import tool_distances

_SLOW = (0.5, 4.0)
"""Seconds for a straight leg that are tried."""
_TRIES, _SAMPLES = 30, np.linspace(0.0, 1.0, 60)[:, None]
"""Ways of each leg that are tried, and where along each piece a tool is looked at."""
_SOON = np.geomspace(0.02, 1.0, 8)
"""Durations of stops and run-ups that are tried, s."""
_MEETINGS = np.geomspace(0.3, 20.0, 8)
"""Times at which a belt may be met, s."""
_FAR = 5.0
"""m: no robot of the study reaches so far."""
_ALONE = dict.fromkeys(("via", "approach", "rotation"))


def crude_motion(scene: Scene, rng: Generator) -> Trajectory | None:
    """A motion that verification finds right; None where none is found."""
    for found in _motions(scene, rng):
        motion = Trajectory(found, model_of(scene.robot, scene.payload))
        if deltaopt.verify(scene, motion).ok:
            return motion
    return None


def _motions(scene: Scene, rng: Generator) -> Iterator[PiecewisePolynomial]:
    start, goal = scene.given_points[0], scene.given_points[-1]
    columns = [(each.level, each.y, each.z) for each in scene.columns]
    between = [np.array(each) for each in (*(p.position for p in scene.task.via), *columns)]
    for first in _ended(scene, scene.start, forward=True):
        for meeting in _MEETINGS if isinstance(scene.goal, Belt) else (0.0,):
            end = scene.goal
            if isinstance(end, Belt):
                at = np.array(end.at) + meeting * np.array(end.belt)
                if np.abs(at).max() > _FAR:
                    continue
                end = State(at=tuple(at.tolist()), velocity=end.belt)
            for last in _ended(scene, end, forward=False):
                begin = np.array(start) if first is None else first.at(first.knots[-1:])[0]
                stop = np.array(goal) if last is None else last.at(last.knots[:1])[0]
                for slow in _SLOW:
                    legs = _legs(scene, [begin, *between, stop], slow, rng)
                    if legs is None:
                        continue
                    parts = [each for each in (first, legs, last) if each is not None]
                    if meeting:  # whatever is left is the time of the legs
                        ends = sum(each.knots[-1] for each in (first, last) if each is not None)
                        if meeting - ends < legs.knots[-1]:
                            continue
                        slower = legs.slowed((meeting - ends) / legs.knots[-1])
                        parts = [slower if each is legs else each for each in parts]
                    whole = parts[0]
                    for part in parts[1:]:
                        whole = whole.then(part)
                    yield whole
                    break


def _ended(scene: Scene, end: object, *, forward: bool) -> Iterator[PiecewisePolynomial | None]:
    """Stops from a state, or run-ups to one, that are right by themselves; one None at rest."""
    if not isinstance(end, State):
        yield None
        return
    at, v, model = np.array(end.at), np.array(end.velocity), model_of(scene.robot, scene.payload)
    for T in _SOON:
        other = tuple((at + (0.5 if forward else -0.5) * T * v).tolist())
        ends = {"start": end, "goal": other} if forward else {"start": other, "goal": end}
        begin, change = (at, -T * v) if forward else (np.array(other), T * v)
        speed = T * v if forward else np.zeros(3)
        way = (np.array(other) - at if forward else at - np.array(other)) - speed
        piece = np.stack([begin, speed, np.zeros(3), *quintic_rest(way, change)])
        piece /= np.vander([T], 6, increasing=True).T
        found = PiecewisePolynomial(np.array([0.0, T]), piece[None])
        alone = scene.model_copy(update={**_ALONE, **ends})
        if deltaopt.verify(alone, Trajectory(found, model)).ok:
            yield found


def _legs(
    scene: Scene, points: list[Array], slow: float, rng: Generator
) -> PiecewisePolynomial | None:
    """From rest to rest through all points, each leg right by itself."""
    whole: PiecewisePolynomial | None = None
    for one, other in pairwise(points):
        leg = _leg(scene, one, other, slow, rng)
        if leg is None:
            return None
        whole = leg if whole is None else whole.then(leg)
    return whole


def _leg(
    scene: Scene, one: Array, other: Array, slow: float, rng: Generator
) -> PiecewisePolynomial | None:
    ends = {"start": tuple(one.tolist()), "goal": tuple(other.tolist())}
    alone = scene.model_copy(update={**_ALONE, **ends})
    shapes = scene.robot.tool is not None and scene.robot.tool.shapes is not None
    size = float(np.linalg.norm(other - one))
    for attempt in range(_TRIES if scene.keep_out else 1):
        number = min(attempt, int(rng.integers(1, 3)))
        shares = (1 + np.arange(number)[:, None]) / (1 + number)
        aside = scene.tube / 2 if scene.tube else size * (0.1 + attempt / _TRIES)
        between = one + shares * (other - one) + aside * rng.normal(size=(number, 3))
        places = np.array([one, *between, other])
        if scene.keep_out and not shapes:
            tool = np.vstack([a + _SAMPLES * (b - a) for a, b in pairwise(places)])
            if tool_distances(scene, tool).min() < scene.least_clearance:
                continue
        knots, zeros = slow * np.arange(number + 2.0), np.zeros_like(places)
        found = PiecewisePolynomial.hermite(knots, places, zeros, zeros)
        motion = Trajectory(found, model_of(scene.robot, scene.payload))
        if deltaopt.verify(alone, motion).ok:
            return found
    return None
