"""The baseline: a straight line from rest to rest, as fast as it may be without a detour."""

from __future__ import annotations

import numpy as np

from deltaopt.model import DeltaModel
from deltaopt.record import Vector3
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
