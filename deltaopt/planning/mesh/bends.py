"""What a mesh costs a running cost: how far the best torques bend away from its polynomials.

With effort in the cost the best acceleration is smooth, but for kinks where a limit becomes active.
An interval holds a polynomial of a degree d, and the best fit to a smooth function misses it by the
term of degree d + 1. How large that is, the d-th derivatives of neighbouring intervals tell:
between their middles they differ by the next derivative times the distance. The effort being
quadratic in the torques, and least on the mesh, it is higher by the square of the torques that were
missed.
"""

from __future__ import annotations

from math import factorial, sqrt

import numpy as np
from numpy.typing import NDArray

from deltaopt.motion.trajectory import Trajectory

Array = NDArray[np.float64]


def missed_effort(trajectory: Trajectory) -> Array:
    """The estimated excess of the effort over that of the best motion, in each interval, (N,),
    N²m²s."""
    position, lengths = trajectory.position, np.diff(trajectory.knots)
    degree = position.coefficients.shape[1] - 3  # of the acceleration
    highest = factorial(degree + 2) * position.coefficients[:, -1]  # its d-th derivative, (N, 3)
    next_derivative = (
        np.abs(np.diff(highest, axis=0)) / (0.5 * (lengths[1:] + lengths[:-1]))[:, None]
    )
    beside = np.pad(next_derivative, ((1, 1), (0, 0)))
    largest = np.maximum(beside[1:], beside[:-1])
    n = degree + 1
    missed = largest * lengths[:, None] ** n * (factorial(n) / factorial(2 * n) / sqrt(2 * n + 1))
    middle = trajectory.inside_intervals(np.array([0.5]))
    torques = trajectory.model.inverse_dynamics
    squares = np.zeros(len(lengths))
    for k in range(3):  # linear in the acceleration
        more = middle.a.copy()
        more[:, k] += missed[:, k]
        squares += ((torques(middle.x, middle.v, more) - middle.tau) ** 2).sum(axis=1)
    return squares * lengths
