"""How far places are inside of a tube, by straight lines along its axis: no first motion needs to
know it more exactly."""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import Array, away_from_lines

_LINES = 8
"""For each piece of the axis: beside a rounding of 90 degrees they miss 0.5 % of its radius."""
_ON_AXIS = 1e-12
"""m from the axis: nearer it is not known in which direction the wall is nearest."""


def along_axis(axis: Array) -> Array:
    """Ends of the straight lines along each piece of an axis, (pieces, lines + 1, 3), m, which is
    given by polynomials over shares from 0 to 1 of its pieces, (pieces, powers, 3), m."""
    powers = np.linspace(0.0, 1.0, _LINES + 1)[:, None] ** np.arange(axis.shape[1])
    return np.asarray(powers @ axis)


def room_in_tube(axis: Array, radius: float, x: Array) -> tuple[Array, Array]:
    """How far places (N, 3), m, are from the wall of a tube, (N,), negative outside, and the
    derivatives by the place, (N, 3). ``axis``: as of ``along_axis``."""
    corners = along_axis(axis)
    lines = np.diff(corners, axis=1).reshape(-1, 3)
    away = away_from_lines(corners[:, :-1].reshape(-1, 3), lines, x)
    squares, which = (away**2).sum(axis=2), np.arange(len(x))
    nearest = squares.argmin(axis=1)
    away, apart = away[which, nearest], np.sqrt(squares[which, nearest])
    return radius - apart, -away / np.maximum(apart, _ON_AXIS)[:, None]
