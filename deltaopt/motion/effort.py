"""The effort of a motion, and the value of a scene's objective."""

from __future__ import annotations

import numpy as np

from deltaopt.curves.nodes import gauss
from deltaopt.motion.extrema import enough
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import delta_model
from deltaopt.scene.scene import Scene

_FEWEST = 8
"""Fewest points of Gauss's rule in an interval. Torques are smooth inside an interval, so that few
points integrate them to rounding unless intervals are long."""


def effort(scene: Scene, trajectory: Trajectory) -> float:
    """The effort ∫ τᵀτ dt of a motion, N²m²s, with the torques of the scene's model.

    Raises Unreachable where the motion leaves the workspace.
    """
    points = enough(len(trajectory.knots) - 1, _FEWEST)
    nodes, weights = gauss(points)
    path = trajectory.path_inside(nodes)
    torque = delta_model(scene.robot, scene.payload).inverse_dynamics(*path)
    squares = (torque**2).sum(axis=1).reshape(-1, points)
    return float(np.diff(trajectory.knots) @ (squares @ weights))


def cost(scene: Scene, trajectory: Trajectory) -> float:
    """The value of a scene's objective for a motion, in the objective's unit."""
    by_time, by_effort = scene.objective.weights
    total = by_time * trajectory.duration
    return total + by_effort * effort(scene, trajectory) if by_effort else total
