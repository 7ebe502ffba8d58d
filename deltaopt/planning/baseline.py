"""The baseline: a straight line from rest to rest, as fast as it may be without a detour."""

from __future__ import annotations

from math import isinf

import numpy as np

from deltaopt.errors import Infeasible, Unreachable
from deltaopt.limits import safe_factor
from deltaopt.model import DeltaModel
from deltaopt.record import Vector3
from deltaopt.scene import Scene
from deltaopt.trajectory import PiecewisePolynomial, Trajectory


def straight_line(model: DeltaModel, start: Vector3, goal: Vector3, duration: float) -> Trajectory:
    """10 u³ - 15 u⁴ + 6 u⁵ of the way at u = t / duration: at rest and without acceleration
    at both ends, as in the paper's Fig. 4."""
    begin, way = np.array(start), np.array(goal) - np.array(start)
    along = np.array([0, 0, 0, 10, -15, 6]) / duration ** np.arange(6)
    coefficients = along[:, None] * way
    coefficients[0] += begin
    knots = np.array([0.0, duration])
    return Trajectory(PiecewisePolynomial(knots, coefficients[None]), model)


def baseline(scene: Scene) -> Trajectory:
    """The straight line at the shortest duration that keeps the scene's limits.

    Raises Unreachable where the line leaves the workspace, and Infeasible where gravity alone
    exceeds a torque limit on it: a detour may exist all the same.
    """
    line = straight_line(DeltaModel(scene.robot, scene.payload), scene.start, scene.goal, 1.0)
    try:
        factor = safe_factor(scene, line, at_least=0.0)
    except Unreachable as error:
        raise Unreachable(f"the straight line from start to goal: {error}") from None
    if isinf(factor):
        raise Infeasible(
            "on the straight line from start to goal gravity alone exceeds a torque limit"
        )
    return line.slowed(factor)
