"""Newton's method for the conditions of optimality of one switching structure.

From a mesh solution it takes three or four steps. Where the structure is wrong it may find that
arcs vanish, or that the lengths of arcs become negative: the caller then changes the structure.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from deltaopt.curves.piecewise import Array, Truths
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.switching.conditions import OptimalityConditions
from deltaopt.planning.switching.kkt_system import KKTSystem
from deltaopt.planning.switching.unknowns import PrimalDualPoint

_ITERATIONS = 40
"""Most steps: those that converge take far fewer, also with a barrier."""
_FIRST_BARRIER, _FALL = 1e-2, 0.3
"""The barrier of the first step, if there is one, and by what factor it falls from step to step: a
lower one costs robustness."""
_PATIENCE, _PATIENCE_WITH_BARRIER, _FAR = 8, 20, 1.0
"""Steps without and with a barrier after which a residual that never came below ``_FAR`` is given
up. Structures that converge come below it in fewer; most of those that do not are recognised by
it, which saves most of the time that switch resolution once took."""
_CONVERGED = 1e-10
"""Largest residual of a converged point; rounding allows little less."""
_STALLED = 1e-7
"""Largest residual at which a point that no longer improves counts as converged: rounding leaves as
much where a motion is hardly determined. A larger one would hide slow convergence."""
_LONGEST_STEP, _LONGEST_WITH_BARRIER = 0.1, 0.3
"""Largest change of scaled states in a step, without and with a barrier: longer steps need fewer
iterations but leave the region where the equations are nearly linear."""
_SHRINK = 0.8
"""By what part an arc becomes shorter in a step at most, unless it is reversible: an arc may still
vanish, but in several steps, in which it can recover."""
_SMALLEST_SHIFT, _LARGEST_SHIFT = 1e-9, 1e-4
"""Range in which the curvature is shifted to shorten a step: beyond it the step is cut instead."""
_SHIFT_FALL = 30.0
"""By what factor the shift falls after a step: faster gives Newton's own steps back sooner."""
_CUTS = 4
"""How often a step that leaves the workspace is cut to a third."""
_TINY = 2e-3
"""Length, as a fraction of the duration, below which an arc that every step shortens by as much as
allowed is vanishing. A larger value gives up arcs that would recover, a smaller one costs steps."""
_SYMMETRIC = 1e-8
"""Shift of the costates' diagonal in the last step: large enough to keep the symmetry of the least-
squares multipliers, small enough to leave the motion converged."""


class NewtonFailed(Exception):
    """Newton's method does not converge from this motion for this structure."""


@dataclass(frozen=True)
class StationaryPoint:
    """Where Newton's method ended after so many ``iterations``.

    ``vanishing``: arcs whose length goes to zero, (arcs,); if there are any, or if lengths are
    negative, the point is not converged.
    """

    point: PrimalDualPoint
    iterations: int
    vanishing: Truths


def solve_conditions(
    conditions: OptimalityConditions, guess: Trajectory, scaling: Scaling
) -> StationaryPoint:
    """The stationary motion near a trajectory of about the same structure.

    Raises NewtonFailed.
    """
    start = _initial_point(conditions, guess, scaling)
    with np.errstate(all="ignore"):  # numbers that are not finite are looked for, and cut a step
        return _Newton(conditions, start).result()


class _Newton:
    """One run from a starting point."""

    def __init__(self, conditions: OptimalityConditions, start: PrimalDualPoint) -> None:
        self._last = conditions.barrier if conditions.within.any() else 0.0
        self._conditions, self._barrier = conditions, _FIRST_BARRIER if self._last else 0.0
        point = _with_slacks(conditions, start, self._barrier)
        self._system, self._shift = KKTSystem(conditions, point, self._barrier), 0.0
        self._residual = self._least = np.inf
        self._lengths = np.full(conditions.mesh.arcs, np.inf)

    def result(self) -> StationaryPoint:
        """Steps until the point has converged, or arcs are vanishing."""
        for iteration in range(_ITERATIONS):
            before, self._residual = self._residual, self._system.residual
            if not np.isfinite(self._residual):
                raise NewtonFailed("the motion leaves the workspace")
            vanishing = self._vanishing()
            stalled = before < 2 * self._residual < _STALLED
            converged = self._residual < _CONVERGED or stalled
            if converged and self._barrier <= self._last:
                return StationaryPoint(self._polished(), iteration, np.zeros_like(vanishing))
            if iteration > 2 and vanishing.any():
                return StationaryPoint(self._system.at, iteration, vanishing)
            self._give_up_if_far(iteration)
            self._barrier = max(self._barrier * _FALL, self._last)
            self._move()
        if self._lengths.min() < 0 and self._residual < 1:  # exchanged switches may converge
            return StationaryPoint(self._system.at, _ITERATIONS, np.zeros_like(vanishing))
        raise NewtonFailed(f"a residual of {self._residual:.0e} is left after {_ITERATIONS} steps")

    def _vanishing(self) -> Truths:
        """Arcs that are tiny and that the last step shortened as much as it may, (arcs,)."""
        shorter, at = np.abs(self._lengths), self._system.at
        self._lengths = at.lengths / at.duration
        length = np.abs(self._lengths)
        shrinks = (length < 0.7 * shorter) & (length > 0.9 * (1 - _SHRINK) * shorter)
        return np.asarray((length < _TINY) & shrinks)

    def _give_up_if_far(self, iteration: int) -> None:
        self._least = min(self._least, self._residual)
        patience = _PATIENCE_WITH_BARRIER if self._last else _PATIENCE
        if iteration >= patience and self._least > _FAR:
            left = f"a residual of {self._residual:.0e} is left after {iteration} steps"
            raise NewtonFailed(left)

    def _move(self) -> None:
        """Newton's step, the curvature shifted until the step is short, or a part of it where the
        largest shift does not suffice."""
        system, shift = self._system, self._shift
        longest = _LONGEST_WITH_BARRIER if self._barrier else _LONGEST_STEP
        step = system.step(shift)
        while (step is None or step.size > longest) and shift < _LARGEST_SHIFT:
            shift = max(10 * shift, _SMALLEST_SHIFT)
            step = system.step(shift)
        if step is None or not np.isfinite(step.size):
            raise NewtonFailed("there is no step")
        share = self._share(step, longest)
        for _ in range(_CUTS):
            moved = KKTSystem(self._conditions, system.at.moved(step, share), self._barrier)
            if np.isfinite(moved.residual):
                break
            share /= 3
        self._system = moved
        self._shift = shift / _SHIFT_FALL if shift > _SMALLEST_SHIFT else 0.0

    def _share(self, step: PrimalDualPoint, longest: float) -> float:
        """The part of a step that is taken."""
        lengths = self._system.at.lengths
        share = min(self._system.inside(step), longest / max(step.size, 1e-300))
        bounded = ~self._conditions.structure.reversible & (lengths > 0)
        shrink = -step.lengths / np.where(bounded, lengths, np.inf)
        return min(share, _SHRINK / max(float(shrink.max()), 1e-300))

    def _polished(self) -> PrimalDualPoint:
        """The converged point, without a barrier with the multipliers that share its symmetry,
        unless these lead away from it: where rows all but imply each other, they may."""
        converged = self._system.at
        if self._last:
            return converged
        point = _with_multipliers(self._conditions, converged)
        step = KKTSystem(self._conditions, point).step(redundant=_SYMMETRIC)
        polished = point if step is None else point.moved(step)
        left = KKTSystem(self._conditions, polished).residual
        return polished if left < _STALLED else converged


def _initial_point(
    conditions: OptimalityConditions, trajectory: Trajectory, scaling: Scaling
) -> PrimalDualPoint:
    """A starting point from a trajectory of about the same structure, its singular controls fitted
    and its multipliers estimated by least squares."""
    mesh, active = conditions.mesh, conditions.active
    lengths = np.clip(conditions.structure.lengths, 0.0, 1.0) * trajectory.duration
    h = mesh.interval_lengths(lengths)
    begin = np.concatenate([[0.0], np.cumsum(h)])
    inside = begin[:-1, None] + h[:, None] * np.clip(mesh.polynomials.nodes, 1e-6, 1 - 1e-6)
    D, T, n, m = scaling.length, scaling.time, mesh.intervals, conditions.rows.motors
    A = trajectory.position.at(inside.ravel(), 2).reshape(n, -1, m) * T**2 / D
    knots = scaling.states(trajectory.position, begin, T)
    knots[0], knots[-1] = 0.0, conditions.goal
    bounded = np.zeros(conditions.within.shape)
    point = PrimalDualPoint(
        knots=knots,
        A=A,
        lengths=lengths / T,
        costates=np.zeros((n, 2 * m)),
        multipliers=np.zeros(A.shape),
        entry=np.zeros(len(active.entries)),
        singular=np.zeros((mesh.arcs, m, mesh.most_modes)),
        end_values=np.zeros(len(conditions.end_values)),
        slack=bounded,
        upper=bounded,
        lower=bounded,
    )
    point = replace(point, singular=_fitted_controls(conditions, point))
    return _with_multipliers(conditions, point)


def _fitted_controls(conditions: OptimalityConditions, point: PrimalDualPoint) -> Array:
    """Legendre coefficients of singular controls fitted to the motion, (arcs, m, most modes)."""
    mesh, rows, fitted = conditions.mesh, conditions.rows, point.singular.copy()
    y = point.at_nodes(mesh)
    for a, k in conditions.active.singular:
        on_arc, modes = mesh.arc == a, mesh.modes[a]
        control = rows.values(y[on_arc].reshape(-1, y.shape[2]), conditions.p)[:, rows.control[k]]
        legendre = mesh.legendre[on_arc].reshape(-1, mesh.most_modes)[:, :modes]
        fitted[a, k, :modes] = np.linalg.lstsq(legendre, np.clip(control, -1, 1), rcond=None)[0]
    return fitted


def _with_slacks(
    conditions: OptimalityConditions, point: PrimalDualPoint, barrier: float
) -> PrimalDualPoint:
    """The point with slacks inside of the limits, and multipliers that fit the barrier."""
    mesh, within = conditions.mesh, conditions.within
    y, singular = point.at_nodes(mesh), mesh.singular_controls(point.singular)
    rows = conditions.rows.values(y.reshape(-1, y.shape[2]), conditions.p)
    bounded = rows[:, conditions.bounded].reshape(*y.shape[:2], -1)
    values = np.concatenate([singular, bounded], axis=2)
    slack = np.where(within, np.clip(values, -0.99, 0.99), 0.0)
    h = np.abs(point.interval_lengths(mesh))[:, None, None]
    weight = h * mesh.polynomials.quadrature[:, None] * within
    upper, lower = (barrier * weight / (1 + s * slack) for s in (-1, 1))
    return replace(point, slack=slack, upper=upper, lower=lower)


def _with_multipliers(conditions: OptimalityConditions, point: PrimalDualPoint) -> PrimalDualPoint:
    """The point with multipliers of least squares; unchanged if there are none. Where rows imply
    each other, as by symmetry, other multipliers would do as well."""
    names = ("costates", "multipliers", "entry", "end_values")
    without = replace(point, **{name: np.zeros_like(getattr(point, name)) for name in names})
    step = _MultiplierSystem(conditions, without).step(shift=1.0)
    if step is None:
        return point
    return replace(without, **{name: getattr(step, name) for name in names})


class _MultiplierSystem(KKTSystem):
    """The equations of a least-squares estimate of the multipliers at a motion: the identity takes
    the place of the curvature, and violations of primal conditions are left as they are. Without
    multipliers at bounds the barrier plays no part."""

    _removed = 0.0

    def _curvature(self) -> Array:
        size = self._y_slopes.shape[3]
        return np.broadcast_to(np.eye(size), (self.of.mesh.intervals, size, size))
