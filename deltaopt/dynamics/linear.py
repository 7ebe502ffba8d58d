"""Small dense linear systems inside symbolic expressions."""

from __future__ import annotations

import casadi as ca


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
    a, rhs = ca.SX.sym("A", n, n), ca.SX.sym("b", n)
    return ca.Function("cofactors", [a, rhs], [ca.inv_minor(a) @ rhs])(A, b)
