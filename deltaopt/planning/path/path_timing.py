"""The fastest motion on a given path: mesh refinement until the gap is within a tolerance.

On each mesh the limits hold at both ends of every cell. In between they are exceeded, or not used,
by amounts that fall with the square of the cells' durations. Cells in which these amounts cost most
time are split; at last the bounds are moved inwards, cell by cell, by as much as they are exceeded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import Infeasible, in_words
from deltaopt.planning.path.on_mesh import OnMesh, Tangency, fastest_on_mesh
from deltaopt.planning.path.path_mesh import MeshMotion, PathMesh
from deltaopt.planning.path.path_rows import PathRows
from deltaopt.planning.path.sweep import Unattainable

_FIRST, _EVEN = (24, 96, 384), 40
"""Cells of the first mesh, of others where it has no motion, and of the second, which are of equal
time by the first."""
_MOST_PARTS = 4
"""Of a cell at a time: rows inside of a coarse cell say little of much smaller ones."""
_NEGLIGIBLE = 0.05
"""Share of the tolerance by which a limit may be exceeded before it is tightened: what is left
costs half of it in duration."""
_SAFETY = 1.3
"""Factor on the estimated loss: without it 2 of 1,000 random plans were further from the optimum
than they said, by a quarter at most."""
_MORE = 1.1
"""Factor on what bounds are moved by: rows are looked at in three places of a cell only."""
_STRONGER = 5.0
"""By how much bounds are moved further where moving them before had a lesser effect, as where
motions of neighbouring cells give way to each other."""
_MOST_TIGHTER = 0.5
"""Of a limit: more leaves nothing to hold the robot with."""
_MOST_MOTIONS, _MOST_TIGHTENED = 40, 8
_MOST_CELLS = 20_000
_CHANGE = 0.1
"""Share of the tolerance by which the duration may still change when tangents are taken anew."""


@dataclass
class PathTiming:
    """Times the path of rows as fast as they allow.

    ``tolerance``: relative gap of the duration. ``report``: is called with a line of text after
    every mesh. ``meshes``: how many were solved so far.
    """

    rows: PathRows
    tolerance: float
    report: Callable[[str], None]
    meshes: int = field(default=0, init=False)

    def fastest(self, share: float) -> tuple[OnMesh, float]:
        """The fastest motion, on a mesh whose loss is a ``share`` of the tolerance before limits
        are tightened, and the relative loss of time that is estimated for it. Limits may be
        exceeded between nodes by what costs little when it is slowed.

        Raises Infeasible where there is none.
        """
        return self.tightened(self.refined(share))

    def refined(self, share: float) -> OnMesh:
        """The fastest motion on a mesh on which its loss is a ``share`` of the tolerance. Raises
        Infeasible where there is none, or it comes to a standstill."""
        enough = share * self.tolerance
        before = earlier = self._first()
        mesh = before.evenly(_EVEN)
        for _ in range(_MOST_MOTIONS):
            found = self._on(mesh, self._tangency(mesh, before, earlier))
            loss, motion = found.losses, found.motion
            changed = abs(motion.duration / before.duration - 1)
            if loss.sum() <= enough:
                if self.rows.are_affine or changed <= _CHANGE * self.tolerance:
                    break
            else:
                parts = np.clip(loss / (enough / 2 / len(loss)), 1.0, _MOST_PARTS**3) ** (1 / 3)
                mesh = mesh.split(np.ceil(parts).astype(np.intp))
            earlier, before = before, motion
            if len(mesh.h) > _MOST_CELLS:
                break
        if found.motion.stops.any():
            raise Infeasible("the path: no speed but standstill keeps the limits somewhere on it")
        return found

    def _first(self) -> MeshMotion:
        """The fastest motion on a first, coarse mesh; a finer one where that has none."""
        for cells in _FIRST:
            mesh = PathMesh.first(self.rows.path, cells)
            guess = self._usual_speed(mesh)
            try:
                return self._on(mesh, Tangency(guess, guess)).motion
            except Infeasible as error:
                self.report(f"{cells} cells: {error}")
                obstacle = error
        raise obstacle

    def tightened(self, found: OnMesh, margins: Array | None = None) -> tuple[OnMesh, float]:
        """A motion on the same mesh that hardly exceeds its limits between nodes, and its loss; or
        one that keeps them by ``margins``, parts of them in each cell, (N,).

        What that costs is the difference of both durations: a limit that is tightened in one cell
        may slow the motion far beyond it.
        """
        raw = found
        most = _NEGLIGIBLE * self.tolerance if margins is None else 0.0
        margin = np.zeros(len(found.losses)) if margins is None else margins
        by, before = np.tile(margin[:, None], found.beyond.shape[2]), found.motion
        excess = step = np.zeros_like(by)
        tangency, mesh = found.tangency, found.motion.mesh
        for _ in range(_MOST_TIGHTENED):
            earlier, excess = excess, found.beyond.max(axis=1) + margin[:, None]
            if excess.max() <= most:
                break
            with np.errstate(divide="ignore", invalid="ignore"):  # by the step's own effect
                more = np.clip(np.nan_to_num(step / (earlier - excess), nan=1.0), 1.0, _STRONGER)
            step = _MORE * more * np.maximum(excess, 0.0)
            by = np.minimum(by + step, _MOST_TIGHTER)
            if not self.rows.are_affine:
                tangency = self._tangency(mesh, found.motion, before)
            before = found.motion
            try:
                found = self._on(mesh, tangency, by[:, self.rows.owners])
            except Infeasible as error:  # what is left costs duration instead
                self.report(f"with limits tightened: {error}")
                break
        cost = max(found.motion.duration / raw.motion.duration - 1, 0.0)
        return found, _SAFETY * (float(raw.losses.sum()) + cost)

    def _on(self, mesh: PathMesh, tangency: Tangency, tighter: Array | None = None) -> OnMesh:
        """The fastest motion on a mesh, and what it does between nodes."""
        try:
            found = fastest_on_mesh(self.rows, mesh, tangency, tighter)
        except Unattainable as error:
            raise Infeasible(self._obstacle(mesh, error.node)) from None
        self.meshes += 1
        self.report(
            f"{len(mesh.h)} intervals: {found.motion.duration:.6f} s, known to "
            f"{found.losses.sum():.1e}, limits exceeded by {max(found.beyond.max(), 0.0):.1e} "
            "between points"
        )
        return found

    def _usual_speed(self, mesh: PathMesh) -> tuple[Array, Array]:
        """b and u for tangents where no motion is known yet: at constant speed."""
        n = 2 * len(mesh.h)
        return np.full(n, self.rows.usual_speed**2), np.zeros(n)

    def _tangency(self, mesh: PathMesh, motion: MeshMotion, before: MeshMotion) -> Tangency:
        """At a motion and, for rows that are curved, halfway to the one before: where motions
        change to and fro about a corner of tangents the best one is there."""
        if self.rows.are_affine:
            usual = self._usual_speed(mesh)
            return Tangency(usual, usual)
        last = motion.states_at_ends(mesh)
        if not len(self.rows.curved):
            return Tangency(last, last)
        b, u = before.states_at_ends(mesh)
        return Tangency(last, ((last[0] + b) / 2, (last[1] + u) / 2))

    def _obstacle(self, mesh: PathMesh, node: int | None) -> str:
        if node is None:
            return "the path: its speed at the start is more than what can be slowed down in time"
        place = in_words(self.rows.path(mesh.nodes[node])[0])
        return f"the path: at {place} m no speed along it keeps the limits and leads to the goal"
