"""What a motion of the platform asks of the motors, by the Principle of Virtual Work."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca

from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.robot.model import DeltaModel


@lru_cache(maxsize=16)
def asked_of_motors(model: DeltaModel) -> ca.Function:
    """(x, v, a) of the platform -> torques and speeds of the motors, 3 each."""
    functions, p = model.functions, model.parameters
    x, v, a = (ca.SX.sym(name, 3) for name in "xva")
    q, dq, ddq = functions.motion(x, v, a, p)
    torque, _ = VirtualWork().inverse_dynamics(functions.mechanism).expand()(0, q, dq, ddq, p)
    return ca.Function("asked", [x, v, a], [torque, dq[functions.motors]], {"cse": True})
