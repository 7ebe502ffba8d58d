"""What a motion's torques amount to, and what a scene's objective says of it."""

from __future__ import annotations

import numpy as np

from deltaopt.motion.extrema import enough
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import delta_model
from deltaopt.scene.scene import Scene

_FEWEST = 8
"""Points of Gauss's rule in an interval, where torques of polynomials are smooth."""


def effort(scene: Scene, trajectory: Trajectory) -> float:
    """∫ τᵀτ dt, N²m²s, with the torques that the scene's model gives for the motion.

    Raises Unreachable where the motion has no torques.
    """
    points = enough(len(trajectory.knots) - 1, _FEWEST)
    nodes, weights = np.polynomial.legendre.leggauss(points)
    path = trajectory.path_inside((nodes + 1) / 2)
    torque = delta_model(scene.robot, scene.payload).inverse_dynamics(*path)
    squares = (torque**2).sum(axis=1).reshape(-1, points)
    return float(np.diff(trajectory.knots) / 2 @ (squares @ weights))


def cost(scene: Scene, trajectory: Trajectory) -> float:
    """What the scene's objective measures, in its unit."""
    by_time, by_effort = scene.objective.weights
    total = by_time * trajectory.duration
    return total + by_effort * effort(scene, trajectory) if by_effort else total
