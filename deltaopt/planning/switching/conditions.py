"""A structure solved for its switches by Newton's method: the square system of its conditions.

Once it is known which limit holds when, no inequality is left. On interval i, the m-th part of
an arc of length L_a, h = L_a / m, the motion is a polynomial through accelerations A at nodes c:

    X_c = X_i + h c V_i + h² Σ_j l̿_j(c) A_j          V_c = V_i + h Σ_j l̄_j(c) A_j

and stationary is

    Σ_a L_a + Σ_i p_{i+1} · ((X, V)_1 - (X, V)_{i+1}) + Σ_c λ_c · (r_c - u_c) + Σ ν (e - ē)

r: what is held at every node, one row a motor, and u its value: a limit, or a polynomial Σ w φ
over the arc where a torque has no limit. e: what is held where an arc begins. p: the costates.
Torques without limit are given fewer degrees of freedom than there are nodes since where such
an arc ends and what the torque does there is one thing, not two: the system would be singular.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from deltaopt.motion.trajectory import PiecewisePolynomial, Trajectory
from deltaopt.planning.flat.constraint_rows import SPEED, TORQUE, Stage
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.switching.arc_mesh import DENSE, Grid, Held, Pin
from deltaopt.planning.switching.kkt_system import Extremal, Places, System
from deltaopt.planning.switching.structure import Structure

Array = NDArray[np.float64]
Integers = NDArray[np.intp]

_ITERATIONS = 40
_PATIENCE, _WITH_BARRIER, _FAR = 8, 20, 1.0
"""Steps, and steps with a barrier, after which a residual that never came below this is given up:
of motions that are found it does so in fewer, and most that are not are seen by that."""
_CONVERGED = 1e-10
"""Largest residual, all of the order of one."""
_STALLED = 1e-7
"""What rounding may leave of it where the motion is hardly determined."""
_LONGEST_STEP, _LONGEST_INSIDE = 0.1, 0.3
"""Without and with a barrier."""
_SHRINK = 0.8
"""By so much at most arcs that cannot be reversed become shorter in a step."""
_LEAST_SHIFT, _MOST_SHIFT = 1e-9, 1e-4
_REVERSED = 1e-3
"""Of the duration: an arc that remains shorter than minus this has its ends exchanged."""
_TINY = 2e-3
"""Of the duration: arcs shorter than this that every step halves are vanishing."""


@dataclass(frozen=True)
class Barrier:
    """Keeps what no arc holds within its limits by an interior-point method: slack times
    multiplier, per time, is ``first``, falls by ``fall`` from step to step, and ends at
    ``last``, which is what it costs at most, a limit.

    Without it a step is cheaper, and what exceeds a limit is seen afterwards."""

    first: float = 1e-2
    last: float = 1e-7
    fall: float = 0.3


class Stuck(Exception):
    """Newton's method does not converge."""


@dataclass(frozen=True)
class Stationary:
    """Where Newton's method ended. ``vanishing``: arcs of no length, (arcs,); if there are any,
    the motion is not converged."""

    motion: Extremal
    iterations: int
    vanishing: NDArray[np.bool]


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
    barrier: Barrier | None = None

    @classmethod
    def of(
        cls,
        stage: Stage,
        structure: Structure,
        grid: Grid,
        scales: Scales,
        parameters: Array,
        pins: tuple[Pin, ...] = (),
        barrier: Barrier | None = None,
    ) -> Conditions:
        """For a scene and the parameters of its mechanism."""
        p = np.concatenate([scales.vector(), parameters])
        goal = np.concatenate([scales.goal, np.zeros(3)])
        return cls(stage, structure, Held.of(structure), grid, goal, p, pins, barrier)

    @cached_property
    def places(self) -> Places:
        """Where the unknowns are in the small system."""
        return Places(self)

    @cached_property
    def others(self) -> Integers:
        """Rows of the stage that may have to be kept within ±1: torques, and speeds."""
        speeds = np.arange(SPEED, min(SPEED + 3, self.stage.rows))
        return np.concatenate([np.arange(TORQUE, TORQUE + 3), speeds]).astype(np.intp)

    @cached_property
    def within(self) -> NDArray[np.bool]:
        """What is kept within ±1 at the nodes, (n, nodes, 6 or 9): torques that are polynomials,
        those that follow from a speed or an opening, and speeds that are not held there."""
        grid, n, k = self.grid, self.grid.intervals, len(self.grid.nodes)
        within = np.zeros((n, k, 3 + len(self.others)), bool)
        if self.barrier is None:
            return within
        for a, motor in self.held.free:
            within[grid.arc == a, :, motor] = True
        within[..., 3:6] = self.held.without_row[grid.arc][:, None]
        if self.stage.rows > SPEED:
            held = self.structure.speed[grid.arc] != 0
            within[..., 6:] = ~held[:, None]
            within[0, 0, 6:] = within[-1, -1, 6:] = False
            within[1:, 0, 6:] &= ~held[:-1]
            within[:-1, -1, 6:] &= ~held[1:]
        return within

    def solve(self, guess: Extremal) -> Stationary:
        """The stationary motion near a guess. Raises Stuck."""
        with np.errstate(all="ignore"):  # what is no number is looked for, and shortens a step
            return self._solved(guess)

    def _solved(self, guess: Extremal) -> Stationary:
        method = self.barrier if self.barrier and self.within.any() else Barrier(0.0, 0.0)
        barrier = method.first
        guess = self._inside(guess, barrier)
        system, shift, residual = System(self, guess, barrier), 0.0, np.inf
        lengths, reversed_for = np.full(len(self.grid.parts), np.inf), 0
        least, patience = np.inf, _WITH_BARRIER if method.last else _PATIENCE
        for iteration in range(_ITERATIONS):
            before, residual = residual, system.residual
            if not np.isfinite(residual):
                raise Stuck("the motion leaves the workspace")
            shorter, lengths = np.abs(lengths), system.at.lengths / system.at.duration
            vanishing = (np.abs(lengths) < _TINY) & (np.abs(lengths) < 0.7 * shorter)
            vanishing &= np.abs(lengths) > 0.9 * (1 - _SHRINK) * shorter
            reversed_for = reversed_for + 1 if lengths.min() < -_REVERSED else 0
            settled = residual < _CONVERGED or before < 2 * residual < _STALLED
            settled = settled and barrier <= method.last
            hopeless = reversed_for > 2 and residual < 0.1
            if settled:
                motion = system.at if method.last else self._polished(system.at)
                return Stationary(motion, iteration, np.zeros(len(lengths), bool))
            if hopeless or (iteration > 2 and vanishing.any()):
                return Stationary(system.at, iteration, vanishing)
            least = min(least, residual)
            if iteration >= patience and least > _FAR:
                raise Stuck(f"a residual of {residual:.0e} is left after {iteration} steps")
            barrier = max(barrier * method.fall, method.last)
            system, shift = self._moved(system, shift, barrier)
        if lengths.min() < 0 and residual < 1:  # there may be one if its ends are exchanged
            return Stationary(system.at, _ITERATIONS, np.zeros(len(lengths), bool))
        raise Stuck(f"a residual of {residual:.0e} is left after {_ITERATIONS} steps")

    def _moved(self, system: System, shift: float, barrier: float) -> tuple[System, float]:
        """By Newton's step, the curvature shifted as far as it needs to be a short one, or by
        a part of it where that does not do."""
        longest = _LONGEST_INSIDE if barrier else _LONGEST_STEP
        step = system.step(shift)
        while (step is None or step.largest > longest) and shift < _MOST_SHIFT:
            shift = max(10 * shift, _LEAST_SHIFT)
            step = system.step(shift)
        if step is None or not np.isfinite(step.largest):
            raise Stuck("there is no step")
        share = min(system.inside(step), longest / max(step.largest, 1e-300))
        bounded = ~self.structure.reversible & (system.at.lengths > 0)
        shrink = -step.lengths / np.where(bounded, system.at.lengths, np.inf)
        share = min(share, _SHRINK / max(float(shrink.max()), 1e-300))
        for _ in range(4):
            moved = System(self, system.at + step.times(share), barrier)
            if np.isfinite(moved.residual):
                break
            share /= 3
        return moved, shift / 30 if shift > _LEAST_SHIFT else 0.0

    def guess(self, trajectory: Trajectory, scales: Scales) -> Extremal:
        """From a motion of about this structure; multipliers of least squares."""
        grid, held = self.grid, self.held
        lengths = np.clip(self.structure.lengths, 0.0, 1.0) * trajectory.duration
        h = grid.intervals_of(lengths)
        begin = np.concatenate([[0.0], np.cumsum(h)])
        inside = begin[:-1, None] + h[:, None] * np.clip(grid.nodes, 1e-6, 1 - 1e-6)
        D, T, n = scales.length, scales.time, grid.intervals
        acceleration = trajectory.position.derivative().derivative()
        A = acceleration.at(inside.ravel()).reshape(n, -1, 3) * T**2 / D
        knots = scales.states(trajectory.position, begin, T)
        knots[0], knots[-1] = 0.0, self.goal
        motion = Extremal(
            knots=knots,
            A=A,
            lengths=lengths / T,
            costates=np.zeros((n, 6)),
            multipliers=np.zeros(A.shape),
            entry=np.zeros(len(held.entries)),
            free=np.zeros((len(lengths), 3, grid.most_modes)),
            pins=np.zeros(len(self.pins)),
            slack=np.zeros(self.within.shape),
            upper=np.zeros(self.within.shape),
            lower=np.zeros(self.within.shape),
        )
        return self._with_multipliers(replace(motion, free=self._free(motion)))

    def _inside(self, motion: Extremal, barrier: float) -> Extremal:
        """With slacks and multipliers to begin with."""
        grid = self.grid
        torques = grid.torques(motion.free)
        rows = self.stage.values(motion.at_nodes(grid).reshape(-1, 9), self.p)
        others = rows[:, self.others].reshape(*torques.shape[:2], -1)
        c = np.concatenate([torques, others], axis=2)
        slack = np.where(self.within, np.clip(c, -0.99, 0.99), 0.0)
        weight = np.abs(motion.intervals(grid))[:, None, None] * grid.quadrature[:, None]
        weight = weight * self.within
        return replace(
            motion,
            slack=slack,
            upper=barrier * weight / (1 - slack),
            lower=barrier * weight / (1 + slack),
        )

    def _free(self, motion: Extremal) -> Array:
        """Torques without limit fitted to a motion, (arcs, 3, most modes)."""
        grid, free = self.grid, motion.free.copy()
        y = motion.at_nodes(grid)
        for a, k in self.held.free:
            on_arc, modes = grid.arc == a, grid.modes[a]
            torque = self.stage.values(y[on_arc].reshape(-1, 9), self.p)[:, TORQUE + k]
            shapes = grid.shapes[on_arc].reshape(-1, grid.most_modes)[:, :modes]
            fitted = np.linalg.lstsq(shapes, np.clip(torque, -1, 1), rcond=None)
            free[a, k, :modes] = fitted[0]
        return free

    def _with_multipliers(self, motion: Extremal) -> Extremal:
        """Those of least squares: where rows imply each other, as by symmetry, others differ."""
        names = ("costates", "multipliers", "entry", "pins")
        without = replace(motion, **{name: np.zeros_like(getattr(motion, name)) for name in names})
        step = System(self, without, least_squares=True).step()
        if step is None:
            return motion
        return replace(without, **{name: getattr(step, name) for name in names})

    def _polished(self, motion: Extremal) -> Extremal:
        """A converged motion with the multipliers that share its symmetry, if it has any."""
        motion = self._with_multipliers(motion)
        step = System(self, motion).step(redundant=1e-8)
        return motion if step is None else motion + step

    def between(self, motion: Extremal) -> Array:
        """y = (X, V, A) at ``DENSE`` fractions of the intervals, (n, dense, 9)."""
        return motion.at(self.grid, DENSE, self.grid.at_dense)

    def prices(self, motion: Extremal) -> Array:
        """Of what is held at the nodes, duration per value and time, (n, nodes, 3)."""
        weight = motion.intervals(self.grid)[:, None] * self.grid.quadrature
        return np.asarray(motion.multipliers / weight[..., None])

    def prices_between(self, motion: Extremal) -> Array:
        """The same at ``DENSE``, (n, dense, 3)."""
        return np.asarray(self.grid.at_dense[2] @ self.prices(motion))

    def hamiltonian(self, motion: Extremal) -> Array:
        """p · (V, A) at the beginning and the end of every interval, (n, 2)."""
        y = motion.at_nodes(self.grid)
        first, last = System(self, motion).costates, motion.costates
        ends = [(y[:, 0, 3:] * first).sum(axis=1), (y[:, -1, 3:] * last).sum(axis=1)]
        return np.stack(ends, axis=1)

    def polynomial(self, motion: Extremal, scales: Scales) -> PiecewisePolynomial:
        """In m and s, without arcs of no or negative length."""
        h = motion.intervals(self.grid)
        kept = h > 1e-9
        h, A = h[kept], motion.A[kept]
        X, V = motion.knots[:-1][kept, :3], motion.knots[:-1][kept, 3:]
        coefficients = self.grid.transcription.coefficients(X, V, A, h)
        return scales.polynomial(h, coefficients, scales.time)
