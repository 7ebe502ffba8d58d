"""Paths of straight lines, rounded as widely as bodies allow, and timed by TOPP-RA."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import isinf

import numpy as np

from deltaopt.curves.piecewise import Array, PiecewisePolynomial
from deltaopt.errors import RULED_OUT
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.motion.trajectory import Trajectory
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import model_of
from deltaopt.scene.scene import Scene
from studies.bench.fixed_paths import Path, toppra_speeds
from studies.ompl.geometric import Clear

_SHRUNK, _LEAST = 0.85, 1e-4
"""By how much the rounding of a corner shrinks until it is clear, down to so many m."""
_STEP, _EACH = 1.5e-3, 16
"""Longest step of TOPP-RA's grid, m, and the least number of steps in a line or a rounding."""
_ROUNDING = 1e-9
"""By which a motion is slowed more than it has to be."""


@dataclass(frozen=True)
class Rounded:
    """Lines through ``corners``, (n, 3), m, with continuous curvature: each corner is rounded from
    one of ``halves``, (n - 2,), m, before it to as much behind it."""

    corners: Array
    halves: Array

    def __call__(self, s: Array) -> tuple[Array, Array, Array]:
        """Places and their first two derivatives at lengths s, m, along the lines, (N, 3) each."""
        legs = np.diff(self.corners, axis=0)
        lengths = np.linalg.norm(legs, axis=1)
        ways = legs / lengths[:, None]
        z = (s[:, None] - np.cumsum(lengths)[:-1]) / self.halves
        inner = np.clip(z, -1, 1)
        bend = 3 / 4 * (1 - inner**2)
        slope = 1 / 2 + 3 / 4 * (inner - inner**3 / 3)
        ramp = 3 / 16 + inner / 2 + 3 / 8 * inner**2 - inner**4 / 16 + np.maximum(z - 1, 0)
        turns = np.diff(ways, axis=0)
        return (
            self.corners[0] + s[:, None] * ways[0] + (ramp * self.halves) @ turns,
            ways[0] + slope @ turns,
            (bend / self.halves) @ turns,
        )

    @property
    def grid(self) -> Array:
        """Lengths along the lines that are close enough for TOPP-RA, (N,), m."""
        lengths = np.linalg.norm(np.diff(self.corners, axis=0), axis=1)
        at = np.cumsum(lengths)
        knots = np.sort(np.concatenate([[0, at[-1]], at[:-1] - self.halves, at[:-1] + self.halves]))
        pieces = [
            np.linspace(a, b, max(_EACH, int((b - a) / _STEP)), endpoint=False)
            for a, b in pairwise(knots)
            if b - a > _LEAST / 10
        ]
        return np.append(np.concatenate(pieces), knots[-1])


def rounded(clear: Clear, corners: Array) -> Rounded:
    """With each corner rounded as widely as bodies and its legs allow: up to their middles, or up
    to the ends of the path."""
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    room = lengths / 2
    room[[0, -1]] = lengths[[0, -1]]
    halves = np.minimum(room[:-1], room[1:]) * (1 - _ROUNDING)
    for i, before in enumerate(lengths[:-1]):
        while halves[i] > _LEAST:
            alone = Rounded(corners[i : i + 3], halves[i : i + 1])
            if clear(alone(before + np.linspace(-halves[i], halves[i], 101))[0]):
                break
            halves[i] *= _SHRUNK
    return Rounded(corners, halves)


def timed_motion(scene: Scene, path: Rounded) -> Trajectory | None:
    """TOPP-RA's motion along a path, slowed until it keeps its limits between the places of the
    grid too; None if there is none."""
    s = path.grid
    x, dx, ddx = path(s)
    speeds = toppra_speeds(scene, Path(s, (x, dx, ddx), ddx))
    if speeds is None or not (speeds[1:] + speeds[:-1] > 0).all():  # it rests, or is not a number
        return None
    t = np.append(0.0, np.cumsum(2 * np.diff(s) / (speeds[1:] + speeds[:-1])))
    position = PiecewisePolynomial.hermite(t, x, dx * speeds[:, None])
    motion = Trajectory(position, model_of(scene.robot, scene.payload))
    alone = scene.model_copy(update={"keep_out": None, "clearance": None})
    try:
        factor = safe_factor(problem_of(alone), motion)
    except RULED_OUT:
        return None
    return None if isinf(factor) else motion.slowed(factor * (1 + _ROUNDING))
