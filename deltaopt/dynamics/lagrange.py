"""Lagrange's equations of a constrained mechanism, section 3.2.

Two ways to keep the constraints, from one kinetic energy:

    L_E, explicit      Cᵀ (Q* + Q) = 0            eq. (39)
    L_I, multipliers   Q* + Q + Jᵀ λ = 0          eq. (37)
"""

from __future__ import annotations

from dataclasses import dataclass, field

import casadi as ca

from deltaopt.dynamics.constraint_matrix import ClosedForm, ConstraintMatrix
from deltaopt.dynamics.formulation import Formulation, Projected, affine, state, symbols
from deltaopt.dynamics.linear import LinearSolver, solve
from deltaopt.dynamics.mechanism import SX, Mechanism


@dataclass(frozen=True)
class Explicit(Projected):
    """Model L_E: the constraint matrix takes the multipliers out, eq. (39)."""

    constraint_matrix: ConstraintMatrix = field(default_factory=ClosedForm)

    def equations(self, mechanism: Mechanism, C: SX) -> SX:
        return C.T @ (mechanism.Q_star + mechanism.Q)


@dataclass(frozen=True)
class Multiplier(Formulation):
    """Model L_I: one multiplier for each constraint, eq. (37). ``solver``: of its linear system."""

    solver: LinearSolver = solve

    def equations(self, mechanism: Mechanism) -> SX:
        """Q* + Q + Jᵀ λ, n."""
        return mechanism.Q_star + mechanism.Q + mechanism.J.T @ mechanism.lam

    def residual(self, mechanism: Mechanism) -> ca.Function:
        """(t, q, q̇, q̈, τ, λ, p) -> n."""
        m = mechanism
        x = [*state(m), m.ddq, m.controls, m.lam, m.parameters]
        return ca.Function("residual", x, [self.equations(m)])

    def inverse_dynamics(self, mechanism: Mechanism) -> ca.Function:
        """(t, q, q̇, q̈, p) -> τ, λ: n × n in both at once."""
        return self._solved("inverse_dynamics", mechanism, *self.inverse_system(mechanism))

    def forward_dynamics(self, mechanism: Mechanism) -> ca.Function:
        """(t, q, q̇, τ, p) -> q̈, λ: n + γ in both at once, with J q̈ + J̇ q̇ + μ̇ = 0."""
        return self._solved("forward_dynamics", mechanism, *self.forward_system(mechanism))

    def inverse_system(self, mechanism: Mechanism) -> tuple[list[SX], SX, SX]:
        """Inputs, A and b of the linear system for τ and λ."""
        m = mechanism
        A, b = affine(self.equations(m), ca.vertcat(m.controls, m.lam))
        return [*state(m), m.ddq, m.parameters], A, b

    def forward_system(self, mechanism: Mechanism) -> tuple[list[SX], SX, SX]:
        """Inputs, A and b of the linear system for q̈ and λ."""
        m = mechanism
        equations = ca.vertcat(self.equations(m), m.J @ m.ddq + m.J_bias)
        A, b = affine(equations, ca.vertcat(m.ddq, m.lam))
        return [*state(m), m.controls, m.parameters], A, b

    def _solved(
        self, name: str, mechanism: Mechanism, inputs: list[SX], A: SX, b: SX
    ) -> ca.Function:
        x, unknowns = symbols(*inputs), A.shape[1]
        solution = self.solver(*ca.Function("system", inputs, [A, b])(*x))
        sought = unknowns - mechanism.lam.numel()
        return ca.Function(name, x, ca.vertsplit(solution, [0, sought, unknowns]))
