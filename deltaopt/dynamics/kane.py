"""Kane's method, section 3.3: everything in generalized speeds u instead of q̇.

u = X q̇ + y,   q̇ = V u + w                eq. (41), (42)
Σ (R + R*) · ṽ* + (T + T*) · ω̃ = 0         eq. (49)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import casadi as ca

from deltaopt.dynamics.constraint_matrix import ClosedForm, ConstraintMatrix
from deltaopt.dynamics.formulation import Projected
from deltaopt.dynamics.linear import solve_scalars
from deltaopt.dynamics.mechanism import SX, Mechanism
from deltaopt.dynamics.virtual_work import effective_force, effective_torque, efforts

GeneralSpeeds = Callable[[Mechanism], SX]
"""A choice of u, n: expressions in q, t and, affinely and invertibly, q̇, eq. (40)."""


def coordinate_rates(mechanism: Mechanism) -> SX:
    """The trivial choice u = q̇, with which Kane's method is the Principle of Virtual Work."""
    return mechanism.dq


@dataclass(frozen=True)
class Kane(Projected):
    """Kane's equations in the general speeds ``speeds`` of a mechanism."""

    constraint_matrix: ConstraintMatrix = field(default_factory=ClosedForm)
    speeds: GeneralSpeeds = coordinate_rates

    def equations(self, mechanism: Mechanism, C: SX) -> SX:
        m, kinematics = mechanism, Kinematics(mechanism, self.speeds(mechanism))
        C_tilde = kinematics.X @ C  # eq. (43)
        F_tilde = SX(C.shape[1], 1)  # eq. (46)
        for body in m.bodies:
            v, omega = kinematics.of(m.velocity(body)), kinematics.of(body.angular_velocity)
            force = effective_force(m, body, kinematics.rate_of_change(v))
            torque = effective_torque(body, omega, kinematics.rate_of_change(omega))
            F_tilde += kinematics.partial(v, C_tilde).T @ force
            F_tilde += kinematics.partial(omega, C_tilde).T @ torque
        for effort in efforts(m):
            F_tilde += kinematics.partial(kinematics.of(effort.rate), C_tilde).T * effort.value
        return kinematics.in_rates(F_tilde)


class Kinematics:
    """Velocities as functions of (q, u, t), their partial velocities and rates of change."""

    def __init__(self, mechanism: Mechanism, speeds: SX) -> None:
        m = self._mechanism = mechanism
        if speeds.numel() != m.q.numel():
            raise ValueError(f"{m.name} needs {m.q.numel()} general speeds, not {speeds.numel()}")
        self._speeds = speeds
        self.X = ca.jacobian(speeds, m.dq)
        y = ca.substitute(speeds, m.dq, SX.zeros(m.dq.numel()))
        self.u, self.du = SX.sym("u", m.q.numel()), SX.sym("du", m.q.numel())
        self._rates = solve_scalars(self.X, self.u - y)  # q̇ = V u + w, eq. (42)

    def of(self, velocity: SX) -> SX:
        """An expression in (q, q̇, t) in terms of (q, u, t)."""
        return ca.substitute(velocity, self._mechanism.dq, self._rates)

    def partial(self, velocity: SX, C_tilde: SX) -> SX:
        """Partial velocities ∂v/∂ũ, eq. (44) and (45)."""
        return ca.jacobian(velocity, self.u) @ C_tilde

    def rate_of_change(self, velocity: SX) -> SX:
        """d/dt of v(q, u, t) along q̇ = V u + w and u̇."""
        state = ca.vertcat(self._mechanism.q, self.u, self._mechanism.time)
        return ca.jtimes(velocity, state, ca.vertcat(self._rates, self.du, 1))

    def in_rates(self, expression: SX) -> SX:
        """Back from (u, u̇) to (q̇, q̈)."""
        m, u = self._mechanism, self._speeds
        old, new = ca.vertcat(self.u, self.du), ca.vertcat(u, m.rate_of_change(u))
        return ca.substitute(expression, old, new)
