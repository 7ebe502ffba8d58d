"""Small dense linear algebra inside symbolic expressions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
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


@dataclass(frozen=True)
class LeastNorm:
    """A ``LinearSolver`` for matrices that may be singular: the least of the best x.

    By singular values; those below ``tolerance`` times the largest count as zero. Evaluated
    by LAPACK at run time: it neither expands to scalars nor has derivatives.
    """

    tolerance: float

    def __call__(self, A: ca.MX, b: ca.MX) -> ca.MX:
        return _least_norm(A.shape[0], self.tolerance)(A, b)


class _InNumPy(ca.Callback):
    """A function of NumPy as one of CasADi, from matrices of some shapes to others."""

    def __init__(
        self,
        of: Callable[..., list[Array]],
        given: Sequence[tuple[int, int]],
        found: Sequence[tuple[int, int]],
    ) -> None:
        super().__init__()
        self._of, self._given, self._found = of, given, found
        # Integrators ask for a derivative even if they never call it.
        self.construct("in_numpy", {"enable_fd": True})

    def get_n_in(self) -> int:
        return len(self._given)

    def get_n_out(self) -> int:
        return len(self._found)

    def get_sparsity_in(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(*self._given[i])

    def get_sparsity_out(self, i: int) -> ca.Sparsity:
        return ca.Sparsity.dense(*self._found[i])

    def eval(self, arguments: Sequence[ca.DM]) -> list[Array]:
        given = [np.asarray(x.full()) for x in arguments]
        if not all(np.isfinite(each).all() for each in given):
            return [np.full(shape, np.nan) for shape in self._found]
        return self._of(*given)


@cache
def _least_norm(n: int, tolerance: float) -> ca.Function:
    """A, b -> x by NumPy's least squares: much faster than a whole decomposition.

    Cached, for CasADi does not keep what it calls back alive.
    """

    def least(A: Array, b: Array) -> list[Array]:
        return [np.asarray(np.linalg.lstsq(A, b, rcond=tolerance)[0], np.float64)]

    return _InNumPy(least, [(n, n), (n, 1)], [(n, 1)])


@cache
def singular_directions(rows: int, columns: int, free: int, tolerance: float) -> ca.Function:
    """A -> A⁺ (columns × rows), N (columns × free) with A N as small as can be, NᵀN = 1.

    N are the directions of the ``free`` smallest singular values; A⁺ inverts A across them
    and across whatever else has a singular value below ``tolerance`` times the largest.
    Cached, for CasADi does not keep what it calls back alive.
    """

    def directions(A: Array) -> list[Array]:
        U, sigma, V_T = np.linalg.svd(A)
        across = columns - free
        rank = min(across, int(np.sum(sigma > tolerance * sigma[0])))
        return [(V_T[:rank].T / sigma[:rank]) @ U[:, :rank].T, V_T[across:].T]

    return _InNumPy(directions, [(rows, columns)], [(columns, rows), (columns, free)])
