"""Whether a trajectory is a function of time at all, before anything of it is evaluated."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.machine import Model

SHORTEST, LONGEST = 1e-50, 1e50
"""Durations, s, whose powers are numbers too."""


def malformed(trajectory: Trajectory) -> str | None:
    """Why a trajectory is no function of time, in a sentence; None if it is one."""
    if not isinstance(trajectory.model, Model):
        return f"its model is a {_kind(trajectory.model)}; a Model is needed"
    components = {"position": 3, "coordinates": len(trajectory.model.functions.lengths)}
    parts = {name: getattr(trajectory, name) for name in components}
    if parts["coordinates"] is None:
        del parts["coordinates"]
    for name, polynomials in parts.items():
        if not isinstance(polynomials, PiecewisePolynomial):
            return f"its {name} is a {_kind(polynomials)}; a PiecewisePolynomial is needed"
        for what, dimensions in (("knots", 1), ("coefficients", 3)):
            array = getattr(polynomials, what)
            if type(array) is not np.ndarray or array.dtype != np.float64:
                return f"{what} of its {name} are a {_kind(array)}; an array of doubles is needed"
            if array.ndim != dimensions:
                return f"{what} of its {name} have {array.ndim} dimensions, not {dimensions}"
        number, shape = len(polynomials.knots), polynomials.coefficients.shape
        if number < 2 or shape[0] != number - 1 or shape[1] < 1 or shape[2] != components[name]:
            return f"polynomials of shape {shape} where there are {number} knots"
        if not np.array_equal(polynomials.knots, trajectory.position.knots):
            return "its coordinates have other knots than its position"
    velocities = trajectory.end_velocities
    if not (isinstance(velocities, tuple) and [_finite(each) for each in velocities] == [3, 3]):
        return f"its end_velocities are {velocities!r:.80}; two velocities in m/s are needed"
    knots = trajectory.knots
    if not (np.isfinite(knots).all() and (np.diff(knots) > 0).all()):
        return "time does not increase from knot to knot"
    if not SHORTEST <= trajectory.duration <= LONGEST:
        return f"it takes {trajectory.duration:.3g} s, not between {SHORTEST:g} s and {LONGEST:g} s"
    return None


def _finite(velocity: Any) -> int:
    """How many finite numbers a tuple has; 0 of anything else."""
    if not isinstance(velocity, tuple):
        return 0
    return sum(isinstance(each, float | int) and isfinite(each) for each in velocity)


def _kind(value: Any) -> str:
    """What a value is, in words: "list", "array of complex128"."""
    if isinstance(value, np.ndarray):
        own = "array" if type(value) is np.ndarray else type(value).__name__
        return f"{own} of {value.dtype}"
    return type(value).__name__
