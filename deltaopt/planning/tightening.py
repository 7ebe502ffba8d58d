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

from deltaopt.planning.gap import FRACTIONS, TIGHTENED
from deltaopt.planning.scales import Scales
from deltaopt.planning.transcription import LINEAR

Array = NDArray[np.float64]

_POINTS = np.abs(FRACTIONS[:, None] - LINEAR.points).argmin(axis=0)
_MORE = 1.25
"""Times the excess that was seen: the next motion's is about the same."""
_REMEMBERED = 0.9
"""Of what an interval was tightened by the last time: otherwise it would be exceeded again."""
_NEAR_LIMIT = 0.95
"""Smaller loads exceed nothing."""
_LEAST = 0.9
"""Of a limit that remains."""


@dataclass(frozen=True)
class Overshoot:
    """By how much loads between the points of a mesh, (N,), exceed those at the points, as
    fractions of their limits: ``each``, (N, 3 or 6), torques and then limited speeds."""

    mesh: Array
    each: Array

    @classmethod
    def of(cls, mesh: Array, torque: Array, speed: Array | None) -> Overshoot:
        """From loads at ``FRACTIONS`` of the intervals, (N, len(FRACTIONS), 3)."""
        loads = np.abs(torque if speed is None else np.concatenate([torque, speed], axis=2))
        highest = loads.max(axis=1)
        over = highest - loads[:, _POINTS].max(axis=1)
        return cls(mesh, np.where(highest > _NEAR_LIMIT, over, 0.0))

    def tightened(self, scales: Scales, mesh: Array) -> Scales:
        """Scales for a mesh that divides this one: the limits that its motion may use."""
        over = self.each / self.mesh[:, None]
        if len(mesh) == len(self.mesh):
            before = (1 - scales.shares(len(mesh))[:, : over.shape[1]]) / _MORE
            over = np.maximum(over, _REMEMBERED * before / self.mesh[:, None])
        beside = np.pad(over, ((1, 1), (0, 0)))  # the jump may come to lie in the next interval
        over = np.maximum(over, np.maximum(beside[:-2], beside[2:]))
        inside = np.searchsorted(np.cumsum(self.mesh)[:-1], np.cumsum(mesh) - mesh / 2)
        share = np.maximum(1 - _MORE * over[inside] * mesh[:, None], _LEAST)
        share[mesh > TIGHTENED] = 1.0
        torque, speed = share[:, None, :3], share[:, None, 3:]
        return replace(scales, torque_share=torque, speed_share=speed if speed.size else 1.0)
