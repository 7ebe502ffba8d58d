"""By how much a motion exceeds its approach, in each phase by the row that holds there."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial

from deltaopt.curves.bernstein import control_points_of
from deltaopt.curves.piecewise import Array, Truths
from deltaopt.curves.roots import real_roots
from deltaopt.limits.limit import PhasedLimit
from deltaopt.motion.trajectory import Trajectory, boundary_instants
from deltaopt.problem.problem import Problem


def approach_rows(problem: Problem, trajectory: Trajectory, fractions: Array) -> Array:
    """The rows of the approach at fractions of all intervals, each in its own phase, (N, fractions,
    2)."""
    x, _, _ = trajectory.path_inside(fractions)
    places = x.reshape(-1, len(fractions), 3)
    found, (limit, phases) = np.zeros((*places.shape[:2], 2)), _phases(problem, trajectory)
    for numbers, which in phases:
        found[which] = np.stack(limit.along(np.moveaxis(places[which], 2, 0), numbers), axis=-1)
    return found


def approach_excess(problem: Problem, trajectory: Trajectory) -> float:
    """By how much a motion exceeds its approach at the worst instant, as a share of the bound; -1
    without one. Rows are polynomials in an interval: the worst instants are among their extrema.
    They are convex functions of the place, too, and so no more than at its control points: few
    intervals may be the worst."""
    if problem.limits.phased is None or not problem.gates:
        return -1.0
    worst = 0.0
    lengths, coefficients = np.diff(trajectory.knots), trajectory.position.coefficients
    points, (limit, phases) = control_points_of(trajectory.position), _phases(problem, trajectory)
    for numbers, which in phases:
        own = np.flatnonzero(which)
        at_points = np.stack(limit.along(np.moveaxis(points[own], 2, 0), numbers))
        worst = max(worst, float(at_points[:, :, [0, -1]].max(initial=0.0)))
        most = at_points.max(axis=2)
        for row, k in np.argwhere(most > worst)[np.argsort(-most[most > worst])].tolist():
            if most[row, k] > worst:
                place = [Polynomial(c) for c in coefficients[own[k]].T]
                along = limit.along(place, numbers)[row]
                inside = real_roots(along.deriv(), 0.0, lengths[own[k]])
                worst = max(worst, float(along(np.array(inside)).max(initial=0.0)))
    return worst - 1


def _phases(
    problem: Problem, trajectory: Trajectory
) -> tuple[PhasedLimit, list[tuple[Array, Truths]]]:
    """The limit of the approach, and for each phase its numbers and which intervals are in it."""
    limits = problem.limits
    assert limits.phased is not None
    limit = limits.phased.limit
    begins = trajectory.knots[:-1]
    passed = boundary_instants(problem, trajectory)[1:-1]
    in_phases = limits.in_phases(len(passed) + 1)[:, limits.phased.numbers]
    phase = (begins >= passed[:, None]).sum(axis=0)
    return limit, [(numbers, phase == k) for k, numbers in enumerate(in_phases)]
