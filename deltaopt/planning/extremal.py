"""A structure solved for its switches by Newton's method: the square system of its conditions.

Once it is known which limit holds when, no inequality is left. On interval i, the m-th part of
an arc of length L_a, h = L_a / m, the motion is a polynomial through accelerations A at nodes c:

    X_c = X_i + h c V_i + h² Σ_j l̿_j(c) A_j          V_c = V_i + h Σ_j l̄_j(c) A_j

and stationary is

    Σ_a L_a + Σ_i p_{i+1} · ((X, V)_1 − (X, V)_{i+1}) + Σ_c λ_c · (r_c − limit) + Σ ν · (e − limit)

r: what is held at every node (torques; the derivative of a speed; the second one of an opening),
e: what is held where an arc begins (the speed; the opening and its derivative). p are the
costates. A and λ of an interval are eliminated by themselves, what remains is small and dense.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from deltaopt.planning.scales import Scales
from deltaopt.planning.stage import (
    OPENING,
    OPENING_BEND,
    OPENING_RATE,
    SPEED,
    SPEED_RATE,
    TORQUE,
    Stage,
)
from deltaopt.planning.structure import FREE, Structure
from deltaopt.planning.transcription import PiecewiseAcceleration
from deltaopt.trajectory import PiecewisePolynomial, Trajectory

Array = NDArray[np.float64]
Integers = NDArray[np.intp]

_LONGEST = 0.15
"""Of the duration: arcs longer than this are cut into intervals."""
DENSE = np.linspace(0.0, 1.0, 21)
"""Where in every interval a solution is examined, both ends included."""
_ITERATIONS = 25
_CONVERGED = 1e-10
"""Largest residual, all of the order of one."""
_STALLED = 1e-7
"""What rounding may leave of it where the motion is hardly determined."""
_LONGEST_STEP = 0.3
_LEAST_SHIFT = 1e-9
_PREFERENCE, _LEAST_PREFERENCE = 1e-9, 1e-9
"""Cost of torque without limit, at first and at last: of motions equally fast take the calmest."""
_REDUNDANT = 1e-10
"""Where rows imply each other by symmetry, costates stay where they are in that direction."""


@dataclass(frozen=True)
class Held:
    """What the arcs hold: three rows at every node, and more where an arc begins.

    ``row``, ``limit``: (arcs, 3). ``free``: (arc, which of the three, motor) where the row is a
    torque that no limit holds. ``entries``: (arc, row, limit) of what is held in its beginning.
    """

    row: Integers
    limit: Array
    free: tuple[tuple[int, int], ...]
    entries: tuple[tuple[int, int, float], ...]

    @classmethod
    def of(cls, structure: Structure) -> Held:
        arcs = len(structure.lengths)
        row, limit = np.zeros((arcs, 3), np.intp), np.zeros((arcs, 3))
        free, entries = [], []
        for a, k in product(range(arcs), range(3)):
            now = structure.limits[a][k]
            before = structure.limits[a - 1][k] if a else FREE
            if now.touched and before != now:
                entries.append((a, OPENING + k, 0.0))
            if now.speed:
                row[a, k] = SPEED_RATE + k
                if before.speed != now.speed:
                    entries.append((a, SPEED + k, float(now.speed)))
            elif now.opening:
                row[a, k] = OPENING_BEND + k
                if not before.opening:
                    entries += [(a, OPENING + k, 0.0), (a, OPENING_RATE + k, 0.0)]
            else:
                row[a, k], limit[a, k] = TORQUE + k, now.torque
                if not now.torque:
                    free.append((a, k))
        return cls(row, limit, tuple(free), tuple(entries))


@dataclass(frozen=True)
class Grid:
    """Arcs cut into intervals, polynomials of a degree on each."""

    parts: Integers
    degree: int
    modes: Integers

    @classmethod
    def of(cls, structure: Structure, degree: int, more: int = 0) -> Grid:
        lengths = np.abs(structure.lengths)
        parts = np.ceil(lengths / _LONGEST).clip(1).astype(np.intp)
        return cls(parts, degree, np.ceil(1 + (more + 10) * lengths.clip(0.0, 0.3) / 0.3 * 0.6 + 4 * lengths).astype(np.intp))

    @property
    def most_modes(self) -> int:
        return int(self.modes.max())

    @cached_property
    def shapes(self) -> Array:
        """Legendre's polynomials over the arc at the nodes, (n, nodes, most modes)."""
        number = np.arange(self.intervals) - self.first[self.arc]
        share = (number[:, None] + self.nodes) / self.parts[self.arc][:, None]
        return legvander(2 * share - 1, self.most_modes - 1)

    @cached_property
    def transcription(self) -> PiecewiseAcceleration:
        return _transcription(self.degree)

    @cached_property
    def arc(self) -> Integers:
        """The arc of each interval, (n,)."""
        return np.repeat(np.arange(len(self.parts)), self.parts)

    @cached_property
    def first(self) -> Integers:
        """The first interval of each arc, (arcs,)."""
        return np.cumsum(self.parts) - self.parts

    @property
    def intervals(self) -> int:
        return len(self.arc)

    @cached_property
    def quadrature(self) -> Array:
        return self.transcription.quadrature

    @property
    def nodes(self) -> Array:
        return self.transcription.nodes

    @cached_property
    def weights(self) -> tuple[Array, Array]:
        """l̿_j(c) and l̄_j(c), (nodes, nodes) each."""
        position, velocity, _ = self.transcription.weights(self.nodes, 1.0)
        return position[:, 2:], velocity[:, 2:]

    @cached_property
    def dense(self) -> tuple[Array, Array, Array]:
        """The same, and l_j(c), at ``DENSE``, (dense, nodes) each."""
        position, velocity, acceleration = self.transcription.weights(DENSE, 1.0)
        return position[:, 2:], velocity[:, 2:], acceleration[:, 2:]


_TRANSCRIPTIONS: dict[int, PiecewiseAcceleration] = {}


def _transcription(degree: int) -> PiecewiseAcceleration:
    """Kept, since its polynomials are."""
    return _TRANSCRIPTIONS.setdefault(degree, PiecewiseAcceleration(degree, between=()))


@dataclass(frozen=True)
class Extremal:
    """Unknowns of the system, scaled, and where they stand.

    ``knots``: (X, V), (n + 1, 6). ``A``: (n, nodes, 3). ``lengths``: of the arcs. ``costates``:
    p at the ends of the intervals, (n, 6). ``multipliers``: λ, (n, nodes, 3). ``entry``: ν.
    ``free``: of Legendre's polynomials in torques without limit, (arcs, 3, modes).
    """

    knots: Array
    A: Array
    lengths: Array
    costates: Array
    multipliers: Array
    entry: Array
    free: Array
    pins: Array

    @property
    def duration(self) -> float:
        """In units of the scales' time."""
        return float(self.lengths.sum())


class Pin(NamedTuple):
    """A torque without limit that begins (end = 0) or ends (1) an arc at a limit."""

    arc: int
    motor: int
    end: int
    limit: float

    def shapes(self, modes: int) -> Array:
        """Legendre's polynomials there."""
        return np.ones(modes) if self.end else (-1.0) ** np.arange(modes)


class Stuck(Exception):
    """Newton's method does not converge."""


@dataclass(frozen=True)
class Conditions:
    """The system for one structure and scene. ``p``: the parameters of the stage's rows."""

    stage: Stage
    structure: Structure
    held: Held
    grid: Grid
    goal: Array
    p: Array
    pins: tuple[Pin, ...] = ()

    def solve(self, guess: Extremal) -> tuple[Extremal, int]:
        """The stationary point near a guess, and how many steps it took. Raises Stuck."""
        now, shift, before, shorter = guess, 0.0, np.inf, np.array([np.inf])
        system = _System(self, now, _PREFERENCE)
        for iteration in range(_ITERATIONS):
            if not np.isfinite(system.residual):
                raise Stuck("the motion leaves the workspace")
            shares = now.lengths / now.duration
            if iteration >= 3 and self._vanishing(shares, shorter):
                return now, iteration
            shorter = shares
            if system.preference == _LEAST_PREFERENCE or not self.held.free:
                if system.residual < _CONVERGED or before < 2 * system.residual < _STALLED:
                    return now, iteration
            before = system.residual
            preference = max(_PREFERENCE * 10.0 ** -(iteration + 1), _LEAST_PREFERENCE)
            now, system, shift = self._moved(system, shift, preference)
        raise Stuck(f"residual {system.residual:.0e} after {_ITERATIONS} steps")

    def converged(self, motion: Extremal) -> bool:
        return _System(self, motion, _LEAST_PREFERENCE).residual < _STALLED

    def _vanishing(self, lengths: Array, before: Array) -> bool:
        """Whether an arc is halved time and again: it is not there."""
        small = np.abs(lengths) < 2e-3
        return bool((small & (np.abs(lengths) < 0.7 * np.abs(before)) & (np.abs(lengths) > 0.2 * np.abs(before))).any())

    def _moved(
        self, system: _System, shift: float, preference: float
    ) -> tuple[Extremal, _System, float]:
        """By Newton's step, with the curvature shifted as far as it needs to be short."""
        for _ in range(12):
            try:
                step = system.step(shift)
            except np.linalg.LinAlgError:
                step = None
            if step is not None and step.primal < _LONGEST_STEP:
                moved = step.taken(system.at, 1.0)
                return moved, _System(self, moved, preference), shift / 30 if shift > _LEAST_SHIFT else 0.0
            shift = max(10 * shift, _LEAST_SHIFT)
        raise Stuck("no short step")

    def guess(self, trajectory: Trajectory, scales: Scales) -> Extremal:
        """From a motion of about this structure; multipliers of least squares."""
        grid, nodes = self.grid, self.grid.nodes
        lengths = self.structure.lengths * trajectory.duration
        h = (lengths / grid.parts)[grid.arc]
        begin = np.concatenate([[0.0], np.cumsum(h)])
        position = trajectory.position
        inside = begin[:-1, None] + h[:, None] * np.clip(nodes, 1e-6, 1 - 1e-6)
        bend = position.derivative().derivative()
        D, T, n = scales.length, scales.time, grid.intervals
        A = bend.at(inside.ravel()).reshape(n, -1, 3) * T**2 / D
        X = (position.at(begin) - scales.origin) / D
        V = position.derivative().at(begin) * T / D
        knots = np.hstack([X, V])
        knots[0], knots[-1] = 0.0, np.concatenate([self.goal, np.zeros(3)])
        zero = Extremal(
            knots,
            A,
            lengths / T,
            np.zeros((n, 6)),
            np.zeros((n, len(nodes), 3)),
            np.zeros(len(self.held.entries)),
            np.zeros((len(grid.parts), 3, grid.most_modes)),
            np.zeros(len(self.pins)),
        )
        for a, k in self.held.free:
            on_arc = grid.arc == a
            modes = grid.modes[a]
            shapes = grid.shapes[on_arc].reshape(-1, grid.most_modes)[:, :modes]
            y = self.at_nodes(zero)[on_arc].reshape(-1, 9)
            torque = np.clip(self.stage.values(y, self.p)[:, TORQUE + k], -1.0, 1.0)
            zero.free[a, k, :modes] = np.linalg.lstsq(shapes, torque, rcond=None)[0]
        return self.with_multipliers(zero)

    def with_multipliers(self, motion: Extremal) -> Extremal:
        """Those of least squares."""
        step = _System(self, motion, 0.0, least_squares=True).step()
        return replace(
            motion,
            costates=motion.costates + step.costates,
            multipliers=motion.multipliers + step.multipliers,
            entry=motion.entry + step.entry,
        )

    def intervals(self, motion: Extremal) -> Array:
        """Their lengths, (n,)."""
        return np.asarray((motion.lengths / self.grid.parts)[self.grid.arc])

    def at_nodes(self, motion: Extremal) -> Array:
        """y = (X, V, A) at the nodes, (n, nodes, 9)."""
        position, velocity = self.grid.weights
        return self._at(motion, self.grid.nodes, position, velocity, np.eye(len(velocity)))

    def between(self, motion: Extremal) -> Array:
        """The same at the grid's ``dense`` fractions of the intervals, (n, dense, 9)."""
        return self._at(motion, DENSE, *self.grid.dense)

    def _at(
        self, motion: Extremal, c: Array, position: Array, velocity: Array, acceleration: Array
    ) -> Array:
        h = self.intervals(motion)[:, None, None]
        X, V, A = motion.knots[:-1, None, :3], motion.knots[:-1, None, 3:], motion.A
        x = X + h * c[:, None] * V + h**2 * (position @ A)
        return np.concatenate([x, V + h * (velocity @ A), acceleration @ A], axis=2)

    def prices(self, motion: Extremal) -> Array:
        """Of what is held at the nodes, duration per limit and time, (n, nodes, 3)."""
        weight = self.intervals(motion)[:, None] * self.grid.quadrature
        return np.asarray(motion.multipliers / weight[..., None])

    def hamiltonian(self, motion: Extremal) -> Array:
        """p · (V, A) at the beginning and the end of every interval, (n, 2)."""
        system = _System(self, motion, 0.0)
        first = system.gradient[:, :6].copy()
        for (a, _, _), nu, slope in zip(
            self.held.entries, motion.entry, system.entry_slopes, strict=True
        ):
            first[self.grid.first[a]] -= nu * slope
        y = self.at_nodes(motion)
        ends = [(y[:, 0, 3:] * first).sum(axis=1), (y[:, -1, 3:] * motion.costates).sum(axis=1)]
        return np.stack(ends, axis=1)

    def polynomial(self, motion: Extremal, scales: Scales) -> PiecewisePolynomial:
        """In m and s, without arcs of no or negative length."""
        h = self.intervals(motion)
        kept = h > 1e-9
        h, A = h[kept], motion.A[kept]
        X, V = motion.knots[:-1][kept, :3], motion.knots[:-1][kept, 3:]
        coefficients = scales.length * self.grid.transcription.coefficients(X, V, A, h)
        coefficients[:, 0] += scales.origin
        coefficients /= scales.time ** np.arange(coefficients.shape[1])[:, None]
        knots = scales.time * np.concatenate([[0.0], np.cumsum(h)])
        return PiecewisePolynomial(knots, coefficients)


@dataclass(frozen=True)
class _Step:
    knots: Array
    A: Array
    lengths: Array
    costates: Array
    multipliers: Array
    entry: Array
    free: Array
    pins: Array

    @property
    def primal(self) -> float:
        return float(max(np.abs(self.knots).max(), np.abs(self.lengths).max(), np.abs(self.free).max() / 3))

    def taken(self, now: Extremal, share: float) -> Extremal:
        return Extremal(
            now.knots + share * self.knots,
            now.A + share * self.A,
            now.lengths + share * self.lengths,
            now.costates + share * self.costates,
            now.multipliers + share * self.multipliers,
            now.entry + share * self.entry,
            now.free + share * self.free,
            now.pins + share * self.pins,
        )


class _System:
    """Newton's equations at a motion."""

    def __init__(
        self, of: Conditions, at: Extremal, preference: float, *, least_squares: bool = False
    ) -> None:
        self.of, self.at, self.preference = of, at, preference
        grid, held = of.grid, of.held
        n, k = grid.intervals, len(grid.nodes)
        arc = grid.arc
        rows = of.stage.rows
        which = np.broadcast_to(held.row[arc][:, None], (n, k, 3))
        weights = np.zeros((n, k, rows))
        np.put_along_axis(weights, which, at.multipliers, axis=2)
        for (a, row, _), nu in zip(held.entries, at.entry, strict=True):
            weights[grid.first[a], 0, row] += nu
        y = of.at_nodes(at)
        r, J, H = of.stage.derivatives(
            y.reshape(-1, 9), weights.reshape(-1, rows), of.p
        )
        r, J, W = r.reshape(n, k, rows), J.reshape(n, k, rows, 9), H.reshape(n, k, 9, 9)
        value = np.take_along_axis(r, which, axis=2)
        wanted = held.limit[arc][:, None] + np.einsum("nkl,nrl->nkr", grid.shapes, at.free[arc])
        self.residual_rows = value - wanted
        G = np.take_along_axis(J, which[..., None], axis=2)
        self.by_free = -np.einsum("nkr,nkl->nrl", at.multipliers, grid.shapes)
        m = np.einsum("nkr,nkra->nka", weights, J)
        m[:, -1, :6] += at.costates
        self.entry_rows = np.array(
            [r[grid.first[a], 0, row] - limit for a, row, limit in held.entries]
        )
        self.entry_slopes = [J[grid.first[a], 0, row, :6] for a, row, _ in held.entries]
        T = self._slopes(y)
        flat = T.reshape(n, 9 * k, -1)
        self.gradient = (m.reshape(n, 1, -1) @ flat)[:, 0]
        self.end_slope = T[:, -1, :6]
        self.row_slopes = (G @ T).reshape(n, 3 * k, -1)
        size = flat.shape[2]
        self.least_squares = least_squares
        if least_squares:
            self.curvature = np.broadcast_to(np.eye(size), (n, size, size))
            self.residual_rows = np.zeros_like(self.residual_rows)
            self.entry_rows = np.zeros_like(self.entry_rows)
            self.gap = np.zeros((n, 6))
        else:
            self.curvature = flat.transpose(0, 2, 1) @ (W @ T).reshape(n, 9 * k, -1)
            self.curvature += self._bilinear(m)
            self.gap = y[:, -1, :6] - at.knots[1:]

    def _slopes(self, y: Array) -> Array:
        """Of y by (X_i, V_i, h, A), (n, nodes, 9, 7 + 3 nodes)."""
        grid, at = self.of.grid, self.at
        n, k = grid.intervals, len(grid.nodes)
        position, velocity = grid.weights
        h = self.of.intervals(at)
        T = np.zeros((n, k, 9, 7 + 3 * k))
        by_A = T[..., 7:].reshape(n, k, 9, k, 3)
        for j in range(3):
            T[:, :, j, j] = 1.0
            T[:, :, j, 3 + j] = h[:, None] * grid.nodes
            T[:, :, 3 + j, 3 + j] = 1.0
            by_A[:, :, j, :, j] = h[:, None, None] ** 2 * position
            by_A[:, :, 3 + j, :, j] = h[:, None, None] * velocity
            by_A[:, :, 6 + j, :, j] = np.eye(k)
        T[..., 7:] = by_A.reshape(n, k, 9, -1)
        V = at.knots[:-1, None, 3:]
        T[:, :, :3, 6] = grid.nodes[:, None] * V + 2 * h[:, None, None] * (position @ at.A)
        T[:, :, 3:6, 6] = velocity @ at.A
        return T

    def _bilinear(self, m: Array) -> Array:
        """Curvature of y itself, weighted by m (n, nodes, 9)."""
        grid, at = self.of.grid, self.at
        n, k = grid.intervals, len(grid.nodes)
        position, velocity = grid.weights
        h = self.of.intervals(at)
        B = np.zeros((n, 7 + 3 * k, 7 + 3 * k))
        by_V = np.einsum("nka,k->na", m[..., :3], grid.nodes)
        pulled = position.T @ m[..., :3]  # (n, nodes, 3): Σ_c l̿_j(c) m_c
        by_A = 2 * h[:, None, None] * pulled + velocity.T @ m[..., 3:6]
        B[:, 3:6, 6] = B[:, 6, 3:6] = by_V
        B[:, 6, 6] = 2 * np.einsum("nja,nja->n", pulled, at.A)
        B[:, 7:, 6] = B[:, 6, 7:] = by_A.reshape(n, -1)
        return B

    def _condense(self, shift: float) -> None:
        """A and λ out of each interval: what is left by (X_i, V_i, h, p_{i+1}), 13."""
        n, k = self.of.grid.intervals, len(self.of.grid.nodes)
        d = 3 * k
        K = np.zeros((n, 2 * d, 2 * d))
        K[:, :d, :d] = self.curvature[:, 7:, 7:]
        K[:, d:, :d] = self.row_slopes[:, :, 7:]
        K[:, :d, d:] = self.row_slopes[:, :, 7:].transpose(0, 2, 1)
        grid = self.of.grid
        most = grid.most_modes
        modes = 3 * most if self.of.held.free else 0
        B = np.zeros((n, 2 * d, 14 + modes))
        B[:, :d, :7] = self.curvature[:, 7:, :7]
        B[:, d:, :7] = self.row_slopes[:, :, :7]
        B[:, :d, 7:13] = self.end_slope[:, :, 7:].transpose(0, 2, 1)
        B[:, :d, 13] = self.gradient[:, 7:]
        B[:, d:, 13] = self.residual_rows.reshape(n, -1)
        if modes:
            by_free = B[:, d:, 14:].reshape(n, k, 3, 3, most)
            for j in range(3):
                by_free[:, :, j, j] = -grid.shapes
            B[:, d:, 14:] = by_free.reshape(n, d, -1)
        self.back = np.linalg.solve(K, B)
        M = np.zeros((n, 14 + modes, 14 + modes))
        M[:, :7, :7] = self.curvature[:, :7, :7]
        M[:, 7:13, :7] = self.end_slope[:, :, :7]
        M[:, :7, 7:13] = self.end_slope[:, :, :7].transpose(0, 2, 1)
        M[:, :7, 13] = self.gradient[:, :7]
        M[:, 7:13, 13] = self.gap
        if modes:
            M[:, 14:, 13] = self.by_free.reshape(n, -1)
        self.small = M - B.transpose(0, 2, 1) @ self.back

    @property
    def infeasibility(self) -> float:
        """Largest violation of what is held or continuous."""
        parts = [self.residual_rows, self.gap, self.entry_rows]
        return float(max(np.abs(part).max(initial=0.0) for part in parts))

    @property
    def residual(self) -> float:
        """The same, or the largest derivative of the Lagrangian."""
        by_L = 1.0 + np.bincount(self.of.grid.arc, self.gradient[:, 6] / self.of.grid.parts[self.of.grid.arc])
        by_state = self.gradient[1:, :6] - self.at.costates[:-1]
        parts = [by_L, by_state, self.gradient[:, 7:]]
        for a, k in self.of.held.free:
            modes = np.arange(self.of.grid.modes[a])
            of_torque = self.by_free[self.of.grid.arc == a, k].sum(axis=0)[modes]
            of_torque += self.preference * self.at.free[a, k, modes] / (2 * modes + 1)
            for pin, pi in zip(self.of.pins, self.at.pins, strict=True):
                if (pin.arc, pin.motor) == (a, k):
                    of_torque += pi * pin.shapes(len(modes))
            parts.append(of_torque)
        stationarity = max(np.abs(part).max(initial=0.0) for part in parts)
        return max(self.infeasibility, float(stationarity))

    def step(self, shift: float = 0.0) -> _Step:
        """Newton's, shortened by a shift of the curvature."""
        self._condense(shift)
        grid, at, held = self.of.grid, self.at, self.of.held
        n, m, e = grid.intervals, len(grid.parts), len(held.entries)
        first_L = 6 * (n - 1)
        numbers = [int(grid.modes[a]) for a, _ in held.free]
        of_free = np.split(first_L + m + np.arange(sum(numbers)), np.cumsum(numbers)[:-1])
        first_p = first_L + m + sum(numbers)
        first_nu = first_p + 6 * n
        first_pin = first_nu + e
        size = first_pin + len(self.of.pins)
        S, rhs = np.zeros((size + 7, size + 7)), np.zeros(size + 7)  # a bin for what is fixed
        six = np.arange(6)
        for i in range(n):
            a = grid.arc[i]
            at_s = 6 * (i - 1) + six if i else size + six
            index, here = [at_s, [first_L + a], first_p + 6 * i + six], [np.arange(13)]
            for j, (b, k) in enumerate(held.free):
                if b == a:
                    index.append(of_free[j])
                    here.append(14 + k * grid.most_modes + np.arange(numbers[j]))
            into, out = np.concatenate(index), np.concatenate(here)
            share = np.ones(len(out))
            share[6] = 1.0 / grid.parts[a]
            S[np.ix_(into, into)] += self.small[i][np.ix_(out, out)] * np.outer(share, share)
            rhs[into] += self.small[i, out, 13] * share
            if i < n - 1:
                here, there = 6 * i + six, first_p + 6 * i + six
                S[here, there] -= 1.0
                S[there, here] -= 1.0
                rhs[here] -= at.costates[i]
        rhs[first_L : first_L + m] += 1.0
        for j, ((a, _, _), slope) in enumerate(zip(held.entries, self.entry_slopes, strict=True)):
            i = grid.first[a]
            here = 6 * (i - 1) + six
            S[here, first_nu + j] += slope
            S[first_nu + j, here] += slope
            rhs[first_nu + j] += self.entry_rows[j]
        for j, (pin, pi) in enumerate(zip(self.of.pins, at.pins, strict=True)):
            at_w = of_free[held.free.index((pin.arc, pin.motor))]
            shapes = pin.shapes(len(at_w))
            S[at_w, first_pin + j] = S[first_pin + j, at_w] = shapes
            rhs[at_w] += pi * shapes
            rhs[first_pin + j] = shapes @ at.free[pin.arc, pin.motor, : len(at_w)] - pin.limit
        S, rhs = S[:size, :size], rhs[:size]
        for j, (a, k) in enumerate(held.free):
            at_w, modes = of_free[j], np.arange(numbers[j])
            rhs[at_w] += self.preference * at.free[a, k, modes] / (2 * modes + 1)
            S[at_w, at_w] += self.preference / (2 * modes + 1)
        along = np.arange(first_L, first_p)
        S[along, along] += shift if not self.least_squares else 1.0
        duals = np.arange(first_p, size)
        S[duals, duals] -= _REDUNDANT
        x = np.linalg.solve(S, -rhs)
        knots = np.zeros((n + 1, 6))
        knots[1:-1] = x[:first_L].reshape(-1, 6)
        lengths, costates = x[first_L : first_L + m], x[first_p:first_nu].reshape(n, 6)
        free = np.zeros_like(at.free)
        for j, (a, k) in enumerate(held.free):
            free[a, k, : numbers[j]] = x[of_free[j]]
        h = (lengths / grid.parts)[grid.arc]
        outer = [knots[:-1], h[:, None], costates, np.ones((n, 1))]
        if held.free:
            outer.append(free[grid.arc].reshape(n, -1))
        inner = -(self.back @ np.hstack(outer)[..., None])[..., 0]
        d = 3 * len(grid.nodes)
        return _Step(
            knots,
            inner[:, :d].reshape(n, -1, 3),
            lengths,
            costates,
            inner[:, d:].reshape(n, -1, 3),
            x[first_nu:first_pin],
            free,
            x[first_pin:],
        )
