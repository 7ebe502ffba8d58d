"""Seeded scenes of boxes in the way: a wall, a bin, shelves, eight boxes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from deltaopt.robot.robot import Robot
from deltaopt.scene.scene import Scene
from studies.bench.random_scenes import random_scenes
from studies.keep_out.random_bodies import box, is_possible, with_bodies
from studies.keep_out.walls import beside_wall

_RADIUS, _CLEARANCE = 0.02, 0.002
"""Of the tool, and beyond touching, m, in bins, shelves and among eight boxes."""
_SHEET = 0.008
"""Thickness of the sides of bins and shelves, m."""
Bodies = list[dict[str, Any]]


def scene_of(robot: Robot, kind: str, seed: int, number: int) -> Scene:
    """The scene of a kind with a seed and a number."""
    if kind == "wall":
        return beside_wall(robot, kind, seed, number)
    which = _NUMBERS[kind]
    rng = np.random.default_rng([seed, number, which])
    own = 1000 * seed + 100 * which + number
    for move in random_scenes(robot, 1.0, 500, own):
        start, goal = (np.array(point) for point in move.given_points)
        scene = with_bodies(move, _MADE[kind](rng, start, goal), _RADIUS, _CLEARANCE)
        if is_possible(scene):
            return scene
    raise deltaopt.Infeasible(f"{robot.name}: no {kind} fits between start and goal")


def _bin(rng: np.random.Generator, start: Array, goal: Array) -> Bodies:
    """Four sides and a floor about the goal; x is down."""
    half = _RADIUS + rng.uniform(0.02, 0.06, 2)
    above, below = np.array([rng.uniform(0.04, 0.12), *half]), np.array([_RADIUS + 0.01, *half])
    return _sides(goal - above, goal + below, [(0, 1), (1, -1), (1, 1), (2, -1), (2, 1)])


def _shelves(rng: np.random.Generator, start: Array, goal: Array) -> Bodies:
    """A compartment about each end, open towards the other one: bottom, top and back."""
    across, bodies = 1 + int(np.abs(goal - start)[1:].argmax()), Bodies()
    towards = np.sign(goal - start)[across]
    for place, way in ((start, towards), (goal, -towards)):
        half = _RADIUS + rng.uniform([0.01, 0.02, 0.02], [0.04, 0.1, 0.1])
        half[3 - across] = 0.15
        bodies += _sides(place - half, place + half, [(0, -1), (0, 1), (across, -way)])
    return bodies


def _sides(low: Array, high: Array, sides: list[tuple[int, float]]) -> Bodies:
    """Sheets outside of a box at some of its sides: an axis and a direction each."""
    found = Bodies()
    for axis, way in sides:
        a, b = low.copy(), high.copy()
        a[axis], b[axis] = (b[axis], b[axis] + _SHEET) if way > 0 else (a[axis] - _SHEET, a[axis])
        found.append(box(a, b))
    return found


def _eight(rng: np.random.Generator, start: Array, goal: Array) -> Bodies:
    """Boxes about places beside the straight line."""
    way = float(np.linalg.norm(goal - start))
    places = start + rng.uniform(0.15, 0.85, (8, 1)) * (goal - start)
    places += rng.normal(0, 0.12 * way, (8, 3))
    halves = rng.uniform(0.04, 0.2, (8, 3)) * way
    return [box(a, b) for a, b in zip(places - halves, places + halves, strict=True)]


_MADE: dict[str, Callable[[np.random.Generator, Array, Array], Bodies]] = {
    "bin": _bin,
    "shelves": _shelves,
    "eight boxes": _eight,
}
KINDS = ("wall", *_MADE)
_NUMBERS = {kind: 3 + i for i, kind in enumerate(_MADE)}
"""By which scenes of a kind differ from those of others with the same seed and number."""
