"""On which side of the parallel singularities of the robot places and paths lie."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import Array, PiecewisePolynomial, with_neighbours
from deltaopt.errors import Infeasible, in_words
from deltaopt.mechanisms.functions import Functions
from deltaopt.robot.machine import Model
from deltaopt.robot.model import model_of
from deltaopt.scene.scene import Scene

_CLOSER, _BETWEEN = 5, np.array([0.25, 0.5, 0.75])
"""How many times a motion is sampled, more closely each time, and the shares of what lies between
two samples at which it is sampled then."""


def leads_through_singularity(model: Model, position: PiecewisePolynomial, t: Array) -> bool:
    """Whether a parallel singularity lies on a motion, as far as samples show: at times ``t``,
    (N,), and between them wherever the distance from it is less than what that changes by from one
    to the next, again and again. A motion may be beyond it for a hundredth of an interval only.

    In one, finite torques do not hold the platform: a motion through it exceeds every torque limit,
    however few instants show that.
    """
    for _ in range(_CLOSER):
        volumes = volumes_at(model, position.at(t))
        signed = volumes * np.sign(volumes[0])
        if not (signed > 0).all():  # nor where it is not a number
            return True
        change = with_neighbours(np.abs(np.diff(signed)))
        near = np.flatnonzero(np.minimum(signed[:-1], signed[1:]) < change)
        if not len(near):
            return False
        between = t[near, None] + (t[near + 1] - t[near])[:, None] * _BETWEEN
        t = np.sort(np.append(t, between))
    return False


def require_ends_on_one_side(scene: Scene) -> None:
    """Raise Infeasible where a parallel singularity lies between start and goal, on every path: the
    volume of the bars' directions, which is zero in one, has another sign at the goal."""
    volumes = volumes_at(model_of(scene.robot, scene.payload), np.array(scene.given_points))
    if not (volumes[0] * volumes > 0).all():
        raise Infeasible(
            "start and goal are on different sides of a parallel singularity, in which the motors "
            "do not hold the platform: every path between them leads through one"
        )


def require_path_on_one_side(scene: Scene, path: Array) -> None:
    """Raise Infeasible where places of a given path, (N, 3) in m, lie on different sides of a
    parallel singularity."""
    volumes = volumes_at(model_of(scene.robot, scene.payload), path)
    beyond = np.flatnonzero(volumes * volumes[0] <= 0)
    if len(beyond):
        raise Infeasible(
            f"the path: at {in_words(path[beyond[0]])} m it leads through a parallel singularity, "
            "in which the motors do not hold the platform"
        )


def distance_from_parallel(scene: Scene) -> float:
    """The lesser distance of start and goal from a parallel singularity, without unit."""
    model = model_of(scene.robot, scene.payload)
    return float(np.abs(volumes_at(model, np.array(scene.given_points))).min())


def volumes_at(model: Model, points: Array) -> Array:
    """Distances from a parallel singularity at points (N, 3), m, with a sign, (N,)."""
    parallel = _parallel_function(model.functions)
    (found,) = parallel(points, parameters=model.parameters)
    return np.asarray(found[:, 0])


@lru_cache(maxsize=32)
def _parallel_function(functions: Functions) -> RowFunction:
    """(x, p) -> distance from a parallel singularity, with a sign."""
    x, p = ca.SX.sym("x", 3), functions.symbols()
    margin = functions.parallel_margin(functions.inverse_kinematics(x, p))
    return RowFunction.of("parallel", [x, p], [margin])
