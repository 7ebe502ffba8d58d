"""The Principle of Virtual Work for rigid bodies, section 3.1: forces and accelerations.

Neither the energies nor the inertia matrix are used:

    Σ (R + R*) · β* + (T + T*) · ψ = 0        eq. (23)
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca

from deltaopt.dynamics.constraint_matrix import ClosedForm, ConstraintMatrix
from deltaopt.dynamics.formulation import Projected
from deltaopt.dynamics.mechanism import SX, Body, Effort, Mechanism, none


@dataclass(frozen=True)
class VirtualWork(Projected):
    """The work of all but constraint forces is zero for admissible variations, eq. (15)."""

    constraint_matrix: ConstraintMatrix = field(default_factory=ClosedForm)

    def equations(self, mechanism: Mechanism, C: SX) -> SX:
        m, work = mechanism, SX(C.shape[1], 1)
        for body in m.bodies:
            v, omega = m.velocity(body), body.angular_velocity
            beta, psi = ca.jacobian(v, m.dq) @ C, ca.jacobian(omega, m.dq) @ C  # eq. (24), (25)
            work += beta.T @ effective_force(m, body, m.rate_of_change(v))
            work += psi.T @ effective_torque(body, omega, m.rate_of_change(omega))
        for effort in efforts(m):
            work += (ca.jacobian(effort.rate, m.dq) @ C).T * effort.value
        return work


def effective_force(mechanism: Mechanism, body: Body, acceleration: SX) -> SX:
    """R + R*, 3, N, eq. (19) and (20): the weight and -m a*."""
    gravity = SX.zeros(3) if mechanism.gravity is None else mechanism.gravity
    return body.mass * (gravity - acceleration)


def effective_torque(body: Body, omega: SX, acceleration: SX) -> SX:
    """T*, 3, N·m in the body's principal axes, eq. (22): -I ω̇ - ω × I ω. A particle has none.

    The weight has no moment about the centre of mass, eq. (21).
    """
    if body.inertia.numel() == 0:
        return none()
    return -body.inertia * acceleration - ca.cross(omega, body.inertia * omega)


def efforts(mechanism: Mechanism) -> list[Effort]:
    """The active efforts other than gravity; a potential has the power -∂V/∂q q̇."""
    rate = ca.jtimes(mechanism.potential, mechanism.q, mechanism.dq)
    return [*mechanism.efforts, Effort(SX(-1), rate)]
