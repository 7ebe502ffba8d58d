"""Small dense linear algebra inside symbolic expressions."""

from __future__ import annotations

import casadi as ca

SX = ca.SX


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
