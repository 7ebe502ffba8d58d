"""Integrals over a motion, and the value of a scene's objective."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from deltaopt.curves.nodes import gauss
from deltaopt.curves.piecewise import Array, Index
from deltaopt.limits.running_cost import Running
from deltaopt.motion.extrema import enough
from deltaopt.motion.trajectory import Trajectory
from deltaopt.problem.problem import Problem
from deltaopt.robot.machine import Model

_FEWEST = 8
"""Fewest points of Gauss's rule in an interval. Torques are smooth inside an interval, so that few
points integrate them to rounding unless intervals are long."""
_HALVINGS, _INTEGRATED = 12, 1e-11
"""How often intervals are halved at most, and what halves may differ by, of the integral."""
_STEP = 1e-5
"""Of the duration: of the differences by which torques are differentiated. What they miss is its
square, about as much as what is rounded off."""


def running_cost(problem: Problem, trajectory: Trajectory, rate: Running) -> float:
    """The integral of a rate over a motion, in the rate's unit, with the torques of the problem's
    model.

    Raises Unreachable where the motion leaves the workspace.
    """

    def of(x: Array, v: Array, a: Array, j: Array) -> Array:
        match rate:
            case Running.EFFORT | Running.WEIGHTED_EFFORT:
                return problem.model.inverse_dynamics(x, v, a)
            case Running.JERK:
                return j
            case Running.TORQUE_RATE:
                step = _STEP * trajectory.duration
                return torque_rates(problem.model, (x, v, a, j), step)

    squares = _integral_of_squares(trajectory, of)
    is_weighted = rate is Running.WEIGHTED_EFFORT
    return float(squares @ problem.objective.motors if is_weighted else squares.sum())


@lru_cache(maxsize=256)
def squared_torques(trajectory: Trajectory) -> Array:
    """∫ τ² dt of each motor over a motion, (3,), N²m²s; not to be written into."""
    dynamics = trajectory.model.inverse_dynamics
    found = _integral_of_squares(trajectory, lambda x, v, a, _: dynamics(x, v, a))
    found.flags.writeable = False
    return found


def _integral_of_squares(trajectory: Trajectory, of: Callable[..., Array]) -> Array:
    """The integrals of the squares of what ``of`` makes of position, velocity, acceleration and
    jerk, (3,): with friction, which changes within a small part of an interval where a motor turns
    back, in halves of intervals as far as these tell more."""
    points = enough(len(trajectory.knots) - 1, _FEWEST)
    nodes, weights = gauss(points)

    def inside(intervals: Index, begin: Array, lengths: Array) -> Array:
        since = (begin[:, None] + lengths[:, None] * nodes).ravel()
        where = np.repeat(intervals, points)
        squares = of(*(trajectory.position.inside(where, since, order) for order in range(4))) ** 2
        in_each = np.einsum("kpc,p->kc", squares.reshape(-1, points, 3), weights)
        return np.asarray(lengths[:, None] * in_each)

    lengths = np.diff(trajectory.knots)
    intervals, begin = np.arange(len(lengths)), np.zeros_like(lengths)
    found = inside(intervals, begin, lengths)
    total = found.sum(axis=0)
    for _ in range(_HALVINGS if trajectory.model.layers else 0):
        lengths = np.tile(lengths / 2, 2)
        intervals, begin = np.tile(intervals, 2), np.append(begin, begin + lengths[: len(begin)])
        halves = inside(intervals, begin, lengths)
        more = halves[: len(found)] + halves[len(found) :] - found
        total = total + more.sum(axis=0)
        rough = np.tile((np.abs(more) > _INTEGRATED * total).any(axis=1), 2)
        if not rough.any():
            break
        found, intervals, begin, lengths = (
            each[rough] for each in (halves, intervals, begin, lengths)
        )
    return np.asarray(total)


def torque_rates(model: Model, motion: tuple[Array, Array, Array, Array], step: float) -> Array:
    """dτ/dt, (N, 3), N·m/s, by differences over a ``step`` (s) of smooth motions with this
    position, velocity, acceleration and jerk, (N, 3) each."""
    x, v, a, j = motion
    after, before = (
        model.inverse_dynamics(x + h * (v + h / 2 * a), v + h * (a + h / 2 * j), a + h * j)
        for h in (step, -step)
    )
    return np.asarray((after - before) / (2 * step))


def cost(problem: Problem, trajectory: Trajectory) -> float:
    """The value of a problem's objective for a motion, in the objective's unit."""
    least = problem.objective
    total = least.time * trajectory.duration
    if not least.running:
        return total
    return total + least.running * running_cost(problem, trajectory, least.rate)
