"""Random scenes with keep-out bodies of all kinds, and walls with planted passages.

A scene is known by a seed and a number.
"""

from __future__ import annotations

from collections.abc import Callable
from math import log
from typing import Any

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from deltaopt.scene.feasibility import check_feasible
from studies.bench.random_scenes import random_scenes
from tests.oracles.body_distances import tool_distances

_MOST = 1_000_000
"""Scenes of one seed that are different from those of the next."""
_SIZES = (0.02, 0.4)
"""Least and largest half size of a body, as shares of the way from start to goal; small ones are as
frequent as large ones, by the logarithm."""
_ASIDE = 0.12
"""How far bodies are from the straight line, as a standard deviation, of the same way."""
_RADII, _CLEARANCES = (None, 0.01, 0.03), (None, None, 0.002)
"""Of the tool, and asked for, m: a third of the scenes each."""
_WITH_HULLS = 5
"""How many bodies scenes have of which one may be a hull."""
_POINTS = (5, 10)
"""Least and largest number of points of a hull."""
_TRIES = 100
"""Random arrangements of bodies, before that of a scene is given up."""


def scene_of(robot: deltaopt.Robot, seed: int, number: int) -> deltaopt.Scene:
    """A random move of 1 kg with one to five bodies about the straight line, of which its start and
    goal are clear: 1 + number % 5. Where there are five, one may be a hull: how many there are of
    both families is compiled by itself, which takes minutes with hulls."""
    own = _MOST * seed + number
    rng = np.random.default_rng([own, 1])
    for move in random_scenes(robot, 1.0, _TRIES, own):
        radius, clearance = (rng.choice(np.array(each)) for each in (_RADII, _CLEARANCES))
        kinds = rng.integers(len(BODIES), size=1 + number % 5)
        hulls = np.flatnonzero(kinds == _HULL)[len(kinds) == _WITH_HULLS :]
        kinds[hulls] = rng.integers(_HULL, size=len(hulls))
        bodies = [BODIES[kind](rng, *_place(rng, move)) for kind in kinds]
        scene = with_bodies(move, bodies, radius, clearance)
        if is_possible(scene):
            return scene
    raise deltaopt.Infeasible(f"{robot.name}: no start and goal are clear of random bodies")


def is_possible(scene: deltaopt.Scene) -> bool:
    """Whether the platform can be at rest at start and goal, which are clear of all bodies."""
    ends = tool_distances(scene, np.array(scene.given_points))
    if (ends < scene.least_clearance).any():  # sooner known than by the scene's own check
        return False
    try:
        check_feasible(scene)
    except deltaopt.DeltaOptError:
        return False
    return True


def with_bodies(
    move: deltaopt.Scene,
    bodies: list[dict[str, Any]],
    radius: float | None,
    clearance: float | None = None,
) -> deltaopt.Scene:
    """A move with bodies and a spherical tool of a radius, m."""
    robot = move.robot.model_copy(update={"tool": {"radius": radius} if radius else None})
    return move.model_copy(update={"robot": robot, "keep_out": bodies, "clearance": clearance})


def bodies_about(
    move: deltaopt.Scene, number: int, rng: np.random.Generator
) -> list[dict[str, Any]]:
    """So many spheres, boxes and cylinders about the straight line of a move."""
    kinds = rng.integers(_ROUNDED, size=number)
    return [BODIES[kind](rng, *_place(rng, move)) for kind in kinds]


def _place(rng: np.random.Generator, move: deltaopt.Scene) -> tuple[Array, float]:
    """A place beside the straight line of a move, and its length, m."""
    start, goal = (np.array(point) for point in move.given_points)
    way = float(np.linalg.norm(goal - start))
    aside = rng.normal(0, _ASIDE * way, 3)
    return start + rng.uniform(0.15, 0.85) * (goal - start) + aside, way


def _sizes(rng: np.random.Generator, way: float, number: int) -> Array:
    return np.asarray(way * np.exp(rng.uniform(log(_SIZES[0]), log(_SIZES[1]), size=number)))


def _sphere(rng: np.random.Generator, place: Array, way: float) -> dict[str, Any]:
    return {"sphere": {"centre": place.tolist(), "radius": float(_sizes(rng, way, 1)[0])}}


def _box(rng: np.random.Generator, place: Array, way: float) -> dict[str, Any]:
    half = _sizes(rng, way, 3)
    return box(place - half, place + half)


def _cylinder(rng: np.random.Generator, place: Array, way: float) -> dict[str, Any]:
    radius, half = _sizes(rng, way, 2).tolist()
    along = half * _direction(rng)
    ends = {"from": (place - along).tolist(), "to": (place + along).tolist()}
    return {"cylinder": ends | {"radius": radius}}


def _half_space(rng: np.random.Generator, place: Array, way: float) -> dict[str, Any]:
    """Its plane is beside the line: with start and goal it leaves all of that clear."""
    return {"half_space": {"point": place.tolist(), "normal": _direction(rng).tolist()}}


def _hull(rng: np.random.Generator, place: Array, way: float) -> dict[str, Any]:
    """Of points in a random ellipsoid."""
    number = int(rng.integers(_POINTS[0], _POINTS[1] + 1))
    points = rng.normal(size=(number, 3))
    points *= _sizes(rng, way, 3) / np.linalg.norm(points, axis=1, keepdims=True)
    return {"hull": {"points": (place + points).tolist()}}


def _direction(rng: np.random.Generator) -> Array:
    found = rng.normal(size=3)
    return np.asarray(found / np.linalg.norm(found))


BODIES: tuple[Callable[[np.random.Generator, Array, float], dict[str, Any]], ...] = (
    _sphere,
    _box,
    _cylinder,
    _half_space,
    _hull,
)
"""Makers of a body of each kind about a place, m, near a line of a length, m."""
_HULL, _ROUNDED = len(BODIES) - 1, 3


def box(low: Array, high: Array) -> dict[str, Any]:
    """A box by two corners, m."""
    return {"box": {"from": low.tolist(), "to": high.tolist()}}
