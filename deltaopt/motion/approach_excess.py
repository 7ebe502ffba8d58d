"""By how much a motion exceeds its approach, in each phase by the row that holds there."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from deltaopt.curves.piecewise import Array
from deltaopt.curves.roots import real_roots
from deltaopt.motion.trajectory import Trajectory, passes
from deltaopt.problem.problem import Problem


def approach_rows(problem: Problem, trajectory: Trajectory, fractions: Array) -> Array:
    """The rows of the approach at fractions of all intervals, each in its own phase, (N, fractions,
    2)."""
    return np.array(
        [
            np.stack([row(length * fractions) for row in rows], axis=-1)
            for length, rows in _rows(problem, trajectory)
        ]
    )


def approach_excess(problem: Problem, trajectory: Trajectory) -> float:
    """By how much a motion exceeds its approach at the worst instant, as a share of the bound; -1
    without one. Rows are polynomials in an interval: the worst instants are among their extrema."""
    if problem.limits.phased is None or not problem.gates:
        return -1.0
    worst = 0.0
    for length, rows in _rows(problem, trajectory):
        for row in rows:
            inside = real_roots(row.deriv(), 0.0, length)
            worst = max(worst, float(row(np.array([0.0, length, *inside])).max()))
    return worst - 1


def _rows(problem: Problem, trajectory: Trajectory) -> list[tuple[float, tuple[Polynomial, ...]]]:
    """The length of each interval, s, and both rows as polynomials of the time since it began."""
    limits = problem.limits
    assert limits.phased is not None
    limit = limits.phased.limit
    in_phases = limit.numbers_in_phases(limits.numbers[limits.phased.numbers])
    up, down = passes(problem, trajectory)
    found = []
    for begin, length, coefficients in zip(
        trajectory.knots[:-1].tolist(),
        np.diff(trajectory.knots).tolist(),
        trajectory.position.coefficients,
        strict=True,
    ):
        numbers = in_phases[int(begin >= up) + int(begin >= down)]
        found.append((length, limit.along([Polynomial(c) for c in coefficients.T], numbers)))
    return found
