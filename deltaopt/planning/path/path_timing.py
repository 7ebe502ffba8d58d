"""The fastest motion on a given path: mesh refinement until the gap is within a tolerance.

On each mesh the limits hold at both ends of every cell. In between they are exceeded, or not used,
by amounts that fall with the square of the cells' durations. Cells in which these amounts cost most
time are split; at last the bounds are moved inwards, cell by cell, by as much as they are exceeded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from deltaopt.errors import Infeasible, in_words
from deltaopt.planning.nlp.program import Spent
from deltaopt.planning.path.path_mesh import MeshMotion, PathMesh
from deltaopt.planning.path.path_rows import AffineRows, PathRows
from deltaopt.planning.path.sweep import Unattainable, swept
from deltaopt.scene.path import Array, Path

_FIRST, _EVEN = 24, 40
"""Cells of the first mesh, and of the second, which are of equal time by the first."""
_INSIDE = np.array([0.2, 0.5, 0.8])
"""Fractions of a cell where rows are looked at between its ends."""
_MOST_PARTS = 4
"""Of a cell at a time: rows inside of a coarse cell say little of much smaller ones."""
_NEGLIGIBLE = 0.05
"""Share of the tolerance by which a limit may be exceeded before it is tightened: what is left
costs half of it in duration."""
_MORE = 1.1
"""Factor on what bounds are moved by: rows are looked at in three places of a cell only."""
_MOST_TIGHTER = 0.5
"""Of a limit: more leaves nothing to hold the robot with."""
_MOST_MOTIONS, _MOST_TIGHTENED = 40, 8
_MOST_CELLS = 20_000
_CHANGE = 0.1
"""Share of the tolerance by which the duration may still change when tangents are taken anew."""


@dataclass(frozen=True)
class PathIteration:
    """The record of one mesh of a path: ``duration``, s; estimated ``loss``, of the duration;
    largest ``excess`` of a limit between nodes, of the limit; seconds ``spent`` on rows and on
    sweeps."""

    intervals: int
    duration: float
    loss: float
    excess: float
    spent: Spent

    def __str__(self) -> str:
        return (
            f"{self.intervals} intervals: {self.duration:.6f} s, known to {self.loss:.1e}, limits "
            f"exceeded by {max(self.excess, 0.0):.1e} between points"
        )


@dataclass
class PathTiming:
    """Times a path as fast as rows allow, between given ṡ² at its ``ends``.

    ``tolerance``: relative gap of the duration. ``report``: is called with a line of text after
    every mesh. ``iterations``: of the meshes so far.
    """

    path: Path
    rows: PathRows
    ends: tuple[float, float]
    tolerance: float
    report: Callable[[str], None]
    iterations: list[PathIteration] = field(default_factory=list, init=False)
    _spent: Spent = field(default=Spent(0.0, 0.0), init=False)

    def fastest(self, share: float, margin: float | None = None) -> MeshMotion:
        """The fastest motion, on a mesh whose loss is a ``share`` of the tolerance before limits
        are tightened. Where it may be slowed afterwards (``margin`` None) limits may be
        exceeded between nodes by what costs little; otherwise they are tightened until none is, and
        all by the ``margin``, a part of them, as well.

        Raises Infeasible where there is none.
        """
        enough = share * self.tolerance
        mesh = PathMesh.first(self.path, _FIRST)
        guess = self._usual_speed(mesh)
        affine = self.rows.are_affine(mesh.ends)
        motion = self._swept(mesh, self.rows.tangents(mesh.ends, guess, guess))
        mesh, before, earlier = motion.evenly(_EVEN), motion, motion
        for _ in range(_MOST_MOTIONS):
            tangents = self._tangents(mesh, before, earlier)
            motion = self._swept(mesh, tangents)
            beyond = self._beyond(motion)
            loss = _losses(motion, beyond)
            self._record(motion, beyond, loss)
            changed = not affine and abs(motion.duration / before.duration - 1)
            if loss.sum() <= enough:
                if changed <= _CHANGE * self.tolerance:
                    break
            else:
                target = enough / 2 / len(loss)
                parts = np.ceil(np.clip(loss / target, 1.0, _MOST_PARTS**3) ** (1 / 3))
                parts = parts.astype(np.intp)
                mesh = mesh.split(parts)
            earlier, before = before, motion
            if len(mesh.h) > _MOST_CELLS:
                break
        if motion.stops.any():
            raise Infeasible("the path: no speed but standstill keeps the limits somewhere on it")
        return self._tightened(motion, tangents, beyond, margin, affine)

    def loss(self, motion: MeshMotion) -> float:
        """Estimated relative loss of a motion."""
        return float(_losses(motion, self._beyond(motion)).sum())

    def _tightened(
        self,
        motion: MeshMotion,
        tangents: AffineRows,
        beyond: Array,
        margin: float | None,
        affine: bool,
    ) -> MeshMotion:
        """A motion on the same mesh that hardly exceeds its limits between nodes."""
        most = _NEGLIGIBLE * self.tolerance if margin is None else 0.0
        by, before = np.full(beyond[:, 0].shape, margin or 0.0), motion
        beyond = beyond + (margin or 0.0)
        for _ in range(_MOST_TIGHTENED):
            excess = beyond.max(axis=1)
            if excess.max() <= most:
                break
            by = np.minimum(by + _MORE * np.maximum(excess, 0.0), _MOST_TIGHTER)
            if not affine:
                tangents = self._tangents(motion.mesh, motion, before)
            of_rows = np.repeat(by[:, self.rows.owners], 2, axis=0)
            before = motion
            try:
                motion = self._swept(motion.mesh, tangents.tightened(of_rows))
            except Infeasible:  # what is left costs duration instead
                break
            beyond = self._beyond(motion) + (margin or 0.0)
            self._record(motion, beyond, _losses(motion, beyond))
        return motion

    def _usual_speed(self, mesh: PathMesh) -> tuple[Array, Array]:
        """b and u for tangents where no motion is known yet: the path in some tenths of a second,
        at constant speed."""
        n = 2 * len(mesh.h)
        return np.full(n, (float(mesh.nodes[-1] - mesh.nodes[0]) / 0.3) ** 2), np.zeros(n)

    def _tangents(self, mesh: PathMesh, motion: MeshMotion, before: MeshMotion) -> AffineRows:
        """At a motion and, for rows that are curved, halfway to the one before: where motions
        change to and fro about a corner of tangents the best one is there."""
        begin = perf_counter()
        last = motion.states_at_ends(mesh)
        halfway = last
        if len(self.rows.curved):
            b, u = before.states_at_ends(mesh)
            halfway = (last[0] + b) / 2, (last[1] + u) / 2
        found = self.rows.tangents(mesh.ends, last, halfway)
        self._spent += Spent(perf_counter() - begin, 0.0)
        return found

    def _swept(self, mesh: PathMesh, rows: AffineRows) -> MeshMotion:
        begin = perf_counter()
        try:
            motion = MeshMotion(mesh, swept(mesh.h, rows, *self.ends))
            self._spent += Spent(0.0, perf_counter() - begin)
        except Unattainable as error:
            raise Infeasible(self._obstacle(mesh, error.node)) from None
        return motion

    def _obstacle(self, mesh: PathMesh, node: int | None) -> str:
        if node is None:
            return "the path: its speed at the start is more than what can be slowed down in time"
        place = in_words(self.path(mesh.nodes[node])[0])
        return f"the path: at {place} m no speed along it keeps the limits and leads to the goal"

    def _beyond(self, motion: MeshMotion) -> Array:
        """By how much rows are exceeded inside of cells, (N, places, rows)."""
        b, u = motion.at(_INSIDE)
        begin = perf_counter()
        found = self.rows.beyond(motion.mesh.places(_INSIDE), b.ravel(), u.ravel())
        self._spent += Spent(perf_counter() - begin, 0.0)
        return found.reshape(*b.shape, -1)

    def _record(self, motion: MeshMotion, beyond: Array, loss: Array) -> None:
        found = PathIteration(
            len(motion.mesh.h),
            motion.duration,
            float(loss.sum()),
            float(beyond.max()),
            self._spent,
        )
        self._spent = Spent(0.0, 0.0)
        self.iterations.append(found)
        self.report(str(found))


def _losses(motion: MeshMotion, beyond: Array) -> Array:
    """Relative loss of time in each cell, (N,), infinite where the motion stops: the part of the
    nearest limit that is exceeded or not used. Limits are those of squares of speeds, so that half
    of it would do, if gravity did not take its share of the torques."""
    missed = np.abs(beyond.max(axis=2)).mean(axis=1)
    missed = np.where(motion.stops, np.inf, missed)
    return np.asarray(missed * motion.durations / motion.duration)
