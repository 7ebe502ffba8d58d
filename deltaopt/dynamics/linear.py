"""Small dense linear algebra inside symbolic expressions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import casadi as ca
import numpy as np
from numpy.typing import NDArray

SX = ca.SX
Array = NDArray[np.float64]

LinearSolver = Callable[[ca.MX, ca.MX], ca.MX]
"""x of A (n × n) and b (n), A x = b."""


def solve(A: ca.MX, b: ca.MX) -> ca.MX:
    """x with A x = b, A square.

    Up to 3 × 3 by cofactors, which stay expandable to scalars and cost the least there;
    above by CasADi's QR, which needs no pivoting for accuracy.
    """
    n = A.shape[0]
    if A.shape[0] != A.shape[1]:
        raise ValueError(f"{A.shape[0]} equations for {A.shape[1]} unknowns")
    if n > 3:
        return ca.solve(A, b, "qr")
    a, rhs = SX.sym("A", n, n), SX.sym("b", n)
    return ca.Function("cofactors", [a, rhs], [ca.inv_minor(a) @ rhs])(A, b)


def solve_affine(equations: SX, unknown: SX) -> SX:
    """The unknowns at which as many equations, affine in them, are zero; by the adjugate
    matrix, for up to three of them."""
    rest = ca.substitute(equations, unknown, SX.zeros(unknown.numel()))
    return -ca.inv_minor(ca.jacobian(equations, unknown)) @ rest


def reflect(A: SX, B: SX) -> tuple[SX, SX]:
    """R = Qᵀ A and Qᵀ B, R upper triangular, Q orthogonal, by Householder's reflections.

    Written out in scalars, so that a result that uses it can still be expanded. Each
    reflection takes the sign that does not cancel; where that sign changes a row of both
    results flips. What does not depend on the choice of Q does not feel it.
    """
    columns = A.shape[1]
    W = ca.horzcat(A, B)
    for k in range(columns):
        x = W[k:, k]
        if x[1:].nnz() == 0:
            continue
        norm, away = ca.norm_2(x), ca.if_else(x[0] < 0, -1, 1)
        v = ca.vertcat(x[0] + away * norm, x[1:])
        W[k:, k:] -= v @ (v.T @ W[k:, k:]) / (norm * (norm + ca.fabs(x[0])))
        W[k + 1 :, k] = SX(x.numel() - 1, 1)
    W = ca.sparsify(W)
    return W[:, :columns], W[:, columns:]


def solve_scalars(A: SX, B: SX) -> SX:
    """X with A X = B, A square, by QR written out in scalars."""
    R, rhs = reflect(A, B)
    return ca.solve(R, rhs)  # back-substitution: R is structurally triangular


class _SingularDirections(ca.Callback):
    """A -> A⁺ (columns × rows), N (columns × free) with A N as small as can be, NᵀN = 1.

    N are the directions of the ``free`` smallest singular values; A⁺ inverts A across them and
    across whatever else has a singular value below ``tolerance`` times the largest. Evaluated by
    LAPACK at run time: it neither expands to scalars nor has derivatives but differences.
    """

    def __init__(self, rows: int, columns: int, free: int, tolerance: float) -> None:
        super().__init__()
        self._given, self._found = (rows, columns), ((columns, rows), (columns, free))
        self._tolerance = tolerance
        # Integrators ask for a derivative even if they never call it.
        self.construct("singular_directions", {"enable_fd": True})

    def get_n_out(self) -> int:
        return len(self._found)

    def get_sparsity_in(self, _: int) -> ca.Sparsity:
        return ca.Sparsity.dense(*self._given)

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(*self._found[i])

    def eval(self, arguments: Sequence[ca.DM]) -> list[Array]:
        A = np.asarray(arguments[0].full())
        if not np.isfinite(A).all():
            return [np.full(shape, np.nan) for shape in self._found]
        U, sigma, V_T = np.linalg.svd(A)
        columns, free = self._found[1]
        across = columns - free
        rank = min(across, int(np.sum(sigma > self._tolerance * sigma[0])))
        return [(V_T[:rank].T / sigma[:rank]) @ U[:, :rank].T, V_T[across:].T]


singular_directions = cache(_SingularDirections)
"""Cached, for CasADi does not keep what it calls back alive."""
