"""Constraint tightening: lower limits where a motion would exceed them between its mesh points.

Where a torque of the best motion jumps inside an interval so does its acceleration, which a
polynomial cannot follow: between the points where limits are imposed the other torques exceed them,
by an amount proportional to the length of the interval. Shorter intervals reduce that slowly, and
slowing the motion makes all intervals pay for one. A limit lowered by the excess in that interval
alone costs the excess times the limit's multiplier there, which is small if the interval is short.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.mesh.error_estimate import FRACTIONS, TIGHTENED
from deltaopt.planning.nlp.scaling import UNTIGHTENED, Scaling

Array = NDArray[np.float64]
Truths = NDArray[np.bool]

_OVERSHOOT_FACTOR = 1.25
"""Tightening over the overshoot that was seen. The next motion overshoots about as much; a larger
factor costs time, a smaller one further solves."""
_KEPT_SHARE = 0.9
"""Share of the last tightening that is kept at least on an interval that was not split. Without
it, a limit that is just kept would be released and exceeded again."""
_NEAR_LIMIT = 0.99
"""Rows whose largest value in an interval exceeds this share of the bound are tightened: the next
motion may bring them to their bound."""
_SMALLEST_SHARE = 0.9
"""Smallest share of a limit that tightening leaves, so that one interval cannot slow the motion
much."""


@dataclass(frozen=True)
class Overshoot:
    """By how much rows between the points of an interval exceed the same rows at its points.

    ``mesh``: lengths of the intervals, fractions of the duration, (N,). ``each``: the overshoot as
    a share of the bound, (N, rows); zero for rows that are not to be tightened. ``anywhere``: rows
    that are tightened in intervals of any length, (rows,).
    """

    mesh: Array
    each: Array
    anywhere: Truths | bool = False

    @classmethod
    def of(
        cls,
        mesh: Array,
        points: Array,
        size: Array,
        tightened: Truths,
        anywhere: Truths | bool = False,
        shares: Array | float = 1.0,
    ) -> Overshoot:
        """Measure the overshoot on a mesh.

        ``points``: fractions of an interval where the bounds are imposed. ``size``: of the rows at
        ``FRACTIONS`` of the intervals, 1 at a bound, (N, len(FRACTIONS), rows). ``tightened``:
        which rows may be tightened, (rows,). ``anywhere``: as of the class.
        ``shares``: of their bounds that rows were to use, (N, rows): those of ``anywhere`` may
        exceed them at the points too, where a formulation's coordinates close loops at nodes alone.
        """
        at_points = np.abs(FRACTIONS[:, None] - points).argmin(axis=0)
        highest = size.max(axis=1)
        over = highest - size[:, at_points].max(axis=1)
        over = np.maximum(over, np.where(anywhere, highest - shares, 0.0))
        return cls(mesh, np.where((highest > _NEAR_LIMIT) & tightened, over, 0.0), anywhere)

    def tightened(self, scaling: Scaling, mesh: Array) -> Scaling:
        """The scaling with tightened limits for a next ``mesh``, which divides this one.

        ``scaling``: the one that the motion on this mesh was found with.
        """
        density = self.each / self.mesh[:, None]
        beside = np.pad(density, ((1, 1), (0, 0)))  # the jump may come to lie in the next interval
        density = np.maximum(density, np.maximum(beside[:-2], beside[2:]))
        inside = np.searchsorted(np.cumsum(self.mesh)[:-1], np.cumsum(mesh) - mesh / 2)
        over = _OVERSHOOT_FACTOR * density[inside] * mesh[:, None]
        used = 1 - scaling.shares(len(self.mesh))[inside]
        is_whole = mesh > 0.99 * self.mesh[inside]
        over = np.maximum(over, _KEPT_SHARE * used * is_whole[:, None])
        share = np.maximum(1 - over, _SMALLEST_SHARE)
        untouched = (mesh > TIGHTENED)[:, None] & np.logical_not(self.anywhere)
        share = np.where(untouched, UNTIGHTENED, share)
        return replace(scaling, share=share)
