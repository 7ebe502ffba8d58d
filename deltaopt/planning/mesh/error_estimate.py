"""Error estimate: how much longer a motion on a mesh takes than the best one, interval by interval.

The multiplier of a limit (its shadow price) says by how much the duration falls if the limit is
raised a little. Where it is not zero, the optimal motion is at the limit all the time; a motion
made of polynomials is at it only at the points where the mesh imposes it. The part of the limit
that is unused in between, times the multiplier, is lost time (a dual weighted residual). For rows
normalised to ±1 and the multiplier's density λ over the time t,

    lost in an interval ≈ Σ_limits ∫ |λ| (1 - row · sign λ) dt

A control (order 2, such as a torque) jumps from one limit to the other where λ crosses zero. A mesh
solution cannot: it may be at neither limit in all of the interval, and then its own multipliers
there are zero, although time is lost. So λ of a control is interpolated linearly in time between
the middles of the intervals. The density of a limit of order 1, such as a speed, begins and ends
with the part of the motion that is at the limit; it is taken to lie where the row is largest. But
the fastest motion has a control at its limit until then: where none is, the way there is lost too.

Where the motion exceeds a limit in between, all of it must be slowed: that is the other part of the
gap, and it is known exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deltaopt.curves.piecewise import Array, Index, Truths, with_neighbours
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.nlp.phases import joined
from deltaopt.planning.nlp.softening import turning
from deltaopt.problem.problem import Problem

FRACTIONS = np.linspace(0.0, 1.0, 25)
"""Fractions of every interval where constraint rows are evaluated, both ends included."""
_MEAN = np.where((FRACTIONS == 0) | (FRACTIONS == 1), 0.5, 1.0) / (len(FRACTIONS) - 1)
"""Weights of a mean over an interval, by the trapezoidal rule."""
_ABOUT_THE_MIDDLE = np.stack(
    [np.ones(len(FRACTIONS)), np.minimum(FRACTIONS - 0.5, 0), np.maximum(FRACTIONS - 0.5, 0)]
)
"""1, and the distances from the middle of an interval before it and after it, (3, samples)."""
_HALVES = np.array([np.abs(FRACTIONS - middle) <= 0.25 for middle in (0.25, 0.5, 0.75)]) / 13
"""Weights of means over the first half, the middle half and the last half of an interval. A limit
of the state that is reached or left inside an interval is unused in the rest of it, by the best
motion too. Means over the whole would charge that, parts shorter than half too little."""
_BUSY = 0.5
"""Share of its limit from which on a control counts as at it: jumps are blurred on a mesh."""
SAFETY_FACTOR = 1.25
"""Factor on the estimated loss of time: about one estimate in ten falls short by as much. A larger
one makes the reported gap safer and plans slower."""
_TIGHTENED, _BESIDE_FRICTION = 4e-3, 4e-4
"""Length of an interval, as a fraction of the duration, up to which an exceeded limit is tightened
there instead of the interval being split. Tightening in longer intervals would cost more time. The
second where rates of torques are limited and Coulomb friction changes its sign: no tightening at
the points of an interval helps against a rate that peaks between two of them."""
_MOST_PIECES = 6
"""Into which an interval is split at once."""
_SHORTEST, _SHORTEST_THIRD, _USUAL = 5e-5, 1e-4, 16.0
"""Shortest interval, as a fraction of the duration, and where three after each other are of equal
length, for accelerations up to the last, a motion's extent per square of its duration.
Accelerations are second differences of the positions at knots, and jerk a third one, so their
rounding error grows with the inverse square or cube of the length: where motors reach their speed
at once, and accelerations are as much greater, intervals may be shorter."""
_FOR_BODIES = 3.0
"""Pieces of an interval per loss at bodies in it, as shares of the loss that is aimed at: some
three intervals touch a body at its edge. More make meshes finer, fewer take more of them."""
_KEPT_WIDTH = 0.2
"""Share of its width that an interval keeps at least when a knot is moved. Very unequal neighbours
are badly conditioned."""


@dataclass(frozen=True)
class ErrorEstimate:
    """Lost time per interval of a mesh, as fractions of the duration, (N,) each.

    ``unused``: estimated loss because limits are not fully used inside the interval. ``exceeded``:
    what it costs to slow the motion until this interval keeps its limits. ``at_bodies``: the part
    of ``unused`` that is left between the motion and bodies; None without bodies.
    """

    unused: Array
    exceeded: Array
    at_bodies: Array | None = None

    @property
    def total(self) -> float:
        """Estimated relative excess of the duration of the motion before it is slowed."""
        return float(self.unused.sum())


def joined_estimate(lost: ErrorEstimate, together: int) -> ErrorEstimate:
    """An estimate of so many intervals after each other as one."""
    at_bodies = None if lost.at_bodies is None else joined(lost.at_bodies, together)
    exceeded = lost.exceeded.reshape(-1, together).max(axis=1)
    return ErrorEstimate(joined(lost.unused, together), exceeded, at_bodies)


def error_estimate(
    mesh: Array,
    multipliers: Array,
    loads: Array,
    controls: Truths,
    slowing: Array,
    *,
    is_fastest: bool = False,
) -> ErrorEstimate:
    """Estimate the lost time of a mesh solution.

    ``mesh``: lengths of the intervals, fractions of the duration, (N,). ``multipliers``: of the
    rows' bounds, (N, points, rows), positive at upper bounds and negative at lower ones.
    ``loads``: normalised rows at ``FRACTIONS`` of the intervals, (N, len(FRACTIONS), rows).
    ``controls``: which rows are controls, of the highest order, (rows,); the others are less.
    ``slowing``: factor by which the motion must be slowed for each interval to keep its limits,
    (N,). ``is_fastest``: whether a control must be at its limit wherever no state is, as for
    the least duration, though not for the least effort.
    """
    unused = _unused_controls(mesh, multipliers[:, :, controls], loads[:, :, controls])
    if not controls.all():
        idle = np.zeros(loads.shape[:2])
        if is_fastest:
            idle = (_BUSY - np.abs(loads[:, :, controls]).max(axis=2, initial=0.0)).clip(min=0.0)
        unused = unused + _unused_states(multipliers[:, :, ~controls], loads[:, :, ~controls], idle)
    return ErrorEstimate(np.maximum(unused, 0.0), np.maximum(slowing - 1, 0.0))


def _unused_controls(mesh: Array, multipliers: Array, loads: Array) -> Array:
    """The lost time of controls, (N,), by the interpolated density of their multipliers.

    Rows come first in all arrays: small products of the last axes are then fast.
    """
    middle = multipliers.sum(axis=1).T / mesh  # (rows, N)
    lengths = np.concatenate([mesh[:1], mesh, mesh[-1:]])
    beside = np.concatenate([middle[:, :1], middle, middle[:, -1:]], axis=1)
    slope = 2 * (beside[:, 1:] - beside[:, :-1]) / (lengths[1:] + lengths[:-1])
    terms = np.stack([middle, slope[:, :-1] * mesh, slope[:, 1:] * mesh], axis=2)
    density = terms @ _ABOUT_THE_MIDDLE  # (rows, N, samples)
    unused = np.abs(density) - density * np.moveaxis(loads, 2, 0)
    return np.asarray(mesh * (unused @ _MEAN).sum(axis=0))


def _unused_states(multipliers: Array, loads: Array, idle: Array) -> Array:
    """The lost time of limits of the state, (N,), in the half of an interval nearest to them; or in
    all of it by as much as every control is ``idle``, (N, samples), a share of its limits: where
    motors could have brought the motion to its limit sooner, all of the way there is lost."""
    rows = np.moveaxis(loads, 2, 0)
    halves, lost = rows @ _HALVES.T, np.zeros((len(loads), len(rows)))  # (rows, N, 3), (N, rows)
    for side in (1, -1):  # upper bounds, then lower ones
        nearest = 1 - (side * halves).max(axis=2)
        whole = np.maximum(1 - side * rows, 0.0) * idle @ _MEAN
        unused = nearest + np.maximum(whole - np.maximum(nearest, 0.0), 0.0)
        lost += np.maximum(side * multipliers, 0).sum(axis=1) * unused.T
    return np.asarray(lost.sum(axis=1))


def split(mesh: Array, pieces: int | Index) -> Array:
    """A mesh, (N,), with each interval split evenly into so many pieces, one number or (N,)."""
    return np.repeat(mesh / pieces, pieces)


def shortest_intervals(motion: Trajectory, together: int) -> Array:
    """Lengths below which so many intervals of a motion together must not be split, as fractions of
    the duration, (N,)."""
    begins_and_ends = np.linalg.norm(motion.accelerations_at_ends, axis=1)
    largest = begins_and_ends.reshape(-1, 2 * together).max(axis=1)
    by_usual = largest * motion.duration**2 / (_USUAL * motion.extent)
    shortest = _SHORTEST if together == 1 else _SHORTEST_THIRD
    return np.asarray(shortest / np.sqrt(np.maximum(by_usual, 1.0)))


def longest_tightened(problem: Problem, motion: Trajectory, mesh: Array) -> Array:
    """Lengths of intervals of a mesh, as fractions of the duration, up to which limits that a
    motion exceeds between their points are tightened at these; longer ones are split, (N,)."""
    if not problem.rates_peak:
        return np.full(len(mesh), _TIGHTENED)
    is_turning = with_neighbours(turning(problem, motion, mesh).astype(float)) > 0
    return np.where(is_turning, _BESIDE_FRICTION, _TIGHTENED)


def refined(
    mesh: Array, lost: ErrorEstimate, target: float, shortest: Array, tightened: Array
) -> Array:
    """Split the intervals of a mesh, (N,), so that the lost time falls to about ``target``.

    Each is split evenly into few pieces, none shorter than ``shortest``. In an interval where a
    torque jumps the loss falls with the square of its length, in others faster; beside a sharp edge
    of a body in proportion to it, and the motion may then touch the edge in the next interval. An
    exceeded limit is no reason to split an interval that is no longer than ``tightened``, for the
    limit is tightened there.
    """
    exceeded = np.where(mesh > tightened, lost.exceeded, 0.0)
    share = lost.unused / (target / len(mesh)) + exceeded / target
    wanted = np.ceil(np.sqrt(share))
    if lost.at_bodies is not None:
        wanted = np.maximum(wanted, np.ceil(_FOR_BODIES * with_neighbours(lost.at_bodies) / target))
    pieces = np.clip(wanted, 1, np.clip(mesh / shortest, 1, _MOST_PIECES)).astype(int)
    return split(mesh, pieces)


def with_knots_at(mesh: Array, instants: Array) -> Array:
    """A mesh, (N,), whose knots nearest to these instants are moved there, both as fractions of the
    duration: where a motion touches a body at an instant, a limit that is imposed there is not
    exceeded beside it."""
    knots = np.append(0.0, np.cumsum(mesh))
    for instant in instants.tolist():
        nearest = int(np.abs(knots[1:-1] - instant).argmin()) + 1
        before, after = knots[nearest - 1], knots[nearest + 1]
        room = min(instant - before, after - instant)
        if room > _KEPT_WIDTH * min(knots[nearest] - before, after - knots[nearest]):
            knots[nearest] = instant
    return np.diff(knots)
