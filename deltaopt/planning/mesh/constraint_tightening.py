"""Limits tightened where a motion would exceed them between the points of its mesh.

In an interval where a torque jumps the velocity bends, and between the points of a polynomial
the other torques exceed what they keep at them, in proportion to the interval's length. Ever
shorter intervals cure that slowly, and slowing the motion pays for one interval with all of
them. A limit that is lower by the excess in that interval alone costs the excess times the
limit's price there: next to nothing, if the interval is short.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.mesh.error_estimate import FRACTIONS, TIGHTENED
from deltaopt.planning.nlp.scaling import Scaling

Array = NDArray[np.float64]
Truths = NDArray[np.bool]

_OVERSHOOT_FACTOR = 1.25
"""Times the excess that was seen: the next motion's is about the same."""
_KEPT_SHARE = 0.9
"""Of what was tightened the last time: forgotten at once, a limit would be exceeded again."""
_NEAR_LIMIT = 0.99
"""The next motion may bring a load to its limit that comes so near to it."""
_SMALLEST_SHARE = 0.9
"""Of a limit that remains."""


@dataclass(frozen=True)
class Overshoot:
    """By how much rows between the points of a mesh, (N,), exceed those at the points: ``each``,
    (N, rows), shares of their bounds; zero for rows that are not to be tightened."""

    mesh: Array
    each: Array

    @classmethod
    def of(cls, mesh: Array, points: Array, size: Array, tightened: Truths) -> Overshoot:
        """From the size of rows at ``FRACTIONS`` of the intervals, 1 at a bound, (N,
        len(FRACTIONS), rows); bounds hold at other fractions, the ``points``. ``tightened``: which
        rows may be, (rows,)."""
        at_points = np.abs(FRACTIONS[:, None] - points).argmin(axis=0)
        highest = size.max(axis=1)
        over = highest - size[:, at_points].max(axis=1)
        return cls(mesh, np.where((highest > _NEAR_LIMIT) & tightened, over, 0.0))

    def tightened(self, scaling: Scaling, mesh: Array) -> Scaling:
        """The limits that a motion on a mesh that divides this one may use. ``scaling``: that with
        which the motion on this mesh was found."""
        density = self.each / self.mesh[:, None]
        beside = np.pad(density, ((1, 1), (0, 0)))  # the jump may come to lie in the next interval
        density = np.maximum(density, np.maximum(beside[:-2], beside[2:]))
        inside = np.searchsorted(np.cumsum(self.mesh)[:-1], np.cumsum(mesh) - mesh / 2)
        over = _OVERSHOOT_FACTOR * density[inside] * mesh[:, None]
        used = 1 - scaling.shares(len(self.mesh))[inside]
        is_whole = mesh > 0.99 * self.mesh[inside]
        over = np.maximum(over, _KEPT_SHARE * used * is_whole[:, None])
        share = np.maximum(1 - over, _SMALLEST_SHARE)
        share[mesh > TIGHTENED] = 1.0
        return replace(scaling, share=share)
