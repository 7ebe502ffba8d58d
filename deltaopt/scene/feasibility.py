"""Whether a scene can have a solution at all, told before anything is optimised."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import Array, RowFunction
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.errors import Infeasible, Singular, Unreachable, in_words
from deltaopt.files.validated_record import Vector3
from deltaopt.mechanisms.delta.functions import delta_functions
from deltaopt.mechanisms.delta.mechanism import DeltaTerms
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.scene.scene import Scene

_LEAST_WAY = 1e-12  # m: coordinates of a metre have digits down to 1e-16
_CLEAR = 1e-6  # of squared distances from a serial singularity: nearer ones are looked at closely
_SAME_PLACE = 1e-6  # m: near a parallel singularity forward kinematics knows half the digits


def check_feasible(scene: Scene) -> None:
    """Raise Unreachable, Singular or Infeasible, in one sentence, if start or goal rule a
    motion out."""
    way = np.linalg.norm(np.subtract(scene.goal, scene.start))
    if way < _LEAST_WAY:
        raise Infeasible(
            f"start and goal are {way:.1e} m apart, which coordinates in double precision "
            f"cannot resolve; at least {_LEAST_WAY:g} m are needed"
        )
    model = delta_model(scene.robot, scene.payload)
    if _is_feasible(scene):
        return
    for name, point in (("start", scene.start), ("goal", scene.goal)):
        _require_reach(model, name, point)
        _require_rest(model, name, point, scene.torque_limits)
        _require_departure(model, name, point)


def least_opening(scene: Scene) -> float:
    """sin² (q_{k,1} - q_{k,2}) of the chain at start or goal that is nearest to a fold."""
    return float(reach_at_ends(scene)[:, 3:].min())


def reach_at_ends(scene: Scene) -> Array:
    """Squared distances of start and goal from serial singularities, (2, 6): sideways, then
    sin² (q_{k,1} - q_{k,2})."""
    return _ends(scene)[2]


def _is_feasible(scene: Scene) -> bool:
    """The same in one evaluation, without words."""
    ends = np.array([scene.start, scene.goal])
    back, holding, reach = _ends(scene)
    there = np.linalg.norm(back - ends, axis=1) <= _SAME_PLACE  # False where not a number
    held = (np.abs(holding) <= scene.torque_limits).all()
    return bool(there.all() and held and (reach > _CLEAR).all())


def _ends(scene: Scene) -> tuple[Array, ...]:
    """``_rest_function`` at start and goal, 2 rows each."""
    model = delta_model(scene.robot, scene.payload)
    rest = _rest_function(model.functions.terms)
    return rest(np.array([scene.start, scene.goal]), parameters=model.parameters)


@lru_cache(maxsize=16)
def _rest_function(terms: DeltaTerms) -> RowFunction:
    """(x, p) -> where forward kinematics puts the platform for x's motor angles, m; torques
    that hold it there, N·m (3 each); squared distances from serial singularities (6)."""
    functions = delta_functions(terms, Explicit())
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", len(terms.names))
    back = functions.forward_kinematics(functions.inverse_kinematics(x, p)[3::3], p)
    rest = ca.SX.zeros(3)
    holding, _ = functions.inverse_dynamics.expand()(x, rest, rest, p)
    return RowFunction(
        ca.Function("rest", [x, p], [back, holding, functions.reach(x, p)], {"cse": True})
    )


def _require_reach(model: DeltaModel, name: str, point: Vector3) -> None:
    try:
        q = model.inverse_kinematics(point)
        back = model.forward_kinematics(q[3::3])
    except Unreachable as error:
        raise Unreachable(f"{name}: {error}") from None
    if np.linalg.norm(back - point) > _SAME_PLACE:
        raise Unreachable(
            f"{name}: at {in_words(point)} m the platform is not below its elbows, which is "
            "outside the industrial assembly mode"
        )


def _require_rest(model: DeltaModel, name: str, point: Vector3, limits: Vector3) -> None:
    """A motion begins and ends at rest, where the motors hold the weight."""
    try:
        holding = model.inverse_dynamics(point, np.zeros(3), np.zeros(3))
    except Unreachable as error:
        raise Unreachable(f"{name}: {error}") from None
    for motor, (torque, limit) in enumerate(zip(holding, limits, strict=True), start=1):
        if abs(torque) > limit:
            raise Infeasible(
                f"{name}: motor {motor} needs {abs(torque):.4g} N·m to hold the platform at rest "
                f"at {in_words(point)} m, more than its limit of {limit:g} N·m"
            )


def _require_departure(model: DeltaModel, name: str, point: Vector3) -> None:
    """In a serial singularity the platform's position does not say how the chains move."""
    try:
        model.motion(point, np.zeros(3), np.zeros(3))
    except Singular as error:
        raise Singular(error.kind, error.chain, error.margin, name) from None
