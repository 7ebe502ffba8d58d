"""How fast paths can be driven, roughly: as if the robot's reach were a ball of accelerations."""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import Array


def speeds(paths: Array) -> tuple[Array, Array]:
    """How long the pieces of paths (..., n, 3), m, take, (..., n - 1), and the largest speeds at
    their places, (..., n), from rest to rest, at which the acceleration, forwards and sideways
    each, is at most 1."""
    steps = np.diff(paths, axis=-2)
    lengths = np.linalg.norm(steps, axis=-1)
    turn = np.linalg.norm(np.diff(steps / lengths[..., None], axis=-2), axis=-1)
    curvature = 2 * turn / (lengths[..., 1:] + lengths[..., :-1])
    squares = np.zeros(paths.shape[:-1])
    squares[..., 1:-1] = 1 / np.maximum(curvature, 1e-9)
    gained = np.zeros_like(squares)  # from the start, at the largest acceleration forwards
    gained[..., 1:] = 2 * np.cumsum(lengths, axis=-1)
    squares = np.minimum.accumulate(squares - gained, axis=-1) + gained
    left = np.flip(squares + gained, axis=-1)
    squares = np.flip(np.minimum.accumulate(left, axis=-1), axis=-1) - gained
    squares[..., [0, -1]] = 0.0
    fastest = np.sqrt(np.maximum(squares, 0.0))
    return 2 * lengths / (fastest[..., 1:] + fastest[..., :-1]), fastest
