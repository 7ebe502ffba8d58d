"""How far a motion is from the path that its scene gives."""

from __future__ import annotations

import numpy as np

from deltaopt.motion.trajectory import Array, Trajectory
from deltaopt.scene.path import Path
from deltaopt.scene.task import OnPath

_IN_PIECE = 64
"""Places of every piece of the path among which the nearest is looked for first."""
_STEPS = 50
"""Of Newton's method from there: where the path turns back it gains only a digit in three steps."""
_AT_ONCE = 1_000_000
"""Distances that are compared at once, in 8 MB."""
_FRACTIONS = np.linspace(0.0, 1.0, 8)
"""Of every interval, where the motion is looked at."""


def off_path(task: OnPath, trajectory: Trajectory) -> float:
    """The largest distance of the motion from the path of a task, m."""
    x, _, _ = trajectory.path_inside(_FRACTIONS)
    return float(_distances(task.path, x).max())


def _distances(path: Path, x: Array) -> Array:
    """Of points (N, 3), m, to the places of the path that are nearest, (N,)."""
    shares = np.arange(_IN_PIECE) / _IN_PIECE
    lengths = np.diff(path.knots)[:, None]
    looked = np.append((path.knots[:-1, None] + lengths * shares).ravel(), path.knots[-1])
    places = path(looked)
    squares = (places**2).sum(axis=1)
    parts = np.array_split(x, -(-len(x) * len(places) // _AT_ONCE))
    nearest = np.concatenate([(squares - 2 * part @ places.T).argmin(axis=1) for part in parts])
    best = np.full(len(x), np.inf)
    for beside in (-1, 1):  # Newton's method goes nowhere from where the path turns back
        s = looked[np.clip(nearest + beside, 0, len(looked) - 1)]
        best = np.minimum(best, _closest(path, x, s))
    return best


def _closest(path: Path, x: Array, s: Array) -> Array:
    """The least distances from points (N, 3) that Newton's method finds from places s (N,)."""
    best, s = np.full(len(x), np.inf), s.copy()
    moving = np.arange(len(x))
    for _ in range(_STEPS):
        if not len(moving):
            break
        p, dp, ddp = (path(s[moving], order) for order in range(3))
        away, square = p - x[moving], (dp**2).sum(axis=1)
        best[moving] = np.minimum(best[moving], np.linalg.norm(away, axis=1))
        bend = square + np.maximum((away * ddp).sum(axis=1), -square / 2)
        step = (away * dp).sum(axis=1) / np.where(bend > 0, bend, np.inf)
        before = s[moving]
        s[moving] = np.clip(before - step, path.knots[0], path.knots[-1])
        moving = moving[s[moving] != before]
    return best
