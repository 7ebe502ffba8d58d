"""Multipliers of the limits of a motion on a given path.

Sweeps find the fastest motion without multipliers. By what share the duration grows as the bound of
a row is tightened follows from two more sweeps on the same mesh, with all that bound a little
further out and further in: on one mesh errors of the mesh cancel.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np

from deltaopt.limits.constraints import Constraints
from deltaopt.planning.path.path_mesh import MeshMotion, PathMesh
from deltaopt.planning.path.path_rows import AffineRows, kept_rows
from deltaopt.planning.path.sweep import Unattainable, swept
from deltaopt.scene.path import Array, Index

_STEP = 1e-4
"""Share of a bound by which it is moved to and fro: its cube is what the difference of both
durations errs by, which sweeps know to some 1e-12."""


@dataclass(frozen=True, eq=False)
class PathMultipliers:
    """Those of the fastest motion on a mesh.

    ``tangents``: the rows that it was found with. ``owners``: which kept row each of them stands
    for. ``ends``: ṡ² at start and goal.
    """

    constraints: Constraints
    mesh: PathMesh
    tangents: AffineRows
    owners: Index
    ends: tuple[float, float]

    def of_rows(self) -> Array:
        """By what share the duration grows per unit by which the bound of each normalised row is
        tightened, all along the path, (rows,); NaN where no motion keeps a tighter bound."""
        kept, found = kept_rows(self.constraints), np.zeros(self.constraints.number)
        # Rows of order 1 are swept as their squares, whose bounds move twice as much.
        moves = np.where(self.constraints.orders[kept] == 1, 2.0, 1.0)
        for k, row in enumerate(kept.tolist()):
            found[row] = moves[k] * self._growth(k)
        return found

    def _growth(self, kept: int) -> float:
        """d ln T by the bound of one kept row as it is swept."""
        by = np.where(self.owners == kept, _STEP, 0.0)
        try:
            tighter, wider = (self._log_duration(sign * by) for sign in (1, -1))
        except Unattainable:
            return float("nan")
        return max(0.0, (tighter - wider) / (2 * _STEP))

    def _log_duration(self, by: Array) -> float:
        rows = self.tangents.tightened(by)
        return log(MeshMotion(self.mesh, swept(self.mesh.h, rows, *self.ends)).duration)
