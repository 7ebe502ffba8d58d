"""Constraint matrices C with J C = 0, eq. (7) and (8), as values.

Each comes with a right inverse P of J, so that C and P together solve the constraints:

    J C = 0     admissible variations           δq = C δξ
    J P = 1     any J q̇ = b is solved by        q̇ = C ũ + P b
                multipliers follow from         λ = -Pᵀ (Q* + Q)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import casadi as ca

from deltaopt.dynamics.mechanism import Mechanism


class ConstraintMatrix(Protocol):
    """A way to solve the constraints of a mechanism."""

    def function(self, mechanism: Mechanism) -> ca.Function:
        """(t, q, p) -> C (n × ν), P (n × γ)."""
        ...


@dataclass(frozen=True)
class ClosedForm:
    """The mechanism's own solution, as eq. (55) of the Delta or eq. (11) of the pendulum."""

    def function(self, mechanism: Mechanism) -> ca.Function:
        if mechanism.closed_form is None:
            raise ValueError(f"{mechanism.name} has no constraint matrix in closed form")
        m = mechanism
        return ca.Function("closed_form", [m.time, m.q, m.parameters], list(mechanism.closed_form))
