"""Whether a scene can have a solution at all, told before anything is optimised."""

from __future__ import annotations

import numpy as np

from deltaopt.errors import Infeasible, Singular, Unreachable, in_words
from deltaopt.model import DeltaModel
from deltaopt.record import Vector3
from deltaopt.scene import Scene

_LEAST_WAY = 1e-12  # m: coordinates of a metre have digits down to 1e-16
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
    model = DeltaModel(scene.robot, scene.payload)
    for name, point in (("start", scene.start), ("goal", scene.goal)):
        _require_reach(model, name, point)
        _require_rest(model, name, point, scene.torque_limits)
        _require_departure(model, name, point)


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
