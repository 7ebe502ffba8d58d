"""Newton's equations for the conditions of ``extremal``.

A and λ of an interval meet nothing but its own ends and length: they are eliminated interval
by interval, and what is left, states and costates at the knots, lengths of arcs and a few
numbers more, is one small dense system.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.switching.arc_mesh import Grid
from deltaopt.planning.switching.dense import solve

if TYPE_CHECKING:
    from deltaopt.planning.switching.conditions import Conditions

Array = NDArray[np.float64]
Integers = NDArray[np.intp]

_CALM = 1e-9
"""Cost of torque without limit: of motions that are equally fast the calmest."""


@dataclass(frozen=True)
class Extremal:
    """Unknowns of the system, scaled, where they stand; or a step of them.

    ``knots``: (X, V), (n + 1, 6). ``A``: (n, nodes, 3). ``lengths``: of the arcs. ``costates``:
    p at the ends of the intervals, (n, 6). ``multipliers``: λ, (n, nodes, 3). ``entry``: ν.
    ``free``: w, Legendre's coefficients of torques without limit, (arcs, 3, most modes).
    ``pins``: multipliers of pins. ``slack``, ``upper``, ``lower``: of what is kept within ±1 at
    the nodes, torques that are polynomials, other torques and speeds, (n, nodes, 9): copies
    strictly inside, and their limits' multipliers.
    """

    knots: Array
    A: Array
    lengths: Array
    costates: Array
    multipliers: Array
    entry: Array
    free: Array
    pins: Array
    slack: Array
    upper: Array
    lower: Array

    def __add__(self, step: Extremal) -> Extremal:
        names = (field.name for field in fields(self))
        return Extremal(*(getattr(self, name) + getattr(step, name) for name in names))

    def times(self, share: float) -> Extremal:
        """A part of a step."""
        return Extremal(*(share * getattr(self, field.name) for field in fields(self)))

    @property
    def duration(self) -> float:
        """In units of the scales' time."""
        return float(self.lengths.sum())

    @property
    def largest(self) -> float:
        """Of a step: of states, lengths and torques; infinite if it is no number."""
        parts = (self.knots, self.lengths, self.free / 3)
        largest = float(max(np.abs(part).max(initial=0.0) for part in parts))
        return largest if np.isfinite(largest) else np.inf

    def intervals(self, grid: Grid) -> Array:
        """Lengths of the intervals, (n,)."""
        return grid.intervals_of(self.lengths)

    def at_nodes(self, grid: Grid) -> Array:
        """y = (X, V, A) at the nodes, (n, nodes, 9)."""
        return self.at(grid, grid.nodes, grid.at_nodes)

    def at(self, grid: Grid, c: Array, weights: tuple[Array, Array, Array]) -> Array:
        """y at fractions c of the intervals, (n, c, 9), by the weights of A there."""
        h = self.intervals(grid)[:, None, None]
        position, velocity, acceleration = (weight @ self.A for weight in weights)
        X, V = self.knots[:-1, None, :3], self.knots[:-1, None, 3:]
        x = X + h * c[:, None] * V + h**2 * position
        return np.concatenate([x, V + h * velocity, acceleration], axis=2)


class System:
    """Newton's equations at a motion.

    An interval's own unknowns are (A, λ), 6 nodes; outside of it there are (X_i, V_i, h,
    p_{i+1}), 13, then 1 for the right-hand side, then w of its arc.
    """

    def __init__(
        self, of: Conditions, at: Extremal, barrier: float = 0.0, *, least_squares: bool = False
    ) -> None:
        """``barrier``: slack times multiplier, per time. ``least_squares``: for a step of the
        multipliers to those of least squares."""
        self.of, self.at, self._least_squares = of, at, least_squares
        grid, held = of.grid, of.held
        n, k, rows = grid.intervals, len(grid.nodes), of.stage.rows
        which = np.broadcast_to(held.row[grid.arc][:, None], (n, k, 3))
        weights = np.zeros((n, k, rows))
        np.put_along_axis(weights, which, at.multipliers, axis=2)
        for entry, nu in zip(held.entries, at.entry, strict=True):
            weights[grid.first[entry.arc], 0, entry.row] += nu
        within, others = of.within, of.others
        y_within = at.upper - at.lower
        bent = weights.copy()
        bent[..., others] += y_within[..., 3:]
        y = at.at_nodes(grid)
        r, J, H = of.stage.derivatives(y.reshape(-1, 9), bent.reshape(-1, rows), of.p)
        r, J, H = r.reshape(n, k, rows), J.reshape(n, k, rows, 9), H.reshape(n, k, 9, 9)
        torques = grid.torques(at.free)
        wanted = torques + held.value[grid.arc][:, None]
        self._differ = np.take_along_axis(r, which, axis=2) - wanted
        self._gaps = y[:, -1, :6] - np.vstack([at.knots[1:-1], of.goal])
        self._entries = np.array(
            [r[grid.first[e.arc], 0, e.row] - e.value for e in held.entries], dtype=float
        )
        self._entry_slopes = [J[grid.first[e.arc], 0, e.row, :6] for e in held.entries]
        c = np.where(within, np.concatenate([torques, r[..., others]], axis=2), 0.0)
        self._off = np.where(within, c - at.slack, 0.0)
        above, below = (np.maximum(1 + s * at.slack, 1e-300) for s in (-1, 1))
        self._mu = (
            barrier * np.abs(at.intervals(grid))[:, None, None] * grid.quadrature[:, None] * within
        )
        self._stiff = at.upper / above + at.lower / below
        q = self._stiff * self._off + self._mu / above - self._mu / below
        self._other_slopes = J[:, :, others]
        if within[..., 3:].any():
            slopes = self._other_slopes
            H = H + slopes.transpose(0, 1, 3, 2) @ (self._stiff[..., 3:, None] * slopes)
        m = np.einsum("nkr,nkra->nka", bent, J)
        m[:, -1, :6] += at.costates
        self._m, self._H = m, H
        self._held_slopes = np.take_along_axis(J, which[..., None], axis=2)
        self._slopes = self._of_nodes()
        self._gradient = (m.reshape(n, 1, -1) @ self._slopes.reshape(n, 9 * k, -1))[:, 0]
        aim = q - y_within  # multipliers to come less those there are
        m_aim = np.einsum("nkr,nkra->nka", aim[..., 3:], self._other_slopes)
        self._gradient_aim = (m_aim.reshape(n, 1, -1) @ self._slopes.reshape(n, 9 * k, -1))[:, 0]
        pull = y_within[..., :3] - at.multipliers
        self._by_free = np.einsum("nkr,nkl->nrl", pull, grid.shapes)
        self._by_free_aim = np.einsum("nkr,nkl->nrl", aim[..., :3], grid.shapes)

    @property
    def costates(self) -> Array:
        """p where the intervals begin, after what enters there, (n, 6)."""
        first: Array = self._gradient[:, :6].copy()
        rows = zip(self.of.held.entries, self.at.entry, self._entry_slopes, strict=True)
        for entry, nu, slope in rows:
            first[self.of.grid.first[entry.arc]] -= nu * slope
        return first

    @property
    def residual(self) -> float:
        """Largest violation of what is held or continuous, or derivative of the Lagrangian."""
        grid, at = self.of.grid, self.at
        by_length = 1.0 + np.bincount(grid.arc, self._gradient[:, 6] / grid.parts[grid.arc])
        by_state = self._gradient[1:, :6] - at.costates[:-1]
        parts = [self._differ, self._gaps, self._entries, by_length, by_state, self._off]
        parts += [self._gradient[:, 7:], *self._by_modes(), self._off_pins()]
        return float(max(np.abs(part).max(initial=0.0) for part in parts))

    def _by_modes(self) -> list[Array]:
        """Derivatives by the modes of each torque without limit."""
        of, slopes = self.of, []
        for (a, k), own in zip(of.held.free, self._by_modes_alone(), strict=True):
            in_intervals = self._by_free[of.grid.arc == a, k].sum(axis=0)
            slopes.append(in_intervals[: len(own)] + own)
        return slopes

    def _by_modes_alone(self) -> list[Array]:
        """The part of it that no interval knows of."""
        of, slopes = self.of, []
        for a, k in of.held.free:
            modes = np.arange(of.grid.modes[a])
            slope = _CALM * self.at.free[a, k, modes] / (2 * modes + 1)
            for pin, pi in zip(of.pins, self.at.pins, strict=True):
                if (pin.arc, pin.motor) == (a, k):
                    slope += pi * pin.shapes(len(modes))
            slopes.append(slope)
        return slopes

    def _off_pins(self) -> Array:
        of, free = self.of, self.at.free
        number = [int(of.grid.modes[pin.arc]) for pin in of.pins]
        return np.array(
            [
                pin.shapes(modes) @ free[pin.arc, pin.motor, :modes] - pin.value
                for pin, modes in zip(of.pins, number, strict=True)
            ],
            dtype=float,
        )

    def _of_nodes(self) -> Array:
        """Derivatives of y by (X_i, V_i, h, A), (n, nodes, 9, 7 + 3 nodes)."""
        grid, at = self.of.grid, self.at
        n, k = grid.intervals, len(grid.nodes)
        position, velocity, _ = grid.at_nodes
        h = at.intervals(grid)
        slopes = np.zeros((n, k, 9, 7 + 3 * k))
        by_A = np.zeros((n, k, 9, k, 3))
        for j in range(3):
            slopes[:, :, j, j] = slopes[:, :, 3 + j, 3 + j] = 1.0
            slopes[:, :, j, 3 + j] = h[:, None] * grid.nodes
            by_A[:, :, j, :, j] = h[:, None, None] ** 2 * position
            by_A[:, :, 3 + j, :, j] = h[:, None, None] * velocity
            by_A[:, :, 6 + j, :, j] = np.eye(k)
        slopes[..., 7:] = by_A.reshape(n, k, 9, -1)
        V = at.knots[:-1, None, 3:]
        slopes[:, :, :3, 6] = grid.nodes[:, None] * V + 2 * h[:, None, None] * (position @ at.A)
        slopes[:, :, 3:6, 6] = velocity @ at.A
        return slopes

    def _curvature(self) -> Array:
        """Of the Lagrangian by (X_i, V_i, h, A), (n, 7 + 3 nodes, 7 + 3 nodes)."""
        grid, at = self.of.grid, self.at
        n, k = grid.intervals, len(grid.nodes)
        if self._least_squares:
            return np.broadcast_to(np.eye(7 + 3 * k), (n, 7 + 3 * k, 7 + 3 * k))
        flat = self._slopes.reshape(n, 9 * k, -1)
        total = flat.transpose(0, 2, 1) @ (self._H @ self._slopes).reshape(n, 9 * k, -1)
        position, velocity, _ = grid.at_nodes  # y itself is bent: products of h with V and A
        m, h = self._m, at.intervals(grid)
        by_V = np.einsum("nka,k->na", m[..., :3], grid.nodes)
        pulled = position.T @ m[..., :3]
        by_A = (2 * h[:, None, None] * pulled + velocity.T @ m[..., 3:6]).reshape(n, -1)
        total[:, 3:6, 6] += by_V
        total[:, 6, 3:6] += by_V
        total[:, 6, 6] += 2 * np.einsum("nja,nja->n", pulled, at.A)
        total[:, 7:, 6] += by_A
        total[:, 6, 7:] += by_A
        return np.asarray(total)

    @cached_property
    def _condensed(self) -> tuple[Array, Array]:
        """(A, λ) by what is outside, (n, 6 nodes, 14 + w), and what is left, (n, 14 + w, 14 + w),
        both with the right-hand side as column 13."""
        grid, Q, slopes = self.of.grid, self._curvature(), self._slopes
        n, k = grid.intervals, len(grid.nodes)
        d, end, most = 3 * k, slopes[:, -1, :6], grid.most_modes
        modes = 3 * most if self.of.held.free else 0
        G = (self._held_slopes @ slopes).reshape(n, d, -1)
        gradient = self._gradient + (0.0 if self._least_squares else self._gradient_aim)
        right = 0.0 if self._least_squares else 1.0
        by_A = np.zeros((n, d, 14 + modes))  # derivatives by A; by λ below
        by_A[:, :, :7] = Q[:, 7:, :7]
        by_A[:, :, 7:13] = end[:, :, 7:].transpose(0, 2, 1)
        by_A[:, :, 13] = gradient[:, 7:]
        held = np.zeros((n, d, 14 + modes))
        held[:, :, :7] = G[:, :, :7]
        held[:, :, 13] = right * self._differ.reshape(n, -1)
        M = np.zeros((n, 14 + modes, 14 + modes))
        M[:, :7, :7] = Q[:, :7, :7]
        M[:, 7:13, :7] = end[:, :, :7]
        M[:, :7, 7:13] = end[:, :, :7].transpose(0, 2, 1)
        M[:, :7, 13] = gradient[:, :7]
        M[:, 7:13, 13] = right * self._gaps
        if modes:
            by_free = np.zeros((n, k, 3, 3, most))
            for j in range(3):
                by_free[:, :, j, j] = -grid.shapes
            held[:, :, 14:] = by_free.reshape(n, d, -1)
            M[:, 14:, 13] = self._by_free.reshape(n, -1)
            if not self._least_squares:
                M[:, 14:, 13] += self._by_free_aim.reshape(n, -1)
                stiff = np.einsum(
                    "nkl,nkr,nkm->nrlm", grid.shapes, self._stiff[..., :3], grid.shapes
                )
                for j in range(3):
                    own = slice(14 + j * most, 14 + (j + 1) * most)
                    M[:, own, own] += stiff[:, j]
        inverse = np.linalg.inv(G[:, :, 7:])  # A by what is held, then λ by A
        A = inverse @ held
        multipliers = inverse.transpose(0, 2, 1) @ (by_A - Q[:, 7:, 7:] @ A)
        left = M - by_A.transpose(0, 2, 1) @ A - held.transpose(0, 2, 1) @ multipliers
        return np.concatenate([A, multipliers], axis=1), left

    def step(self, shift: float = 0.0, redundant: float = 1e-10) -> Extremal | None:
        """Newton's, shortened by a shift of the curvature; None if there is none. Where rows
        imply each other by symmetry costates stay where they are, the more so the larger
        ``redundant`` is."""
        try:
            matrix, right = self._assembled(shift, redundant)
        except np.linalg.LinAlgError:  # of an interval
            return None
        x = solve(matrix, -right)
        return None if x is None else self._unpacked(x)

    def _assembled(self, shift: float, redundant: float) -> tuple[Array, Array]:
        """The small system, in the order of ``Places``."""
        of, at, places = self.of, self.at, self.of.places
        S, right = places.summed(self._condensed[1])
        here, there = places.inner_states, places.inner_costates
        S[here, there] -= 1.0  # an interval's end is the next one's beginning
        S[there, here] -= 1.0
        right[here] -= at.costates[:-1]
        right[places.lengths] += 1.0
        S[places.lengths, places.lengths] += 1.0 if self._least_squares else shift
        for modes, of_modes in zip(places.free, self._by_modes_alone(), strict=True):
            calm = _CALM / (2 * np.arange(len(modes)) + 1)
            S[modes, modes] += calm + (1.0 if self._least_squares else shift)
            right[modes] += of_modes
        known = 0.0 if self._least_squares else 1.0
        for j, (entry, slope) in enumerate(zip(of.held.entries, self._entry_slopes, strict=True)):
            here, there = places.state(int(of.grid.first[entry.arc])), places.entries[j]
            S[here, there] += slope
            S[there, here] += slope
            right[there] = known * self._entries[j]
        for j, (pin, off) in enumerate(zip(of.pins, self._off_pins(), strict=True)):
            modes = places.free[of.held.free.index((pin.arc, pin.motor))]
            S[modes, places.pins[j]] = S[places.pins[j], modes] = pin.shapes(len(modes))
            right[places.pins[j]] = known * off
        S[places.duals, places.duals] -= redundant
        return S[: places.size, : places.size], right[: places.size]

    def _unpacked(self, x: Array) -> Extremal:
        of, at, places = self.of, self.at, self.of.places
        n, nodes = of.grid.intervals, len(of.grid.nodes)
        knots, free = np.zeros((n + 1, 6)), np.zeros_like(at.free)
        knots[1:-1] = x[: 6 * (n - 1)].reshape(-1, 6)
        lengths = x[places.lengths]
        costates = x[places.costate(0)[0] :][: 6 * n].reshape(n, 6)
        for (a, k), modes in zip(of.held.free, places.free, strict=True):
            free[a, k, : len(modes)] = x[modes]
        h = of.grid.intervals_of(lengths)
        outside = [knots[:-1], h[:, None], costates, np.ones((n, 1))]
        if of.held.free:
            outside.append(free[of.grid.arc].reshape(n, -1))
        inside = -(self._condensed[0] @ np.hstack(outside)[..., None])[..., 0]
        A, multipliers = inside.reshape(n, 2, nodes, 3).transpose(1, 0, 2, 3)
        entry, pins = x[places.entries], x[places.pins]
        by_own = np.concatenate([knots[:-1], h[:, None], A.reshape(n, -1)], axis=1)
        dy = (self._slopes @ by_own[:, None, :, None])[..., 0]
        moved = [
            of.grid.torques(free),
            np.einsum("nkra,nka->nkr", self._other_slopes, dy),
        ]
        slack = np.where(of.within, self._off + np.concatenate(moved, axis=2), 0.0)
        upper = (self._mu + at.upper * slack) / (1 - at.slack) - at.upper
        lower = (self._mu - at.lower * slack) / (1 + at.slack) - at.lower
        return Extremal(
            knots, A, lengths, costates, multipliers, entry, free, pins, slack, upper, lower
        )

    def inside(self, step: Extremal) -> float:
        """The part of a step that keeps slacks and multipliers inside."""
        at, least = self.at, 1.0
        for now, by in ((1 - at.slack, -step.slack), (1 + at.slack, step.slack)):
            least = min(least, 0.995 / max(float((-by / now).max()), 1e-300))
        for now, by in ((at.upper, step.upper), (at.lower, step.lower)):
            shrink = np.where(now > 0, -by / np.where(now > 0, now, 1.0), 0.0)
            least = min(least, 0.995 / max(float(shrink.max()), 1e-300))
        return least


class Places:
    """Where the unknowns are in the small system: states at the inner knots, lengths, modes,
    costates, multipliers of entries and of pins; last a bin for what is given."""

    def __init__(self, of: Conditions) -> None:
        self._of, n = of, of.grid.intervals
        modes = [int(of.grid.modes[a]) for a, _ in of.held.free]
        sizes = [6 * (n - 1), len(of.grid.parts), sum(modes), 6 * n, len(of.held.entries)]
        ends = np.cumsum([*sizes, len(of.pins)]).tolist()
        _, self.lengths, free, costates, self.entries, self.pins = (
            np.arange(begin, end) for begin, end in zip([0, *ends[:-1]], ends, strict=True)
        )
        self.free = np.split(free, np.cumsum(modes)[:-1]) if modes else []
        self._first_costate, self.size = int(costates[0]), ends[-1]
        self._width = 14 + (3 * of.grid.most_modes if of.held.free else 0)
        self.duals = np.concatenate([costates, self.entries, self.pins])

    @cached_property
    def inner_states(self) -> Integers:
        """(X, V) at the inner knots, (n - 1, 6)."""
        return np.arange(6 * (self._of.grid.intervals - 1)).reshape(-1, 6)

    @cached_property
    def inner_costates(self) -> Integers:
        """p there, (n - 1, 6)."""
        return self._first_costate + self.inner_states

    def state(self, knot: int) -> Integers:
        """(X, V) at a knot; those of the first are given."""
        begin = 6 * (knot - 1) if knot else self.size
        return np.arange(begin, begin + 6)

    def costate(self, interval: int) -> Integers:
        """p at the end of an interval."""
        begin = self._first_costate + 6 * interval
        return np.arange(begin, begin + 6)

    def summed(self, small: Array) -> tuple[Array, Array]:
        """The intervals' matrices, (n, 14 + w, 14 + w), in one; their column 13, the right-hand
        side, apart."""
        size = self.size + 6
        where, source, share = self._sum
        rows = np.bincount(where, small.ravel()[source] * share, size * (size + 1))
        rows = rows.reshape(size, size + 1)
        return np.asarray(rows[:, :size], np.float64), np.asarray(rows[:, size], np.float64)

    @cached_property
    def _sum(self) -> tuple[Integers, Integers, Array]:
        """Of every number of the intervals' matrices: where it goes, where it is, its factor."""
        size, parts = self.size + 6, []
        for i in range(self._of.grid.intervals):
            inside, here, share = self._outside(i)
            rows, columns = i * self._width + inside, np.append(inside, 13)
            where = here[:, None] * (size + 1) + np.append(here, size)
            factors = np.outer(share, np.append(share, 1.0))
            parts.append((where, rows[:, None] * self._width + columns, factors))
        where, source, factors = (
            np.concatenate([each.ravel() for each in part]) for part in zip(*parts, strict=True)
        )
        return where, source, factors

    def _outside(self, interval: int) -> tuple[Integers, Integers, Array]:
        """What is outside of an interval: where for the interval, where here, and factors."""
        of = self._of
        a = int(of.grid.arc[interval])
        here = [self.state(interval), self.lengths[[a]], self.costate(interval)]
        for_interval = [np.arange(13)]
        for (arc, motor), modes in zip(of.held.free, self.free, strict=True):
            if arc == a:
                here.append(modes)
                for_interval.append(14 + motor * of.grid.most_modes + np.arange(len(modes)))
        inside = np.concatenate(for_interval)
        share = np.ones(len(inside))
        share[6] = 1.0 / of.grid.parts[a]
        return inside, np.concatenate(here), share
