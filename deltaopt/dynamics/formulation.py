"""What every formulation gives, and how those without multipliers give it.

Functions take (t, q, q̇, q̈, τ, λ, p) in this order, leaving out what they do not need;
p are the mechanism's parameters.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import casadi as ca

from deltaopt.dynamics.constraint_matrix import ConstraintMatrix
from deltaopt.dynamics.linear import solve
from deltaopt.dynamics.mechanism import SX, Mechanism


class Formulation(ABC):
    """A way to write the equations of motion of a mechanism; a value, equal to its like."""

    @abstractmethod
    def residual(self, mechanism: Mechanism) -> ca.Function:
        """(t, q, q̇, q̈, τ, [λ,] p) -> zero where the motion obeys the dynamics."""

    @abstractmethod
    def inverse_dynamics(self, mechanism: Mechanism) -> ca.Function:
        """(t, q, q̇, q̈, p) -> τ (m), λ (γ), for a motion that obeys the constraints."""

    @abstractmethod
    def forward_dynamics(self, mechanism: Mechanism) -> ca.Function:
        """(t, q, q̇, τ, p) -> q̈ (n), λ (γ)."""


class Projected(Formulation):
    """Formulations free of constraint forces: ν equations, affine in q̈ and τ."""

    constraint_matrix: ConstraintMatrix

    @abstractmethod
    def equations(self, mechanism: Mechanism, C: SX) -> SX:
        """Virtual work per δξ of all but constraint forces for variations δq = C δξ.

        Zero where the motion obeys the dynamics if the variations are admissible, J C = 0.
        """

    def residual(self, mechanism: Mechanism) -> ca.Function:
        """(t, q, q̇, q̈, τ, p) -> ν."""
        m, C, equations = mechanism, *self._equations(mechanism)
        r = ca.Function("r", [*state(m), m.ddq, m.controls, m.parameters, C], [equations])
        t, q, dq, ddq, tau, p = symbols(m.time, m.q, m.dq, m.ddq, m.controls, m.parameters)
        C_of_q, _ = self.constraint_matrix.function(m)(t, q, p)
        x = [t, q, dq, ddq, tau, p]
        return ca.Function("residual", x, [r(*x, C_of_q)])

    def inverse_dynamics(self, mechanism: Mechanism) -> ca.Function:
        """(t, q, q̇, q̈, p) -> τ, λ: ν × ν, needs as many motors as degrees of freedom."""
        m, C, equations = mechanism, *self._equations(mechanism)
        A, b = affine(equations, m.controls)
        system = ca.Function("system", [*state(m), m.ddq, m.parameters, C], [A, b])
        t, q, dq, ddq, p = x = symbols(m.time, m.q, m.dq, m.ddq, m.parameters)
        C_of_q, P = self.constraint_matrix.function(m)(t, q, p)
        tau = solve(*system(t, q, dq, ddq, p, C_of_q))
        lam = self._multipliers(m)(t, q, dq, ddq, tau, p, P)
        return ca.Function("inverse_dynamics", x, [tau, lam])

    def forward_dynamics(self, mechanism: Mechanism) -> ca.Function:
        """(t, q, q̇, τ, p) -> q̈, λ: ν × ν for ũ̇ in q̈ = C ũ̇ - P (J̇ q̇ + μ̇)."""
        m, C, equations = mechanism, *self._equations(mechanism)
        A, b = affine(equations, m.ddq)
        system = ca.Function("system", [*state(m), m.controls, m.parameters, C], [A, b, m.J_bias])
        t, q, dq, tau, p = x = symbols(m.time, m.q, m.dq, m.controls, m.parameters)
        C_of_q, P = self.constraint_matrix.function(m)(t, q, p)
        M_tilde, rest, bias = system(t, q, dq, tau, p, C_of_q)
        particular = -P @ bias
        ddq = C_of_q @ solve(M_tilde @ C_of_q, rest - M_tilde @ particular) + particular
        lam = self._multipliers(m)(t, q, dq, ddq, tau, p, P)
        return ca.Function("forward_dynamics", x, [ddq, lam])

    def _equations(self, m: Mechanism) -> tuple[SX, SX]:
        """A symbol for C and the equations written with it."""
        C = SX.sym("C", *self.constraint_matrix.function(m).size_out(0))
        return C, self.equations(m, C)

    def _multipliers(self, m: Mechanism) -> ca.Function:
        """λ: the constraint forces undo the work of the others, and J P = 1 singles out each."""
        P = SX.sym("P", m.q.numel(), m.mu.numel())
        x = [*state(m), m.ddq, m.controls, m.parameters, P]
        return ca.Function("multipliers", x, [-self.equations(m, P)])


def state(m: Mechanism) -> tuple[SX, SX, SX]:
    """t, q, q̇."""
    return m.time, m.q, m.dq


def symbols(*like: SX) -> list[ca.MX]:
    """Matrix symbols of the shapes of scalar ones."""
    return [ca.MX.sym(f"x{i}", *s.shape) for i, s in enumerate(like)]


def affine(equations: SX, unknowns: SX) -> tuple[SX, SX]:
    """A and b of A x = b, for equations that are affine in the unknowns x and zero there."""
    A = ca.jacobian(equations, unknowns)
    return A, -ca.substitute(equations, unknowns, SX.zeros(unknowns.numel()))
