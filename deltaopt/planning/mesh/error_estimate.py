"""How much time a solution on a mesh gives away, from that solution alone.

A multiplier is the price of a limit: by so much the duration falls if the limit is raised a
little. Where a limit has a price the optimal motion is at it all the time; a motion made of
polynomials is at it only where the mesh imposes it. What it leaves unused in between, at that
price, is the time given away:

    given away in an interval ≈ Σ_limits Σ_points price · mean over the interval of (1 ∓ load)

(a dual weighted residual). Where the motion exceeds a limit in between, the whole of it must
be slowed: that is the other part of the gap, and it is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FRACTIONS = np.linspace(0.0, 1.0, 25)
"""Where in every interval the loads are taken, both ends included."""
SAFETY_FACTOR = 1.25
"""Times what is estimated to be given away: one estimate in ten falls short by as much."""
TIGHTENED = 4e-3
"""Of the duration: what exceeds a limit in shorter intervals is cured by tightening it there."""
_SHORTEST = 1e-4
"""No interval is split into shorter ones: acceleration, a second difference of positions at
knots, is known to rounding over the square of the length."""


@dataclass(frozen=True)
class ErrorEstimate:
    """Fractions of the duration, per interval of a mesh, (N,).

    ``unused``: limits not made use of. ``exceeded``: what slowing down for this interval costs.
    """

    unused: Array
    exceeded: Array

    @property
    def total(self) -> float:
        """By how much the unslowed motion is estimated to be too long."""
        return float(self.unused.sum())


def error_estimate(multipliers: Array, loads: Array, slowing: Array) -> ErrorEstimate:
    """From normalised rows at ``FRACTIONS`` of the intervals, (N, len(FRACTIONS), rows), and the
    multipliers of their bounds, (N, points, rows), positive at upper bounds and negative at lower.

    ``slowing``: by what factor each interval asks the motion to be slowed, (N,).
    """
    trapezoid = np.ones(len(FRACTIONS))
    trapezoid[[0, -1]] = 0.5
    mean = np.einsum("c,nck->nk", trapezoid / trapezoid.sum(), loads)
    upper = np.maximum(multipliers, 0).sum(axis=1)
    lower = np.maximum(-multipliers, 0).sum(axis=1)
    unused = (upper * (1 - mean) + lower * (1 + mean)).sum(axis=1)
    return ErrorEstimate(np.maximum(unused, 0.0), np.maximum(slowing - 1, 0.0))


def refined(mesh: Array, lost: ErrorEstimate, aim: float, most: int = 6) -> Array:
    """The mesh, (N,), with intervals split, into ``most`` pieces at most, so that what is given
    away falls to about ``aim``.

    In an interval where a torque jumps the loss falls with the square of its length, in
    others faster. Where an interval is short an excess is no reason to split it.
    """
    exceeded = np.where(mesh > TIGHTENED, lost.exceeded, 0.0)
    share = lost.unused / (aim / len(mesh)) + exceeded / aim
    pieces = np.clip(np.ceil(np.sqrt(share)), 1, np.clip(mesh / _SHORTEST, 1, most)).astype(int)
    return np.repeat(mesh / pieces, pieces)
