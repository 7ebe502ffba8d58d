"""The effort of a motion, and the value of a scene's objective."""

from __future__ import annotations

import numpy as np

from deltaopt.curves.nodes import gauss
from deltaopt.motion.extrema import enough
from deltaopt.motion.trajectory import Trajectory
from deltaopt.problem.problem import Problem

_FEWEST = 8
"""Fewest points of Gauss's rule in an interval. Torques are smooth inside an interval, so that few
points integrate them to rounding unless intervals are long."""


def effort(problem: Problem, trajectory: Trajectory) -> float:
    """The effort ∫ τᵀτ dt of a motion, N²m²s, with the torques of the problem's model.

    Raises Unreachable where the motion leaves the workspace.
    """
    points = enough(len(trajectory.knots) - 1, _FEWEST)
    nodes, weights = gauss(points)
    path = trajectory.path_inside(nodes)
    torque = problem.model.inverse_dynamics(*path)
    squares = (torque**2).sum(axis=1).reshape(-1, points)
    return float(np.diff(trajectory.knots) @ (squares @ weights))


def cost(problem: Problem, trajectory: Trajectory) -> float:
    """The value of a problem's objective for a motion, in the objective's unit."""
    least = problem.objective
    total = least.time * trajectory.duration
    return total + least.effort * effort(problem, trajectory) if least.effort else total
