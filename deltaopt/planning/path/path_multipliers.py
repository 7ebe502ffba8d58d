"""Multipliers of the limits of a motion on a given path.

Sweeps find the fastest motion without multipliers. By what share the duration grows as the bound of
a row is tightened follows from two more sweeps on the same mesh, with all that bound a little
further out and further in: on one mesh errors of the mesh cancel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import log

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.planning.path.on_mesh import OnMesh, tangents_on
from deltaopt.planning.path.path_mesh import MeshMotion
from deltaopt.planning.path.path_rows import AffineRows, PathRows, kept_rows
from deltaopt.planning.path.sweep import Unattainable, swept

_STEP = 1e-4
"""Share of a bound by which it is moved to and fro: its cube is what the difference of both
durations errs by, which sweeps know to some 1e-12."""


@dataclass(frozen=True, eq=False)
class PathMultipliers:
    """Those of the fastest motion on a mesh.

    ``on_mesh``: that motion, and where the ``rows`` were replaced by tangents. ``ends``: ṡ² at
    start and goal.
    """

    limits: SceneLimits
    rows: PathRows
    on_mesh: OnMesh
    ends: tuple[float, float]

    def of_rows(self) -> Array:
        """By what share the duration grows per unit by which the bound of each normalised row is
        tightened, all along the path, (rows,); NaN where no motion keeps a tighter bound."""
        constraints = self.limits.constraints
        kept, found = kept_rows(constraints), np.zeros(constraints.number)
        # Rows of order 1 are swept as their squares, whose bounds move twice as much.
        moves = np.where(constraints.orders[kept] == 1, 2.0, 1.0)
        for k, row in enumerate(kept.tolist()):
            found[row] = moves[k] * self._growth(k)
        return found

    def _growth(self, kept: int) -> float:
        """d ln T by the bound of one kept row as it is swept."""
        by = np.where(self.rows.owners == kept, _STEP, 0.0)
        try:
            tighter, wider = (self._log_duration(sign * by) for sign in (1, -1))
        except Unattainable:
            return float("nan")
        return max(0.0, (tighter - wider) / (2 * _STEP))

    def _log_duration(self, by: Array) -> float:
        mesh, rows = self.on_mesh.motion.mesh, self._tangents.tightened(by)
        convex = self.rows.are_convex(mesh.path)
        return log(MeshMotion.of(mesh, swept(mesh.h, rows, *self.ends, convex=convex)).duration)

    @cached_property
    def _tangents(self) -> AffineRows:
        found = self.on_mesh
        return tangents_on(self.rows, found.motion.mesh, found.tangency, found.tighter)
