"""Small functions evaluated at many points, and what they assemble to: rows, Jacobian and Hessian.

The equations at a point of the motion are a `PointFunction` r(y, p), differentiated once; its
arguments y are linear combinations of the variables z, a constant sparse `Layout` L. Jacobian and
Hessian of a program are then constant linear combinations of the derivatives at the points. So
the program is never expanded into scalar operations, and the same code serves every transcription
and formulation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from deltaopt.codegen.compile import in_machine_code
from deltaopt.curves.piecewise import Array, Index

Derivative = tuple[ca.Function, ca.Sparsity]
"""A Jacobian or Hessian: a function whose last result is the nonzeros, and the sparsity."""


@dataclass(frozen=True)
class PointFunction:
    """The equations r(y, p) at one point, with exact derivatives with respect to y.

    ``function``: (y, p) -> r, of scalar expressions. ``name``: of the rows, for error messages.
    """

    name: str
    function: ca.Function

    @cached_property
    def _expressions(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        y = ca.SX.sym("y", self.function.size1_in(0))
        p = ca.SX.sym("p", self.function.size1_in(1))
        return y, p, self.function(y, p)

    @cached_property
    def own(self) -> list[int]:
        """Which of p the equations depend on. The derivatives have these alone, so that problems
        that differ in others, as those of limits, have the same machine code."""
        _, p, r = self._expressions
        return np.flatnonzero(ca.which_depends(r, p, 1, False)).tolist()

    @cached_property
    def derivatives(self) -> tuple[Derivative, Derivative]:
        """(y, own p) -> r and the nonzeros of ∂r/∂y, and (y, own p, λ) -> those of ∂²(λ·r)/∂y²: as
        machine code where there is a compiler."""
        (jacobian, of_jacobian), (hessian, of_hessian) = self.derived
        both = jacobian, hessian
        jacobian, hessian = in_machine_code(both) or both
        return (jacobian, of_jacobian), (hessian, of_hessian)

    @property
    def derived(self) -> tuple[Derivative, Derivative]:
        """``derivatives`` as CasADi derives them."""
        y, p, r = self._expressions
        lam = ca.SX.sym("lam", r.numel())
        J, H = ca.jacobian(r, y), ca.hessian(ca.dot(lam, r), y)[0]
        jacobian = ca.Function("jacobian", [y, p[self.own]], [r, J.nz[:]], {"cse": True})
        hessian = ca.Function("hessian", [y, p[self.own], lam], [H.nz[:]], {"cse": True})
        return (jacobian, J.sparsity()), (hessian, H.sparsity())


@dataclass(frozen=True)
class Layout:
    """A constant sparse matrix L, each row of which is a weighted sum of a few variables.

    ``columns`` and ``weights``: (rows, k); row i is Σ_k weights[i, k] z[columns[i, k]].
    ``names``: of the rows, for error messages; empty if the rows are no constraints.
    """

    columns: Index
    weights: Array
    names: tuple[str, ...] = ()

    def matrix(self, n_variables: int) -> ca.DM:
        """The matrix L, (rows, n_variables)."""
        rows = np.repeat(np.arange(len(self.columns)), self.columns.shape[1])
        return _sparse(
            rows, self.columns.ravel(), self.weights.ravel(), len(self.columns), n_variables
        )


@dataclass(frozen=True)
class Points:
    """A point function at n points.

    ``layout``: of its arguments, point by point, n · ny rows. ``lower``, ``upper``: bounds of r,
    (nr,) if they are the same at every point, else (n, nr). ``fractions``: instants of the points,
    (n,), as fractions of the duration, for error messages.
    """

    function: PointFunction
    layout: Layout
    lower: Array
    upper: Array
    fractions: Array | None = None

    @property
    def number(self) -> int:
        """The number n of points."""
        return len(self.layout.columns) // self.function.function.size1_in(0)

    @property
    def rows(self) -> int:
        """The number of rows at one point."""
        return int(self.function.function.size1_out(0))

    def bounds(self, each: Array) -> Array:
        """Bounds of all rows, point by point; ``each``: ``lower`` or ``upper``."""
        return np.broadcast_to(each, (self.number, self.rows)).ravel()

    def row_names(self) -> list[str]:
        """The name and the instant of each row, for error messages."""
        n, nr = self.number, self.rows
        when = [f"point {i} of {n}" for i in range(1, n + 1)]
        if self.fractions is not None:
            when = [f"{fraction:.1%} of the duration" for fraction in self.fractions]
        return [f"{self.function.name} {j + 1} at {place}" for place in when for j in range(nr)]


Entries = tuple[Points, ca.Sparsity, ca.MX]
"""Derivatives at points: the sparsity at one point, and the nonzeros at all, point by point."""


def derived_at(
    points: Points, z: ca.MX, p: ca.MX, multipliers: ca.MX
) -> tuple[ca.MX, Entries, Entries]:
    """Of a point function at all points, with ``multipliers`` of its rows, (rows, points): its
    rows, (rows, points), its Jacobians and its Hessians."""
    n = points.number
    y = ca.reshape(ca.mtimes(points.layout.matrix(z.numel()), z), -1, n)
    ps = ca.repmat(p[points.function.own], 1, n)
    (jacobian, J_sparsity), (hessian, H_sparsity) = points.function.derivatives
    r, J = jacobian.map(n)(y, ps)
    H = hessian.map(n)(y, ps, multipliers)
    return r, (points, J_sparsity, ca.vec(J)), (points, H_sparsity, ca.vec(H))


def assemble_rows(
    linear: Layout, of: Sequence[Points], z: ca.MX, p: ca.MX, multipliers: ca.MX
) -> tuple[ca.MX, ca.MX, list[Entries]]:
    """Assemble all rows, linear ones first, their Jacobian, and the Hessians at the points of the
    rows times ``multipliers``, which ``assemble_hessian`` takes."""
    G = linear.matrix(z.numel())
    rows, slopes, curvature = [ca.mtimes(G, z)], list[Entries](), list[Entries]()
    first = len(linear.columns)
    for points in of:
        N, nr = points.number, points.rows
        own = ca.reshape(multipliers[first : first + N * nr], nr, N)
        r, J, H = derived_at(points, z, p, own)
        rows.append(ca.vec(r))
        slopes.append(J)
        curvature.append(H)
        first += N * nr
    return ca.vertcat(*rows), assemble_jacobian(G, slopes, z.numel()), curvature


def assemble_jacobian(G: ca.DM, slopes: Sequence[Entries], n: int) -> ca.MX:
    """The Jacobian of all rows: the linear rows G, then each point's Jacobian times its layout."""
    blocks = [ca.MX(G)]
    for points, sparsity, nonzeros in slopes:
        a, b = (np.array(i, dtype=np.intp) for i in sparsity.get_triplet())
        layout, N = points.layout, points.number
        ny, nr, k = sparsity.size2(), sparsity.size1(), layout.columns.shape[1]
        at = np.arange(N)[:, None]
        y = at * ny + b  # (N, nnz)
        rows = np.broadcast_to((at * nr + a)[..., None], (N, len(a), k))
        source = np.broadcast_to(np.arange(N * len(a)).reshape(N, -1)[..., None], rows.shape)
        blocks.append(
            _scatter(rows, layout.columns[y], source, layout.weights[y], nonzeros, (N * nr, n))
        )
    return ca.vertcat(*blocks)


def assemble_hessian(curvature: Sequence[Entries], n: int) -> ca.MX:
    """The upper triangle of Σ Lᵀ H L over all points."""
    total = ca.MX(n, n)
    for points, sparsity, nonzeros in curvature:
        a, b = (np.array(i, dtype=np.intp) for i in sparsity.get_triplet())
        layout, N = points.layout, points.number
        ny, k = sparsity.size1(), layout.columns.shape[1]
        at = np.arange(N)[:, None]
        ya, yb = at * ny + a, at * ny + b  # (N, nnz)
        shape = (N, len(a), k, k)
        rows = np.broadcast_to(layout.columns[ya][..., :, None], shape)
        columns = np.broadcast_to(layout.columns[yb][..., None, :], shape)
        weights = layout.weights[ya][..., :, None] * layout.weights[yb][..., None, :]
        source = np.broadcast_to(np.arange(N * len(a)).reshape(N, -1)[..., None, None], shape)
        upper = np.where(rows <= columns, weights, 0.0)
        total += _scatter(rows, columns, source, upper, nonzeros, (n, n))
    return total


def _scatter(
    rows: Index,
    columns: Index,
    source: Index,
    weights: Array,
    values: ca.MX,
    shape: tuple[int, int],
) -> ca.MX:
    """The sparse matrix of a shape with the sums of weights · values[source] at (rows, columns)."""
    keep = weights.ravel() != 0
    rows, columns = rows.ravel()[keep], columns.ravel()[keep]
    # Column-major order is that of CasADi's nonzeros.
    places, target = np.unique(columns * shape[0] + rows, return_inverse=True)
    at = (places % shape[0]).tolist(), (places // shape[0]).tolist()
    sparsity = ca.Sparsity.triplet(*shape, *at)
    combine = _sparse(
        target, source.ravel()[keep], weights.ravel()[keep], len(places), values.numel()
    )
    return ca.MX(sparsity, ca.mtimes(combine, values))


def _sparse(rows: Index, columns: Index, values: Array, n_rows: int, n_columns: int) -> ca.DM:
    """A sparse matrix from triplets; equal places add up, zeros are left out."""
    keep = values != 0
    places, target = np.unique(columns[keep] * n_rows + rows[keep], return_inverse=True)
    sums = np.bincount(target, weights=values[keep], minlength=len(places))
    at = (places % n_rows).tolist(), (places // n_rows).tolist()
    return ca.DM.triplet(*at, ca.DM(sums), n_rows, n_columns)
