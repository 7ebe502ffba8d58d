"""Where the unknowns of a motion on a mesh lie among a program's variables.

For every interval: X_i, V_i, A_i0 … A_id, then algebraic unknowns at each of its points, then
those at its end; last X_N, V_N and T. X, V and A have m components, in units of the scene,
V and A with respect to time in units of T, so that the motion is linear in all of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from deltaopt.planning.nlp.program import Layout
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Variables:
    """Variables on a mesh of fractions (N,) of the duration, summing to 1.

    ``components``: m. ``points``: fractions of an interval with ``unknowns`` algebraic
    unknowns each. ``at_ends``: further unknowns at the end of every interval.
    """

    transcription: PiecewiseAcceleration
    mesh: Array
    components: int
    points: Array
    unknowns: int
    at_ends: int = 0

    @property
    def intervals(self) -> int:
        return len(self.mesh)

    @property
    def _motion(self) -> int:
        """X_i, V_i and A_ij of an interval."""
        return self.components * (2 + len(self.transcription.nodes))

    @property
    def _algebraic(self) -> int:
        return self.unknowns * len(self.points)

    @property
    def _block(self) -> int:
        return self._motion + self._algebraic + self.at_ends

    @property
    def _last(self) -> int:
        """X_N, V_N and T."""
        return 2 * self.components + 1

    @property
    def number(self) -> int:
        return self.intervals * self._block + self._last

    @property
    def knots(self) -> Array:
        """Fractions of the duration, (N + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.mesh)])

    def fractions(self, c: Array) -> Array:
        """Fractions of the duration at fractions c of every interval, (N · len(c),)."""
        return (self.knots[:-1, None] + self.mesh[:, None] * c).ravel()

    def pack(self, X: Array, V: Array, A: Array, w: Array, T: float) -> Array:
        """X, V: (N + 1, m); A: (N · nodes, m); w: (N · points, unknowns); ends zero."""
        N = self.intervals
        ends = np.zeros((N, self.at_ends))
        blocks = np.hstack([X[:-1], V[:-1], A.reshape(N, -1), w.reshape(N, -1), ends])
        return np.concatenate([blocks.ravel(), X[-1], V[-1], [T]])

    def coefficients(self, z: Array) -> Array:
        """Powers of the time since an interval began, in units of T, of X: (N, degree + 3, m)."""
        N, m, blocks = self.intervals, self.components, self.blocks(z)
        A = blocks[:, 2 * m : self._motion].reshape(N, -1, m)
        return self.transcription.coefficients(blocks[:, :m], blocks[:, m : 2 * m], A, self.mesh)

    def blocks(self, z: Array) -> Array:
        """A view of what belongs to each interval, (N, …)."""
        return z[: -self._last].reshape(self.intervals, self._block)

    def algebraic(self, z: Array) -> Array:
        """Algebraic unknowns, (N, points, unknowns)."""
        inside = self.blocks(z)[:, self._motion : self._motion + self._algebraic]
        return inside.reshape(self.intervals, len(self.points), self.unknowns)

    def set_algebraic(self, z: Array, values: Array) -> None:
        """Write values that can be broadcast to (N, points, unknowns) into z."""
        shape = (self.intervals, len(self.points), self.unknowns)
        filled = np.broadcast_to(values, shape).reshape(self.intervals, -1)
        self.blocks(z)[:, self._motion : self._motion + self._algebraic] = filled

    def at(self, c: Array, *, algebraic: bool) -> Layout:
        """y = (X, V, A, [unknowns,] T) at fractions c of every interval; unknowns: c = points."""
        N, m, k = self.intervals, self.components, self.transcription.degree + 3
        u = self.unknowns if algebraic else 0
        weights = np.zeros((N, len(c), 3 * m + u + 1, k))
        columns = np.full(weights.shape, self.number - 1)
        for j, part in enumerate(self.transcription.weights(c, self.mesh[:, None])):
            weights[:, :, j * m : (j + 1) * m] = part[:, :, None]
            columns[:, :, j * m : (j + 1) * m] = self._columns()[:, None]
        weights[:, :, 3 * m :, 0] = 1.0
        if algebraic:
            inside = self._motion + np.arange(self._algebraic).reshape(-1, u)
            columns[:, :, 3 * m : -1, 0] = self._begins()[:, None, None] + inside
        return Layout(columns.reshape(-1, k), weights.reshape(-1, k))

    def changes(self, count: int) -> Layout:
        """y = (the first ``count`` unknowns at a point, the same at the next), of all intervals."""
        points = self.unknowns * np.arange(len(self.points))[:, None] + np.arange(count)
        pairs = np.concatenate([points[:-1], points[1:]], axis=1)
        columns = self._begins()[:, None, None] + self._motion + pairs
        return Layout(columns.reshape(-1, 1), np.ones((columns.size, 1)))

    def ends(self) -> Layout:
        """y = (X, V at the end of an interval; X, V at the beginning of the next; its unknowns
        at the end), for every interval."""
        N, m, k = self.intervals, self.components, self.transcription.degree + 3
        weights = np.zeros((N, 4 * m + self.at_ends, k))
        columns = np.zeros(weights.shape, dtype=np.intp)
        for j, part in enumerate(self.transcription.weights(1.0, self.mesh)[:2]):
            weights[:, j * m : (j + 1) * m] = part[:, None]
            columns[:, j * m : (j + 1) * m] = self._columns()
        weights[:, 2 * m :, 0] = 1.0
        columns[:, 2 * m : 4 * m, 0] = self._begins()[:, None] + self._block + np.arange(2 * m)
        own = self._motion + self._algebraic + np.arange(self.at_ends)
        columns[:, 4 * m :, 0] = self._begins()[:, None] + own
        return Layout(columns.reshape(-1, k), weights.reshape(-1, k))

    def continuity(self, components: tuple[int, ...]) -> Layout:
        """X and V of some components at the end of an interval less those of the next."""
        N, m, k = self.intervals, self.components, self.transcription.degree + 3
        which = np.array(components, dtype=np.intp)
        weights = np.full((N, 2, len(which), k + 1), -1.0)
        columns = np.zeros(weights.shape, dtype=np.intp)
        for j, part in enumerate(self.transcription.weights(1.0, self.mesh)[:2]):
            weights[:, j, :, :k] = part[:, None]
            columns[:, j, :, :k] = self._columns()[:, which]
            columns[:, j, :, k] = self._begins()[:, None] + self._block + j * m + which
        names = tuple(
            f"continuity of the {what} of coordinate {i + 1} at {knot:.1%} of the duration"
            for knot in self.knots[1:]
            for what in ("position", "velocity")
            for i in components
        )
        return Layout(columns.reshape(-1, k + 1), weights.reshape(-1, k + 1), names)

    def _begins(self) -> NDArray[np.intp]:
        return np.asarray(self._block * np.arange(self.intervals), dtype=np.intp)

    def _columns(self) -> NDArray[np.intp]:
        """Variables that an interval combines, per component: (N, m, degree + 3)."""
        steps = self.components * np.arange(self.transcription.degree + 3)
        own = np.arange(self.components)[:, None] + steps
        return np.asarray(self._begins()[:, None, None] + own, dtype=np.intp)
