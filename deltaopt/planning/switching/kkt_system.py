"""Newton's equations for the conditions of optimality of a switching structure.

The accelerations A and multipliers λ of an interval meet only the interval's own ends and length.
They are eliminated interval by interval (static condensation), and what is left, states and
costates at the knots, lengths of arcs and a few numbers more, is one dense system of about a
hundred unknowns.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from deltaopt.codegen.dense_solver import solve
from deltaopt.curves.piecewise import Array
from deltaopt.planning.switching.conditions import OptimalityConditions
from deltaopt.planning.switching.kkt_terms import BarrierTerms, Derivatives, Dual, Primal
from deltaopt.planning.switching.unknowns import PrimalDualPoint

_REGULARISATION = 1e-9
"""Cost of the square of a singular control: of motions that are equally fast the calmest is chosen.
A larger one costs duration, a smaller one leaves the system singular where a control has no
effect on the duration."""
_INSIDE = 0.995
"""Part of the way to the boundary that a step may go, of slacks and multipliers (as is usual in
interior-point methods): more risks steps that are stopped short afterwards, less is slower."""
_REDUNDANT = 1e-10
"""Shift of the diagonal of the costates, for rows that imply each other by symmetry: a larger one
makes steps less accurate, without it the matrix is singular there."""


class KKTSystem:
    """Newton's equations at a point, linearised once.

    An interval's own unknowns are (A, λ), 2 m nodes; its border consists of (X_i, V_i, h, p_{i+1}),
    4 m + 1, the right-hand side, and the coefficients of singular controls of its arc.
    """

    _removed = 1.0
    """Part of the primal violations that a step is to remove."""

    def __init__(self, of: OptimalityConditions, at: PrimalDualPoint, barrier: float = 0.0) -> None:
        """``barrier``: slack times multiplier, per time."""
        self.of, self.at = of, at
        self._rows = Derivatives(of, at)
        self._y_slopes = self._node_slopes()
        self._barrier = BarrierTerms(self._rows, barrier)
        self._primal = Primal(self._rows)
        self._dual = Dual(self._rows, self._barrier, self._y_slopes)

    @property
    def costates(self) -> Array:
        """p where the intervals begin, after the entry conditions there, (n, 2 m)."""
        first: Array = self._dual.own[:, : self.of.index.states].copy()
        rows = zip(self.of.active.entries, self.at.entry, self._primal.entry_slopes, strict=True)
        for entry, nu, slope in rows:
            first[self.of.mesh.first[entry.arc]] -= nu * slope
        return first

    @property
    def hamiltonian(self) -> Array:
        """p · (V, A) at the beginning and the end of every interval, (n, 2)."""
        y, m = self.at.at_nodes(self.of.mesh), self.of.rows.motors
        ends = [
            (y[:, 0, m:] * self.costates).sum(axis=1),
            (y[:, -1, m:] * self.at.costates).sum(axis=1),
        ]
        return np.stack(ends, axis=1)

    @property
    def residual(self) -> float:
        """Largest violation of an active row, an entry condition or continuity, or largest
        derivative of the Lagrangian; all are of the order of one."""
        mesh, at, own = self.of.mesh, self.at, self.of.index.own
        by_h = self._dual.own[:, own - 1] / mesh.parts[mesh.arc]
        by_state = self._dual.own[1:, : own - 1] - at.costates[:-1]
        parts = [self._primal.values, self._primal.continuity, self._primal.entries]
        by_length = np.asarray(1.0 + np.bincount(mesh.arc, by_h), np.float64)
        parts += [by_length, by_state, self._barrier.off]
        parts += [self._dual.own[:, own:], *self._by_coefficients(), self._off_end_values()]
        return float(max(np.abs(part).max(initial=0.0) for part in parts))

    def _by_coefficients(self) -> list[Array]:
        """Derivatives of the Lagrangian by the coefficients of each singular control."""
        slopes, arc = [], self.of.mesh.arc
        for (a, k), apart in zip(self.of.active.singular, self._outside_intervals(), strict=True):
            in_intervals = self._dual.singular[arc == a, k].sum(axis=0)
            slopes.append(in_intervals[: len(apart)] + apart)
        return slopes

    def _outside_intervals(self) -> list[Array]:
        """The part of these derivatives that does not come from intervals."""
        of, slopes = self.of, []
        for a, k in of.active.singular:
            modes = np.arange(of.mesh.modes[a])
            slope = _REGULARISATION * self.at.singular[a, k, modes] / (2 * modes + 1)
            for end, multiplier in zip(of.end_values, self.at.end_values, strict=True):
                if (end.arc, end.motor) == (a, k):
                    slope += multiplier * end.legendre(len(modes))
            slopes.append(slope)
        return slopes

    def _off_end_values(self) -> Array:
        """By how much singular controls differ from their given end values."""
        of, off = self.of, []
        for end in of.end_values:
            modes = int(of.mesh.modes[end.arc])
            own = self.at.singular[end.arc, end.motor, :modes]
            off.append(end.legendre(modes) @ own - end.value)
        return np.array(off, dtype=float)

    def _node_slopes(self) -> Array:
        """Derivatives of y at the nodes by (X_i, V_i, h, A), (n, nodes, 3 m, 2 m + 1 + m nodes)."""
        mesh, at, m = self.of.mesh, self.at, self.of.rows.motors
        n, k, own = mesh.intervals, len(mesh.polynomials.nodes), self.of.index.own
        position, velocity, _ = mesh.polynomials.at_nodes
        h = at.interval_lengths(mesh)
        slopes = np.zeros((n, k, 3 * m, own + m * k))
        by_A = np.zeros((n, k, 3 * m, k, m))
        for j in range(m):
            slopes[:, :, j, j] = slopes[:, :, m + j, m + j] = 1.0
            slopes[:, :, j, m + j] = h[:, None] * mesh.polynomials.nodes
            by_A[:, :, j, :, j] = h[:, None, None] ** 2 * position
            by_A[:, :, m + j, :, j] = h[:, None, None] * velocity
            by_A[:, :, 2 * m + j, :, j] = np.eye(k)
        slopes[..., own:] = by_A.reshape(n, k, 3 * m, -1)
        V, at_h = at.knots[:-1, None, m:], own - 1
        by_h = mesh.polynomials.nodes[:, None] * V + 2 * h[:, None, None] * (position @ at.A)
        slopes[:, :, :m, at_h], slopes[:, :, m : 2 * m, at_h] = by_h, velocity @ at.A
        return slopes

    def _curvature(self) -> Array:
        """Second derivatives of the Lagrangian by (X_i, V_i, h, A), (n, own + m nodes, same)."""
        mesh, at, m, own = self.of.mesh, self.at, self.of.rows.motors, self.of.index.own
        n, k = mesh.intervals, len(mesh.polynomials.nodes)
        H = self._rows.H
        if self.of.within[..., m:].any():
            slopes = self._rows.bounded
            stiff = self._barrier.stiffness[..., m:, None] * slopes
            H = H + slopes.transpose(0, 1, 3, 2) @ stiff
        flat = self._y_slopes.reshape(n, 3 * m * k, -1)
        total = flat.transpose(0, 2, 1) @ (H @ self._y_slopes).reshape(n, 3 * m * k, -1)
        # y is bilinear too: products of h with V and A
        position, velocity, _ = mesh.polynomials.at_nodes
        by_y, h, at_h = self._dual.by_y, at.interval_lengths(mesh), own - 1
        by_V = np.einsum("nka,k->na", by_y[..., :m], mesh.polynomials.nodes)
        pulled = position.T @ by_y[..., :m]
        by_A = 2 * h[:, None, None] * pulled + velocity.T @ by_y[..., m : 2 * m]
        total[:, m:at_h, at_h] += by_V
        total[:, at_h, m:at_h] += by_V
        total[:, at_h, at_h] += 2 * np.einsum("nja,nja->n", pulled, at.A)
        total[:, own:, at_h] += by_A.reshape(n, -1)
        total[:, at_h, own:] += by_A.reshape(n, -1)
        return np.asarray(total)

    @cached_property
    def _condensed(self) -> tuple[Array, Array]:
        """Static condensation: (A, λ) by the border, (n, 2 m nodes, width), and what is left of the
        interval's equations, (n, width, width)."""
        index, Q = self.of.index, self._curvature()
        own, right = index.own, index.right
        n, unknowns = len(Q), Q.shape[1] - own
        slopes = (self._primal.value_slopes @ self._y_slopes).reshape(n, unknowns, -1)
        by_A = np.zeros((n, unknowns, index.width))  # derivatives by A, of the border
        by_A[:, :, :own] = Q[:, own:, :own]
        by_A[:, :, own:right] = self._y_slopes[:, -1, : own - 1, own:].transpose(0, 2, 1)
        by_A[:, :, right] = self._dual.own_aim[:, own:]
        active = np.zeros((n, unknowns, index.width))  # the active rows, of the border
        active[:, :, :own] = slopes[:, :, :own]
        active[:, :, right] = self._removed * self._primal.values.reshape(n, -1)
        if index.coefficients:
            active[:, :, right + 1 :] = self._control_columns()
        inverse = np.linalg.inv(slopes[:, :, own:])  # A by the active rows, then λ by A
        A = inverse @ active
        multipliers = inverse.transpose(0, 2, 1) @ (by_A - Q[:, own:, own:] @ A)
        left = self._border(Q) - by_A.transpose(0, 2, 1) @ A
        left -= active.transpose(0, 2, 1) @ multipliers
        return np.concatenate([A, multipliers], axis=1), left

    def _control_columns(self) -> Array:
        """Derivatives of the active rows by coefficients of singular controls, (n, m nodes, ·)."""
        own = np.eye(self.of.rows.motors)
        columns = np.einsum("nkl,ij->nkijl", -self.of.mesh.legendre, own)
        return np.asarray(columns.reshape(len(columns), -1, self.of.index.coefficients))

    def _border(self, Q: Array) -> Array:
        """Second derivatives by the border alone, and its right-hand side, (n, width, width)."""
        index, end = self.of.index, self._y_slopes[:, -1, : self.of.index.states]
        own, right = index.own, index.right
        M = np.zeros((len(Q), index.width, index.width))
        M[:, :own, :own] = Q[:, :own, :own]
        M[:, own:right, :own] = end[:, :, :own]
        M[:, :own, own:right] = end[:, :, :own].transpose(0, 2, 1)
        M[:, :own, right] = self._dual.own_aim[:, :own]
        M[:, own:right, right] = self._removed * self._primal.continuity
        if index.coefficients:
            M[:, right + 1 :, right] = self._dual.singular_aim.reshape(len(Q), -1)
            self._add_stiffness(M)
        return M

    def _add_stiffness(self, M: Array) -> None:
        """Second derivatives that the barrier adds by coefficients of singular controls."""
        mesh, m, most = self.of.mesh, self.of.rows.motors, self.of.mesh.most_modes
        own = self._barrier.stiffness[..., :m]
        stiffness = np.einsum("nkl,nkr,nkm->nrlm", mesh.legendre, own, mesh.legendre)
        for j in range(m):
            at = slice(self.of.index.right + 1 + j * most, self.of.index.right + 1 + (j + 1) * most)
            M[:, at, at] += stiffness[:, j]

    def step(self, shift: float = 0.0, redundant: float = _REDUNDANT) -> PrimalDualPoint | None:
        """Newton's step, shortened by a ``shift`` of the curvature; None if the matrix is singular.

        Where rows imply each other by symmetry costates stay where they are, the more so the
        larger ``redundant`` is.
        """
        try:
            matrix, right = self._assembled(shift, redundant)
        except np.linalg.LinAlgError:  # of an interval
            return None
        x = solve(matrix, -right)
        return None if x is None else self._expanded(x)

    def _assembled(self, shift: float, redundant: float) -> tuple[Array, Array]:
        """The condensed system: matrix and right-hand side, in the order of the KKT index."""
        of, at, index = self.of, self.at, self.of.index
        S, right = index.summed(self._condensed[1])
        here, there = index.inner_states, index.costates[:-1]
        S[here, there] -= 1.0  # an interval's end is the next one's beginning
        S[there, here] -= 1.0
        right[here] -= at.costates[:-1]
        right[index.lengths] += 1.0
        S[index.lengths, index.lengths] += shift
        for places, slope in zip(index.singular, self._outside_intervals(), strict=True):
            regularisation = _REGULARISATION / (2 * np.arange(len(places)) + 1)
            S[places, places] += regularisation + shift
            right[places] += slope
        for j, (entry, slope) in enumerate(
            zip(of.active.entries, self._primal.entry_slopes, strict=True)
        ):
            state, place = index.state(int(of.mesh.first[entry.arc])), index.entries[j]
            S[state, place] += slope
            S[place, state] += slope
            right[place] = self._removed * self._primal.entries[j]
        for j, (end, off) in enumerate(zip(of.end_values, self._off_end_values(), strict=True)):
            places = index.singular[of.active.singular.index((end.arc, end.motor))]
            place = index.end_values[j]
            S[places, place] = S[place, places] = end.legendre(len(places))
            right[place] = self._removed * off
        S[index.duals, index.duals] -= redundant
        return S[: index.size, : index.size], right[: index.size]

    def _expanded(self, x: Array) -> PrimalDualPoint:
        """The step of all unknowns from that of the condensed system, (size,)."""
        of, at, index = self.of, self.at, self.of.index
        n, states = of.mesh.intervals, index.states
        knots, singular = np.zeros((n + 1, states)), np.zeros_like(at.singular)
        knots[1:-1] = x[index.inner_states]
        costates = x[index.costates]
        for (a, k), places in zip(of.active.singular, index.singular, strict=True):
            singular[a, k, : len(places)] = x[places]
        h = of.mesh.interval_lengths(x[index.lengths])
        border = [knots[:-1], h[:, None], costates, np.ones((n, 1))]
        if of.active.singular:
            border.append(singular[of.mesh.arc].reshape(n, -1))
        own = -(self._condensed[0] @ np.hstack(border)[..., None])[..., 0]
        A, multipliers = own.reshape(n, 2, *at.A.shape[1:]).transpose(1, 0, 2, 3)
        by_own = np.concatenate([knots[:-1], h[:, None], A.reshape(n, -1)], axis=1)
        dy = (self._y_slopes @ by_own[:, None, :, None])[..., 0]
        slack, upper, lower = self._barrier_step(of.mesh.singular_controls(singular), dy)
        return PrimalDualPoint(
            knots=knots,
            A=A,
            lengths=x[index.lengths],
            costates=costates,
            multipliers=multipliers,
            entry=x[index.entries],
            singular=singular,
            end_values=x[index.end_values],
            slack=slack,
            upper=upper,
            lower=lower,
        )

    def _barrier_step(self, singular: Array, dy: Array) -> tuple[Array, Array, Array]:
        """Steps of slacks and of upper and lower multipliers, from those of singular controls and
        of y at the nodes."""
        at, b = self.at, self._barrier
        moved = [singular, np.einsum("nkra,nka->nkr", self._rows.bounded, dy)]
        slack = np.where(self.of.within, b.off + np.concatenate(moved, axis=2), 0.0)
        upper = (b.mu + at.upper * slack) / (1 - at.slack) - at.upper
        lower = (b.mu - at.lower * slack) / (1 + at.slack) - at.lower
        return slack, upper, lower

    def inside(self, step: PrimalDualPoint) -> float:
        """The part of a step, at most 1, that keeps slacks within ±1 and multipliers positive."""
        at, least = self.at, 1.0
        for now, by in ((1 - at.slack, -step.slack), (1 + at.slack, step.slack)):
            least = min(least, _INSIDE / max(float((-by / now).max()), 1e-300))
        for now, by in ((at.upper, step.upper), (at.lower, step.lower)):
            shrink = np.where(now > 0, -by / np.where(now > 0, now, 1.0), 0.0)
            least = min(least, _INSIDE / max(float(shrink.max()), 1e-300))
        return least
