"""What a motion's torques amount to, and what a scene's objective says of it."""

from __future__ import annotations

import numpy as np

from deltaopt.model import delta_model
from deltaopt.scene import Scene
from deltaopt.trajectory import Trajectory

_POINTS = 24
"""Of Gauss's rule in every interval: torques of polynomials are smooth there."""


def effort(scene: Scene, trajectory: Trajectory) -> float:
    """∫ τᵀτ dt, N²m²s, with the torques that the scene's model gives for the motion.

    Raises Unreachable where the motion has no torques.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    motion = trajectory.inside_intervals((nodes + 1) / 2)
    torque = delta_model(scene.robot, scene.payload).inverse_dynamics(motion.x, motion.v, motion.a)
    squares = (torque**2).sum(axis=1).reshape(-1, _POINTS)
    return float(np.diff(trajectory.knots) / 2 @ (squares @ weights))


def cost(scene: Scene, trajectory: Trajectory) -> float:
    """What the scene's objective measures, in its unit."""
    by_time, by_effort = scene.objective.weights
    total = by_time * trajectory.duration
    return total + by_effort * effort(scene, trajectory) if by_effort else total
