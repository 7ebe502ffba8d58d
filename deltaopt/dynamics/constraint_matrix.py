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
import numpy as np
from numpy.typing import NDArray

from deltaopt.dynamics.linear import reflect, singular_directions, solve_scalars
from deltaopt.dynamics.mechanism import SX, Mechanism


class ConstraintMatrix(Protocol):
    """A way to solve the constraints of a mechanism."""

    def function(self, mechanism: Mechanism) -> ca.Function:
        """(t, q, p) -> C (n × ν), P (n × γ)."""


@dataclass(frozen=True)
class ClosedForm:
    """The mechanism's own solution, as eq. (55) of the Delta or eq. (11) of the pendulum."""

    def function(self, mechanism: Mechanism) -> ca.Function:
        if mechanism.closed_form is None:
            raise ValueError(f"{mechanism.name} has no constraint matrix in closed form")
        return _function("closed_form", mechanism, *mechanism.closed_form)


@dataclass(frozen=True)
class Partition:
    """ν of the coordinates are independent, the others follow, eq. (6).

    In the order (dependent °, independent *), with J = [J° J*]:

        C = [ -J°⁻¹ J* ]        P = [ J°⁻¹ ]
            [     1    ]            [   0  ]

    ``independent``: indices of q*. It fails where J° is singular: choose others there.
    """

    independent: tuple[int, ...]

    @staticmethod
    def pivoted(J: NDArray[np.float64]) -> Partition:
        """The choice whose J° is far from singular where J (γ × n) was taken.

        QR with column pivoting: the next dependent coordinate is the one whose column of
        J is longest across those already chosen.
        """
        across = np.array(J, dtype=float)
        dependent: list[int] = []
        for _ in range(across.shape[0]):
            longest = int(np.argmax(np.linalg.norm(across, axis=0)))
            direction = across[:, longest] / np.linalg.norm(across[:, longest])
            across -= np.outer(direction, direction @ across)
            across[:, longest] = 0.0
            dependent.append(longest)
        return Partition(tuple(i for i in range(across.shape[1]) if i not in dependent))

    def function(self, mechanism: Mechanism) -> ca.Function:
        J = mechanism.J
        (gamma, n), nu = _shape(mechanism), len(self.independent)
        if nu != n - gamma or len({*self.independent} & {*range(n)}) != nu:
            raise ValueError(
                f"{mechanism.name} needs {n - gamma} different independent coordinates "
                f"out of 0..{n - 1}, not {self.independent}"
            )
        independent = list(self.independent)
        dependent = [i for i in range(n) if i not in independent]
        solved = solve_scalars(J[:, dependent], ca.horzcat(-J[:, independent], SX.eye(gamma)))
        C, P = SX(n, nu), SX(n, gamma)
        C[independent, :] = SX.eye(nu)
        C[dependent, :] = solved[:, :nu]
        P[dependent, :] = solved[:, nu:]
        return _function("partition", mechanism, C, P)


@dataclass(frozen=True)
class NullSpace:
    """An orthonormal basis of the null space of J, eq. (8): no coordinates to choose.

    From Jᵀ = Q₁ R with Q = [Q₁ Q₂] orthogonal: C = Q₂ and P = Q₁ R⁻ᵀ, the pseudo-inverse.
    It fails only where J loses rank. Columns of C may flip sign from state to state; the
    equations of motion do not depend on it.
    """

    def function(self, mechanism: Mechanism) -> ca.Function:
        gamma, n = _shape(mechanism)
        R, Q_T = reflect(mechanism.J.T, SX.eye(n))
        C = Q_T[gamma:, :].T
        P = ca.solve(R[:gamma, :], Q_T[:gamma, :]).T
        return _function("null_space", mechanism, C, P)


@dataclass(frozen=True)
class RankRevealing:
    """An orthonormal basis by singular values: for constraints that depend on each other.

    ``freedoms``: ν, the degrees of freedom; more than n - γ if constraints are redundant.
    ``tolerance``: singular values of J below this part of the largest count as zero.

    C are the directions of the ν smallest singular values, P is the pseudo-inverse: J P = 1
    only on what J can reach, and the multipliers are the least of those possible. Evaluated
    by LAPACK at run time: not for what is expanded to scalars or differentiated.
    """

    freedoms: int
    tolerance: float = 1e-8

    def function(self, mechanism: Mechanism) -> ca.Function:
        m, gamma = mechanism, mechanism.mu.numel()
        t, q, p = (ca.MX.sym("x", x.numel()) for x in (m.time, m.q, m.parameters))
        J = ca.Function("J", [m.time, m.q, m.parameters], [ca.densify(m.J)])(t, q, p)
        P, C = singular_directions(gamma, m.q.numel(), self.freedoms, self.tolerance)(J)
        return ca.Function("rank_revealing", [t, q, p], [C, P])


def _shape(m: Mechanism) -> tuple[int, int]:
    """γ and n, where every constraint must take a freedom away."""
    gamma, n = m.J.shape
    if gamma >= n:
        raise ValueError(
            f"{m.name} has {gamma} constraints for {n} coordinates, so that some are redundant:"
            " use RankRevealing"
        )
    return gamma, n


def _function(name: str, m: Mechanism, C: SX, P: SX) -> ca.Function:
    return ca.Function(name, [m.time, m.q, m.parameters], [ca.densify(C), ca.densify(P)])
