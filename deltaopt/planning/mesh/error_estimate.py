"""Error estimate: how much longer a motion on a mesh takes than the best one, interval by interval.

The multiplier of a limit (its shadow price) says by how much the duration falls if the limit is
raised a little. Where it is not zero, the optimal motion is at the limit all the time; a motion
made of polynomials is at it only at the points where the mesh imposes it. The part of the limit
that is unused in between, times the multiplier, is lost time:

    lost in an interval ≈ Σ_limits Σ_points multiplier · mean over the interval of (1 ∓ row)

with normalised rows (a dual weighted residual). Where the motion exceeds a limit in between, all of
it must be slowed: that is the other part of the gap, and it is known exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FRACTIONS = np.linspace(0.0, 1.0, 25)
"""Fractions of every interval where constraint rows are evaluated, both ends included."""
SAFETY_FACTOR = 1.25
"""Factor on the estimated loss of time: about one estimate in ten falls short by as much. A larger
one makes the reported gap safer and plans slower."""
TIGHTENED = 4e-3
"""Length of an interval, as a fraction of the duration, up to which an exceeded limit is tightened
there instead of the interval being split. Tightening in longer intervals would cost more time."""
_SHORTEST = 1e-4
"""Shortest interval, as a fraction of the duration. Accelerations are second differences of the
positions at knots, so their rounding error grows with the inverse square of the length."""


@dataclass(frozen=True)
class ErrorEstimate:
    """Lost time per interval of a mesh, as fractions of the duration, (N,) each.

    ``unused``: estimated loss because limits are not fully used inside the interval. ``exceeded``:
    what it costs to slow the motion until this interval keeps its limits.
    """

    unused: Array
    exceeded: Array

    @property
    def total(self) -> float:
        """Estimated relative excess of the duration of the motion before it is slowed."""
        return float(self.unused.sum())


def error_estimate(multipliers: Array, loads: Array, slowing: Array) -> ErrorEstimate:
    """Estimate the lost time of a mesh solution.

    ``multipliers``: of the rows' bounds, (N, points, rows), positive at upper bounds and negative
    at lower ones. ``loads``: normalised rows at ``FRACTIONS`` of the intervals, (N,
    len(FRACTIONS), rows). ``slowing``: factor by which the motion must be slowed for each
    interval to keep its limits, (N,).
    """
    trapezoid = np.ones(len(FRACTIONS))
    trapezoid[[0, -1]] = 0.5
    mean = np.einsum("c,nck->nk", trapezoid / trapezoid.sum(), loads)
    upper = np.maximum(multipliers, 0).sum(axis=1)
    lower = np.maximum(-multipliers, 0).sum(axis=1)
    unused = (upper * (1 - mean) + lower * (1 + mean)).sum(axis=1)
    return ErrorEstimate(np.maximum(unused, 0.0), np.maximum(slowing - 1, 0.0))


def refined(mesh: Array, lost: ErrorEstimate, target: float, most: int = 6) -> Array:
    """Split the intervals of a mesh, (N,), so that the lost time falls to about ``target``.

    Each is split evenly into ``most`` pieces at most. In an interval where a torque jumps the loss
    falls with the square of its length, in others faster. An exceeded limit is no reason to split
    a short interval, for the limit is tightened there.
    """
    exceeded = np.where(mesh > TIGHTENED, lost.exceeded, 0.0)
    share = lost.unused / (target / len(mesh)) + exceeded / target
    pieces = np.clip(np.ceil(np.sqrt(share)), 1, np.clip(mesh / _SHORTEST, 1, most)).astype(int)
    return np.repeat(mesh / pieces, pieces)
