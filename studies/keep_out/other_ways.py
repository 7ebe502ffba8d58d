"""Whether another motion past bodies is faster than the plan: the best of many first motions.

Random moves past a wall, into a bin, through a slot, from shelf to shelf, through a maze of eight
bodies and beside a forearm; every second one begins and ends moving.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from deltaopt.scene.feasibility import check_feasible
from studies.bench.changes import beside_a_forearm, moving, over_a_wall
from studies.bench.random_scenes import random_scenes
from studies.keep_out.random_bodies import bodies_about, box
from studies.timed import attempted

OBSTACLES = ("wall", "bin", "slot", "shelves", "maze", "forearm")
_SPEED = 0.2
"""Largest speed of ends that move, as a share of the usual one of a move."""
_THIN = 0.03
"""Thickness of sides and boards, as a share of the straight line."""
_MAZE = 8
"""Bodies of a maze."""


@dataclass(frozen=True)
class OtherWays:
    """What a search found beside a plan.

    ``number``: of the scene. ``obstacle``: its kind. ``duration``: of the plan, s, and ``fastest``
    of all that was planned, itself among it; NaN where there is none. ``gap``: of the plan.
    ``optima``: distinct motions that were found. ``verified``: whether the fastest is. ``reason``:
    why there is no plan.
    """

    number: int
    obstacle: str
    duration: float
    fastest: float
    gap: float
    optima: int
    verified: bool
    reason: str

    @property
    def gain(self) -> float:
        """By how much the plan takes longer than the fastest, as a share; NaN without a plan."""
        return self.duration / self.fastest - 1


def other_ways(robot: deltaopt.Robot, seed: int, number: int, starts: int) -> OtherWays:
    """Plan a scene as usual, and from so many first motions."""
    scene = past_obstacle(robot, seed, number)
    plan, reason, _ = attempted(lambda: deltaopt.plan(scene))
    best, _, _ = attempted(lambda: deltaopt.plan(scene, starts=starts))
    return OtherWays(
        number,
        OBSTACLES[number % len(OBSTACLES)] + (", moving" if _moves(number) else ""),
        plan.duration if plan else np.nan,
        best.duration if best else np.nan,
        plan.gap if plan else np.nan,
        len(best.optima) if best else 0,
        best is not None and bool(deltaopt.verify(scene, best.trajectory).ok),
        reason,
    )


def _moves(number: int) -> bool:
    return number // len(OBSTACLES) % 2 == 1


def past_obstacle(robot: deltaopt.Robot, seed: int, number: int) -> deltaopt.Scene:
    """A random move of 1 kg past an obstacle: each kind in turn, at rest and then moving. Its ends
    are possible by themselves."""
    for attempt in count():
        rng = np.random.default_rng((seed, number, attempt))
        (move,) = random_scenes(robot, 1.0, 1, int(rng.integers(2**31)))
        try:
            scene = _beside(move, OBSTACLES[number % len(OBSTACLES)], rng)
            check_feasible(scene)
            if _moves(number):
                scene = moving(_SPEED)(scene, rng)
                check_feasible(scene)
        except deltaopt.DeltaOptError:
            continue
        return scene
    raise AssertionError


def _beside(scene: deltaopt.Scene, obstacle: str, rng: np.random.Generator) -> deltaopt.Scene:
    start, goal = (np.array(point) for point in scene.given_points)
    way = float(np.linalg.norm(goal - start))
    if obstacle == "wall":
        return over_a_wall(scene, rng)
    if obstacle == "forearm":
        return beside_a_forearm(scene, rng)
    if obstacle == "bin":
        bodies = _bin(goal, way, rng)
    elif obstacle == "slot":
        bodies = _slot(start, goal, way, rng)
    elif obstacle == "shelves":
        bodies = [*_shelf(start, way, rng), *_shelf(goal, way, rng)]
    else:
        bodies = bodies_about(scene, _MAZE, rng)
    return scene.model_copy(update={"keep_out": bodies})


def _bin(goal: Array, way: float, rng: np.random.Generator) -> list[dict[str, Any]]:
    """A floor and four sides about the goal, open above; x is down."""
    wide, deep = way * rng.uniform(0.08, 0.25, 2), way * rng.uniform(0.03, 0.25)
    inner = np.array([0.0, *wide])
    floor, top = goal[0] + way * rng.uniform(0.02, 0.1), goal[0] - deep
    low, high = goal - inner, goal + inner
    low[0], high[0] = top, floor + _THIN * way
    sides = [box(np.array([floor, *low[1:]]), high)]
    for axis in (1, 2):
        for edge, sign in ((low, -1.0), (high, 1.0)):
            one, other = low.copy(), high.copy()
            one[axis], other[axis] = sorted((edge[axis], edge[axis] + sign * _THIN * way))
            sides.append(box(one, other))
    return sides


def _slot(start: Array, goal: Array, way: float, rng: np.random.Generator) -> list[dict[str, Any]]:
    """Two boards across the move, one above the other, that leave a slot between them."""
    place = start + rng.uniform(0.3, 0.7) * (goal - start)
    place[0] += way * rng.normal(0, 0.12)
    across = 1 + int(np.abs(goal - start)[1:].argmax())
    half = np.full(3, way)
    half[across] = way * rng.uniform(0.005, 0.05)
    room = way * rng.uniform(0.06, 0.2) / 2
    low, high = place - half, place + half
    above, below = high.copy(), low.copy()
    above[0], below[0] = place[0] - room, place[0] + room
    return [box(low, above), box(below, high)]


def _shelf(end: Array, way: float, rng: np.random.Generator) -> list[dict[str, Any]]:
    """A board above an end of the move and one below it."""
    half = np.array([0.0, *way * rng.uniform(0.1, 0.3, 2)])
    thin = np.array([_THIN * way, 0.0, 0.0])
    above, below = (np.array([way * rng.uniform(0.03, 0.12), 0.0, 0.0]) for _ in range(2))
    return [
        box(end - above - thin - half, end - above + half),
        box(end + below - half, end + below + thin + half),
    ]
