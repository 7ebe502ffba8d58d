"""What a mesh costs a running cost: how far the best torques bend away from its polynomials.

With effort in the cost the best acceleration is smooth, but for kinks where a limit becomes active,
and with torque rates or jerk the best jerk. Of it an interval holds a polynomial of a degree d, and
the best fit to a smooth function misses it by the term of degree d + 1. How large that is, the d-th
derivatives of neighbouring intervals tell: between their middles they differ by the next derivative
times the distance. The cost being quadratic in the torques, their rates or the jerk, and least on
the mesh, it is higher by the square of what was missed.

Where torques may not jump, the trapezoidal rule integrates their cost (``interval_points``). To the
integral of a² it adds that of (h a')² / 6, so that the best torques on the mesh miss those without
it by h² a'' / 6. Such torques begin and end with those that hold the robot. The best ones leave
these at once, or as fast as a limit allows: what an end's interval bends by is missed in all of it,
as by a straight line that falls to zero from there.
"""

from __future__ import annotations

from math import factorial, sqrt

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.limits.running_cost import CostFunctional, Running
from deltaopt.motion.trajectory import Trajectory

_CONTINUOUS, _END = 1 / 6, 1 / sqrt(3)
"""What torques that may not jump miss, as a share of how far they bend within an interval; in the
first and the last the root of the mean square of a straight line that falls from 1 to 0."""


def missed_cost(trajectory: Trajectory, objective: CostFunctional, jumping: int) -> Array:
    """The estimated excess of the integral in an objective over that of the best motion, in each
    interval, (N,), in the unit of the integral. ``jumping``: which derivative of the position may
    jump at knots."""
    rate = objective.rate
    position, lengths = trajectory.position, np.diff(trajectory.knots)
    degree = position.coefficients.shape[1] - 1 - rate.order
    highest = factorial(degree + rate.order) * position.coefficients[:, -1]  # derivative, (N, 3)
    next_derivative = (
        np.abs(np.diff(highest, axis=0)) / (0.5 * (lengths[1:] + lengths[:-1]))[:, None]
    )
    beside = np.pad(next_derivative, ((1, 1), (0, 0)))
    largest = np.maximum(beside[1:], beside[:-1])
    n = degree + 1
    share = np.full(len(lengths), factorial(n) / factorial(2 * n) / sqrt(2 * n + 1))
    if jumping > rate.order:
        share[:], share[[0, -1]] = _CONTINUOUS, _END
    missed = largest * (share * lengths**n)[:, None]
    if rate is Running.JERK:
        return np.asarray((missed**2).sum(axis=1) * lengths)
    middle = trajectory.inside_intervals(np.array([0.5]))
    torques = trajectory.model.inverse_dynamics
    squares = np.zeros(len(lengths))
    for k in range(3):  # linear in the acceleration, and so their rates in the jerk
        more = middle.a.copy()
        more[:, k] += missed[:, k]
        squares += (torques(middle.x, middle.v, more) - middle.tau) ** 2 @ objective.motors
    return squares * lengths


def hidden_cost(
    trajectory: Trajectory, hidden: Array, at: Array, objective: CostFunctional
) -> Array:
    """How much the integral of torques squared changes in each interval, (N,), N²m²s, where a mesh
    sees torques smaller by ``hidden``, (N · fractions, motors), N·m, at fractions ``at``."""
    tau, lengths = trajectory.inside_intervals(at).tau, np.diff(trajectory.knots)
    change = ((tau**2 - (tau - hidden) ** 2) @ objective.motors).reshape(len(lengths), -1)
    return np.asarray(np.abs(np.trapezoid(change, at, axis=1)) * lengths)
