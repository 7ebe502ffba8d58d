"""What happens at a point of a motion, for the interior-point method: symbolic expressions of the
equations of motion and of limits, and their derivatives with torques still apart."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca

from deltaopt.codegen.vectorised import dense_function
from deltaopt.limits.constraints import Alike

Entries = dict[tuple[int, int], str]
"""The nonzeros of a sparse matrix: their C text, by row and column."""


@dataclass(frozen=True)
class PointFunctions:
    """Of all rows but those that are alike, in place of which there are zeros.

    ``prepare``: p -> q, parameters and what depends on them alone, but for those of each interval's
    own. ``values``: (y, q) -> rows, T running, and e: tau and the inverse of -∂force/∂tau by
    columns. ``second``: (y, e, w, q) -> the nonzeros of the matrices that follow, by columns; w:
    weights of rows and of T running.

    Matrices: derivatives of the equations of motion by y; of rows and T running by y and by tau;
    of the weighted sum with the equations' adjoint by y twice (the upper triangle), by tau and y,
    and by tau twice; y and tau being independent.
    """

    prepare: ca.Function
    values: ca.Function
    second: ca.Function
    force_by_y: Entries
    rows_by_y: Entries
    rows_by_tau: Entries
    twice_by_y: Entries
    by_tau_and_y: Entries
    twice_by_tau: Entries


@dataclass(frozen=True, eq=False)
class PointProblem:
    """Equations of motion, constraint rows and a running cost at a point, as symbolic expressions.

    ``y``: X, V, A (and J), ``coordinates`` each, then T, the duration of the phase: position and
    its derivatives by time in units of T, (coordinates * (derivatives + 1) + 1,).
    ``derivatives``: unknowns of each coordinate at a knot: 2 for cubics between knots, 3 for three
    cubics between them, whose acceleration is continuous.
    ``tau``: what the equations ``force`` = 0, as many and affine in them, determine; it is
    eliminated from all rows and from their derivatives.
    ``rows``: at most 1, at least -1, or both, as ``sides`` says of each: whether there is an upper
    limit, and a lower one. They may be nonlinear in tau.
    ``running``: the rate l of a running cost, any function of y, tau and p; none without one. What
    is minimised is then a weight times the duration plus another times the integral of l over it.
    ``p``: parameters, which may differ from phase to phase.
    ``saturating``, ``strengths``: of parts of tau, strength · tanh (u) each, the quantity u, a
    function of y, and the strength, a function of p, (tau,) each; none without such parts. Of their
    curvature the method takes what makes the sum of weighted rows convex: where tanh bends within
    one step of an interval, the rest would ask for shifts of the Hessian that make steps short.
    ``covers``: second derivatives of the rows by each u other than by tau, (rows, u); none where
    there are no such.
    ``own``: those of the parameters that each interval has of its own, next to each other in p.
    ``straight``: of how many of the last equations the method takes no curvature, as of rates of
    torques: that would be three quarters of the program, and saves no iteration.
    ``alike``: which rows are one function of X each, whose numbers are so many of p: it is derived
    and compiled once for all of them. The method takes no curvature of them: they are distances
    from convex bodies, beside which motions are drawn tight, and their curvature makes the Hessian
    indefinite; shifts that mend that make steps short. Without it a step keeps off a body's tangent
    plane, and so off the body.
    """

    coordinates: int
    derivatives: int
    y: ca.SX
    tau: ca.SX
    p: ca.SX
    force: ca.SX
    rows: ca.SX
    sides: tuple[tuple[bool, bool], ...]
    running: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    saturating: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    strengths: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    covers: ca.SX = field(default_factory=lambda: ca.SX(0, 0))
    own: ca.SX = field(default_factory=lambda: ca.SX(0, 1))
    straight: int = 0
    alike: tuple[Alike, ...] = ()

    def __post_init__(self) -> None:
        """Raises ValueError where sizes do not agree or the equations are not affine in tau."""
        if self.derivatives not in (2, 3):
            raise ValueError(f"knots carry 2 or 3 derivatives, not {self.derivatives}")
        if self.y.numel() != self.coordinates * (self.derivatives + 1) + 1:
            raise ValueError(f"y has {self.y.numel()} components")
        if self.force.numel() != self.tau.numel():
            raise ValueError(f"{self.force.numel()} equations for {self.tau.numel()} unknowns")
        if self.running.numel() > 1:
            raise ValueError(f"{self.running.numel()} running costs; their sum is one")
        if len(self.sides) != self.rows.numel():
            raise ValueError(f"sides of {len(self.sides)} rows, there are {self.rows.numel()}")
        if self.tau.numel() and any(ca.which_depends(self.force, self.tau, 2, True)):
            raise ValueError("the equations of motion are not affine in tau")

    @property
    def unknowns(self) -> int:
        """Unknowns at a knot."""
        return self.coordinates * self.derivatives

    @property
    def place_of_own(self) -> int:
        """Where in p the parameters of each interval's own begin."""
        names = [str(self.p[k]) for k in range(self.p.numel())]
        return names.index(str(self.own[0])) if self.own.numel() else 0

    @cached_property
    def functions(self) -> PointFunctions:
        """The expressions and their derivatives as functions of numbers.

        What depends on parameters alone is found once in a phase instead of at every point.
        """
        inverse = _inverse(-ca.jacobian(self.force, self.tau))
        tau = inverse @ ca.substitute(self.force, self.tau, ca.SX.zeros(self.tau.numel()))
        results = ca.substitute([self._others, self._integrand], [self.tau], [tau])
        results.append(ca.vertcat(tau, ca.vec(inverse)))
        arguments, matrices = self._partial_derivatives()
        nonzeros = [ca.vec(matrix.nz[:]) for matrix in matrices]
        at, end = self.place_of_own, self.place_of_own + self.own.numel()
        shared = ca.vertcat(self.p[:at], self.p[end:]) if end > at else self.p
        reduced, symbols, parametric = ca.extract_parametric([*results, *nonzeros], shared)
        q = ca.vertcat(self.p, *symbols)
        return PointFunctions(
            dense_function("prepare", [self.p], [ca.vertcat(self.p, *parametric)]),
            dense_function("values", [self.y, q], reduced[: len(results)]),
            dense_function("second_by_parts", [*arguments, q], reduced[len(results) :]),
            *(_entries(f"m{k}", matrix) for k, matrix in enumerate(matrices)),
        )

    def _partial_derivatives(self) -> tuple[list[ca.SX], list[ca.SX]]:
        """y, e, w; and the matrices of `PointFunctions`."""
        y, tau = self.y, self.tau
        inverse = ca.SX.sym("inverse", tau.numel(), tau.numel())
        nu = ca.SX.sym("nu", tau.numel())
        w = ca.SX.sym("w", self.rows.numel() + self._integrand.numel())
        c = ca.vertcat(self._others, self._integrand)
        adjoint = inverse.T @ ca.gradient(ca.dot(w, c), tau)
        curved = tau.numel() - self.straight
        lagrangian = ca.dot(ca.vertcat(nu[:curved], w), ca.vertcat(self.force[:curved], c))
        matrices = [
            ca.jacobian(self.force, y),
            ca.jacobian(c, y),
            ca.jacobian(c, tau),
            ca.triu(ca.hessian(lagrangian, y)[0] - self._concave(ca.dot(w, c), w)),
            ca.jacobian(ca.gradient(lagrangian, y), tau).T,
            ca.hessian(lagrangian, tau)[0],
        ]
        matrices = [ca.sparsify(ca.substitute(matrix, nu, adjoint)) for matrix in matrices]
        return [y, ca.vertcat(tau, ca.vec(inverse)), w], matrices

    def _concave(self, weighted: ca.SX, w: ca.SX) -> ca.SX:
        """The part of the Hessian by y of weighted rows that is left out: see ``saturating``."""
        left_out = ca.SX(self.y.numel(), self.y.numel())
        slopes = ca.gradient(weighted, self.tau)
        for k in range(self.saturating.numel()):
            u = self.saturating[k]
            bending = -2 * ca.tanh(u) * (1 - ca.tanh(u) ** 2)
            along = ca.gradient(u, self.y)
            bent = slopes[k % self.coordinates] * self.strengths[k] * bending
            if self.covers.numel():
                bent += ca.dot(w[: self.rows.numel()], self.covers[:, k])
            left_out += ca.fmin(bent, 0) * (along @ along.T)
        return left_out

    @property
    def _others(self) -> ca.SX:
        """The rows, 0 in place of those that are alike."""
        rows = ca.SX(self.rows)
        for alike in self.alike:
            rows[list(alike.rows)] = 0
        return rows

    @property
    def _integrand(self) -> ca.SX:
        """The rate of the running cost, if there is one, by the share of a phase's duration."""
        return self.y[-1] * self.running


def _inverse(B: ca.SX) -> ca.SX:
    """Of a matrix of expressions; by cofactors up to 3 x 3, with a single division; of a larger
    one with zeros above the diagonal of its quarters, by these."""
    n, half = B.shape[0], B.shape[0] // 2
    if n == 0:
        return ca.SX(0, 0)
    if n > 3 and B[:half, half:].nnz() == 0:
        above, below = _inverse(B[:half, :half]), _inverse(B[half:, half:])
        mixed = -below @ B[half:, :half] @ above
        return ca.blockcat([[above, ca.SX(half, n - half)], [mixed, below]])
    if n > 3:
        return ca.inv(B)
    adjugate = ca.SX.ones(n, n)
    for i in range(n):
        for j in range(n):
            if n == 2:
                adjugate[i, j] = B[1 - i, 1 - j] if i == j else -B[i, j]
            if n == 3:  # indices in cyclic order, so that no sign changes
                down, right = [(j + 1) % 3, (j + 2) % 3], [(i + 1) % 3, (i + 2) % 3]
                adjugate[i, j] = (
                    B[down[0], right[0]] * B[down[1], right[1]]
                    - B[down[0], right[1]] * B[down[1], right[0]]
                )
    return adjugate * (1 / (B[0, :] @ adjugate[:, 0]))


def _entries(name: str, matrix: ca.SX) -> Entries:
    """Of a C array of a matrix's nonzeros by columns; ones as such."""
    nonzeros = matrix.nz[:]
    places = zip(*matrix.sparsity().get_triplet(), strict=True)
    return {
        place: "1" if nonzeros[k].is_one() else f"{name}[{k}]" for k, place in enumerate(places)
    }
