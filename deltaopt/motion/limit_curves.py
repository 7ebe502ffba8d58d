"""The limited quantities along a motion in their own units, for tables and charts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import Array
from deltaopt.limits.constraints import Constraints
from deltaopt.limits.limit import Limit
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.mechanisms.functions import Functions
from deltaopt.mechanisms.instant import PlatformInstant
from deltaopt.motion.trajectory import Motion, Trajectory
from deltaopt.problem.problem import Problem
from deltaopt.robot.machine import Model

_TINY = 1e-12
"""Least size of a quantity that shares are of, in its unit or as a share of its bound."""


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
    def shares(self) -> Array:
        """The values as signed shares of their bounds, (N, items): 1 at the upper bound, -1 at the
        lower and more beyond them; between two bounds counted from their middle. A single bound of
        0, which has no share, is counted from the value that is farthest from it."""
        lower, upper, values = self.lower, self.upper, self.values
        below = np.isfinite(lower)
        room = np.where(below, values - lower, upper - values)
        of_room = 1 - room / np.maximum(room.max(axis=0), _TINY)
        with np.errstate(divide="ignore", invalid="ignore"):
            between = (values - (lower + upper) / 2) / ((upper - lower) / 2)
            of_bound = np.where(below, lower / np.maximum(values, _TINY * lower), values / upper)
        single = np.where(np.where(below, lower, upper) > 0, of_bound, of_room)
        single = np.where(below, -single, single)
        return np.where(below & np.isfinite(upper), between, single)


def limit_curves(
    problem: Problem, trajectory: Trajectory, fractions: Array
) -> Iterator[LimitCurves]:
    """The curves of all limits that a motion must keep, at fractions of every interval.

    Margins that only the planner keeps are left out.
    """
    constraints, (lower, upper) = problem.limits.constraints, problem.limits.bounds
    path = trajectory.path_inside(fractions, constraints.order)
    values = _measured(problem.model, problem.limits, *path)
    for limit, rows in zip(constraints.limits, constraints.slices, strict=True):
        used = np.isfinite(lower[rows]) | np.isfinite(upper[rows])
        if limit.promised:
            own = values[:, rows][:, used]
            yield LimitCurves(limit, own, lower[rows][used], upper[rows][used])


def curves_over_time(
    problem: Problem, trajectory: Trajectory, samples: int
) -> tuple[Motion, list[LimitCurves]]:
    """A motion, and the curves of its limits, at about so many samples over all intervals."""
    steps = max(2, samples // (len(trajectory.knots) - 1))
    inside = np.linspace(0, 1, steps)  # 0 and 1: both sides of a jump at a knot
    return trajectory.inside_intervals(inside), list(limit_curves(problem, trajectory, inside))


class LimitShares:
    """Every quantity that a scene limits, as a share of its bound: 1 at the bound.

    A bound that a quantity may be on either side of, as one of a range, is 1 too, and the share
    falls by the distance from it over the quantity's natural size. ``of_speed``: which of them
    slowing changes, (columns,): all but those of places.
    """

    def __init__(self, problem: Problem) -> None:
        """Of the limits that a motion must keep, without margins that only the planner keeps, and
        without those of jerk and torque rate: what moves between rows of a table has its own."""
        self.model, self._limits = problem.model, problem.limits.up_to(2)
        of = self._limits.constraints
        self._columns = [  # of each the row and which of its bounds: 0 the lower, 1 the upper
            (row, side)
            for limit, rows in zip(of.limits, of.slices, strict=True)
            for side in (1, 0)
            for row in range(rows.start, rows.stop)
            if limit.promised and of.sides[row, side]
        ]
        self.of_speed = np.array([of.slowing_exponents[row] != 0 for row, _ in self._columns])

    @property
    def named(self) -> list[tuple[str, str]]:
        """Limit and subject of each column, such as ("torque", "motor 2")."""
        return [self._limits.constraints.named(row) for row, _ in self._columns]

    def __call__(self, x: Array, v: Array, a: Array) -> Array:
        """The shares, (N, columns), of a motion of the tool's point, (N, 3) each."""
        limits, (rows, sides) = self._limits, np.array(self._columns).T
        values = _measured(self.model, limits, x, v, a)
        bounds = np.stack(limits.bounds)[sides, rows]
        over = np.where(sides, values[:, rows] - bounds, bounds - values[:, rows])
        return np.asarray(1 + over / limits.scales[rows])


def _measured(model: Model, limits: SceneLimits, *motion: Array) -> Array:
    """The quantities of all limits, (N, rows), from position and derivatives by time, (N, 3)
    each."""
    parameters = np.concatenate([limits.numbers, model.parameters])
    return _measures(model.functions, limits.constraints)(*motion, parameters=parameters)[0]


@lru_cache(maxsize=16)
def _measures(functions: Functions, constraints: Constraints) -> RowFunction:
    """(x, v, a[, j], numbers of the limits and p) -> the quantities of all limits, compiled."""
    symbols = [ca.SX.sym(name, 3) for name in "xvaj"[: constraints.order + 1]]
    (x, v, a, *rest), numbers = symbols, constraints.numbers()
    motion = PlatformInstant(
        functions, x, v, a, functions.symbols(), jerk=rest[0] if rest else None
    )
    inputs = [*symbols, ca.vertcat(numbers, motion.p)]
    return RowFunction.of("measures", inputs, [constraints.measures(motion, numbers)])
