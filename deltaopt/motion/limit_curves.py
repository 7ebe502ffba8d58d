"""The limited quantities along a motion in their own units, for tables and charts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.limits.constraints import Constraints
from deltaopt.limits.limit import Limit
from deltaopt.mechanisms.delta.functions import delta_functions
from deltaopt.mechanisms.delta.instant import PlatformInstant
from deltaopt.mechanisms.delta.mechanism import DeltaTerms
from deltaopt.motion.trajectory import Array, Trajectory
from deltaopt.robot.model import delta_model
from deltaopt.scene.scene import Scene, limits_of


@dataclass(frozen=True)
class LimitCurves:
    """The quantity of one limit at N instants of a motion.

    ``values``: (N, items) in the limit's unit, one item for each motor or chain, or a single one.
    ``lower``, ``upper``: the bounds, (items,), infinite where there is none.
    """

    limit: Limit
    values: Array
    lower: Array
    upper: Array

    @property
    def of_bounds(self) -> Array:
        """The values as shares of the nearer bound, (N, items), 1 at the bound. A lower bound of 0
        has no share."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.fmax(self.values / self.upper, self.values / self.lower)


def limit_curves(scene: Scene, trajectory: Trajectory, fractions: Array) -> Iterator[LimitCurves]:
    """The curves of all limits that a motion must keep, at fractions of every interval.

    Margins that only the planner keeps are left out.
    """
    model, limits = delta_model(scene.robot, scene.payload), limits_of(scene)
    function = _measures(model.functions.terms, limits.constraints)
    path = trajectory.path_inside(fractions)
    parameters = np.concatenate([limits.numbers, model.parameters])
    (values,) = function(*path, parameters=parameters)
    lower, upper = limits.bounds
    constraints = limits.constraints
    for limit, rows in zip(constraints.limits, constraints.slices, strict=True):
        if limit.promised:
            yield LimitCurves(limit, values[:, rows], lower[rows], upper[rows])


@lru_cache(maxsize=16)
def _measures(terms: DeltaTerms, constraints: Constraints) -> RowFunction:
    """(x, v, a, numbers of the limits and p) -> the quantities of all limits, compiled."""
    x, v, a = (ca.SX.sym(name, 3) for name in "xva")
    numbers, p = constraints.numbers(), ca.SX.sym("p", len(terms.names))
    motion = PlatformInstant(delta_functions(terms, Explicit()), x, v, a, p)
    inputs = [x, v, a, ca.vertcat(numbers, p)]
    measures = constraints.measures(motion, numbers)
    return RowFunction(ca.Function("measures", inputs, [measures], {"cse": True}))
