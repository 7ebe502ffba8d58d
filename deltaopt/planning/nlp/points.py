"""Small functions evaluated at many points, and what they assemble to: rows, Jacobian and Hessian.

The equations at a point of the motion are a `PointFunction` r(y, p), differentiated once; its
arguments y are linear combinations of the variables z, a constant sparse `Layout` L. Jacobian and
Hessian of a program are then constant linear combinations of the derivatives at the points. So
the program is never expanded into scalar operations, and the same code serves every transcription
and formulation.
"""

from __future__ import annotations

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
        """The matrix L, (rows, n_variables): weights of equal places add up, zeros are left out."""
        rows = np.repeat(np.arange(len(self.columns)), self.columns.shape[1])
        columns, weights = self.columns.ravel(), self.weights.ravel()
        kept = weights != 0
        numbers = columns[kept] * len(self.columns) + rows[kept]
        places, target = np.unique(numbers, return_inverse=True)
        sums = np.bincount(target, weights=weights[kept], minlength=len(places))
        at = (places % len(self.columns)).tolist(), (places // len(self.columns)).tolist()
        return ca.DM.triplet(*at, ca.DM(sums), len(self.columns), n_variables)


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


def derived_at(
    points: Points, z: ca.MX, p: ca.MX, multipliers: ca.MX
) -> tuple[ca.MX, ca.MX, ca.MX]:
    """Of a point function at all points, with ``multipliers`` of its rows, (rows, points): its
    rows, (rows, points), the Jacobian of these by z, point by point, and the Hessian by z of their
    sum times the multipliers. Of those by y each point has a block on the diagonal."""
    n, layout = points.number, points.layout.matrix(z.numel())
    y = ca.reshape(ca.mtimes(layout, z), -1, n)
    ps = ca.repmat(p[points.function.own], 1, n)
    (jacobian, J_sparsity), (hessian, H_sparsity) = points.function.derivatives
    r, J = jacobian.map(n)(y, ps)
    H = hessian.map(n)(y, ps, multipliers)
    by_y, twice_by_y = (
        ca.MX(ca.diagcat(*[sparsity] * n), ca.vec(nonzeros))
        for sparsity, nonzeros in ((J_sparsity, J), (H_sparsity, H))
    )
    return r, ca.mtimes(by_y, layout), ca.mtimes([layout.T, twice_by_y, layout])
