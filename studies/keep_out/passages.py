"""Walls that leave no way from start to goal but a planted passage, and walls that leave none."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

import deltaopt
from deltaopt.curves.piecewise import Array
from studies.bench.random_scenes import random_scenes
from studies.keep_out.random_bodies import is_possible, with_bodies
from tests.oracles.clear_grid import can_be_held

KINDS = ("slot", "window", "two slots", "turned slot")
"""A slot between two boxes, upright or level; a hole between four; two walls behind one another
with a slot each; a slot between two hulls, in any direction."""
WIDTHS = (0.001, 0.003, 0.02)
"""What a passage leaves beside the tool, m."""
CLOSED = -0.001
"""The same of a passage that is none."""
_MOST = 1_000_000
"""Walls of one seed that are different from those of the next."""
_FAR = (2.0, 4.0)
"""Of a wall from its passage, m, to each side: beyond the reach of robots, and not symmetric."""
_THICK = (0.005, 0.06)
"""Thinnest and thickest wall, m."""
_RADII = (None, 0.01, 0.03)
"""Of the tool, m."""
_ALONG, _ASIDE = (0.35, 0.65), 0.15
"""Where walls are, as shares of the line from start to goal, and how far their passages are from
it, as a standard deviation, in lengths of the line."""
_CROSSES = 0.6
"""Least cosine of the angle between the line and the normal of a wall."""
_LONGEST = 0.1
"""m, before and behind a wall, where the platform can be held."""
_TRIES = 2000
"""Random arrangements, before that of a number is given up."""


@dataclass(frozen=True)
class Planted:
    """A scene with a passage, and places ``on_the_way`` through it, (n, 3), m."""

    scene: deltaopt.Scene
    on_the_way: Array


def planted(robot: deltaopt.Robot, kind: str, width: float, seed: int, number: int) -> Planted:
    """A random move of 1 kg with a wall of a kind across, whose passage leaves so much beside the
    tool, m."""
    own = _MOST * seed + number
    rng = np.random.default_rng([own, KINDS.index(kind)])
    for move in random_scenes(robot, 1.0, _TRIES, own):
        radius = rng.choice(np.array(_RADII))
        opening = 2 * (radius or 0.0) + width
        start, goal = (np.array(point) for point in move.given_points)
        axes = _axes(rng, goal - start, turned=kind == "turned slot")
        if axes is None:
            continue
        shares = np.sort(rng.uniform(*_ALONG, 2)) if kind == "two slots" else [rng.uniform(*_ALONG)]
        walls = [_wall(rng, start + share * (goal - start), goal - start, axes) for share in shares]
        bodies = [body for wall in walls for body in wall.bodies(opening, kind)]
        scene = with_bodies(move, bodies, radius)
        on_the_way = np.vstack([wall.through(radius or 0.0) for wall in walls])
        apart = len(walls) == 1 or walls[1].begins - walls[0].ends > 2 * opening
        if apart and can_be_held(move)(on_the_way).all() and is_possible(scene):
            return Planted(scene, on_the_way)
    raise deltaopt.Infeasible(f"{robot.name}: no {kind} fits between start and goal")


@dataclass(frozen=True)
class _Wall:
    """A wall about a place in its passage, m, of some thickness, m; ``axes``: across the wall,
    across its passage, and along that. ``far``: how far it goes to its four sides, m."""

    place: Array
    thick: float
    axes: Array
    far: tuple[float, ...]

    @property
    def begins(self) -> float:
        """Where it begins and ends along its normal, m."""
        return float(self.place @ self.axes[0]) - self.thick / 2

    @property
    def ends(self) -> float:
        return self.begins + self.thick

    def bodies(self, opening: float, kind: str) -> list[dict[str, Any]]:
        """Two bodies beside an opening, m, and two more above and below that of a window."""
        half, deep = opening / 2, self.thick / 2
        across = [(half, self.far[0]), (-self.far[1], -half)]
        parts = [((-deep, deep), side, (-self.far[2], self.far[3])) for side in across]
        if kind == "window":
            parts += [((-deep, deep), (-half, half), side) for side in across]
        return [self._body(part, is_hull=kind == "turned slot") for part in parts]

    def _body(self, part: tuple[tuple[float, float], ...], *, is_hull: bool) -> dict[str, Any]:
        corners = self.place + np.array(list(product(*part))) @ self.axes
        if is_hull:
            return {"hull": {"points": corners.tolist()}}
        return {"box": {"from": corners.min(axis=0).tolist(), "to": corners.max(axis=0).tolist()}}

    def through(self, radius: float) -> Array:
        """Places on the line through the passage, (n, 3), m."""
        far = self.thick / 2 + radius + _LONGEST
        return np.asarray(self.place + np.linspace(-far, far, 21)[:, None] * self.axes[0])


def _wall(rng: np.random.Generator, place: Array, line: Array, axes: Array) -> _Wall:
    """A wall whose passage is aside of a place on the line, m."""
    aside = rng.normal(0, _ASIDE * np.linalg.norm(line), 2) @ axes[1:]
    thick = float(np.exp(rng.uniform(*np.log(_THICK))))
    return _Wall(place + aside, thick, axes, tuple(rng.uniform(*_FAR, 4).tolist()))


def _axes(rng: np.random.Generator, line: Array, *, turned: bool) -> Array | None:
    """Random axes of a wall that is across the line, those of the base unless it is ``turned``;
    None if it is too little across."""
    if turned:
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    else:
        first = int(np.abs(line).argmax())
        axes = np.eye(3)[[first, *rng.permutation([i for i in range(3) if i != first])]]
    cosine = float(axes[0] @ line) / np.linalg.norm(line)
    if abs(cosine) < _CROSSES:
        return None
    return np.asarray(axes * np.array([[np.sign(cosine)], [1.0], [1.0]]))
