"""Variables of a collocation problem: which entry of a program's vector is which unknown.

In order, for every interval: position X_i, velocity V_i and accelerations A_i0 … A_id at its nodes,
then the algebraic unknowns at each of its points, then further unknowns at its end; after all
intervals X_N, V_N and the duration T. X, V and A have m components each, in units of the scene. V
and A are derivatives by time in units of T, so that the motion is linear in X, V and A.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deltaopt.curves.piecewise import Array, Index
from deltaopt.planning.nlp.points import Layout
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration


@dataclass(frozen=True)
class Variables:
    """The variables of a motion on a mesh of interval lengths, (N,), fractions of the duration.

    ``components``: the number m of coordinates. ``points``: fractions of every interval where there
    are algebraic unknowns, such as torques; ``unknowns``: how many at each. ``at_ends``: number of
    further unknowns at the end of every interval.
    """

    transcription: PiecewiseAcceleration
    mesh: Array
    components: int
    points: Array
    unknowns: int
    at_ends: int = 0

    @property
    def intervals(self) -> int:
        """The number N of intervals."""
        return len(self.mesh)

    @property
    def _motion(self) -> int:
        """How many variables are X_i, V_i and A_ij of one interval."""
        return self.components * (2 + len(self.transcription.nodes))

    @property
    def _algebraic(self) -> int:
        return self.unknowns * len(self.points)

    @property
    def _block(self) -> int:
        return self._motion + self._algebraic + self.at_ends

    @property
    def _last(self) -> int:
        """How many variables are X_N, V_N and T."""
        return 2 * self.components + 1

    @property
    def number(self) -> int:
        """The number of variables."""
        return self.intervals * self._block + self._last

    @property
    def knots(self) -> Array:
        """Instants of the knots, fractions of the duration, (N + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.mesh)])

    def fractions(self, c: Array) -> Array:
        """Instants at fractions c of every interval, fractions of the duration, (N · len(c),)."""
        return (self.knots[:-1, None] + self.mesh[:, None] * c).ravel()

    def pack(self, X: Array, V: Array, A: Array, w: Array, T: float) -> Array:
        """The vector of variables from X, V, (N + 1, m), A, (N · nodes, m), and the algebraic
        unknowns w, (N · points, unknowns); further unknowns at the ends are zero."""
        N = self.intervals
        ends = np.zeros((N, self.at_ends))
        blocks = np.hstack([X[:-1], V[:-1], A.reshape(N, -1), w.reshape(N, -1), ends])
        return np.concatenate([blocks.ravel(), X[-1], V[-1], [T]])

    def continuous(self, X: Array, V: Array, A: Array) -> Array:
        """Accelerations A, (N · nodes, m), changed least such that the motion through X and V at
        the knots, (N + 1, m) each, is continuous."""
        N, m = self.intervals, self.components
        A = A.reshape(N, -1, m)
        position, velocity, _ = self.transcription.weights(1.0, self.mesh)
        weights = np.stack([position, velocity], axis=1)  # (N, 2, degree + 3)
        ends = np.stack([X[1:], V[1:]], axis=1)
        combined = np.concatenate([X[:-1, None], V[:-1, None], A], axis=1)
        A = A + np.linalg.pinv(weights[..., 2:]) @ (ends - weights @ combined)
        return A.reshape(-1, m)

    def coefficients(self, z: Array) -> Array:
        """Coefficients of X in powers of the time since its interval began, in units of T, (N,
        degree + 3, m)."""
        N, m, blocks = self.intervals, self.components, self.blocks(z)
        A = blocks[:, 2 * m : self._motion].reshape(N, -1, m)
        return self.transcription.coefficients(blocks[:, :m], blocks[:, m : 2 * m], A, self.mesh)

    def blocks(self, z: Array) -> Array:
        """A view of the variables of each interval, (N, variables)."""
        return z[: -self._last].reshape(self.intervals, self._block)

    def algebraic(self, z: Array) -> Array:
        """Algebraic unknowns, (N, points, unknowns)."""
        inside = self.blocks(z)[:, self._motion : self._motion + self._algebraic]
        return inside.reshape(self.intervals, len(self.points), self.unknowns)

    def set_algebraic(self, z: Array, values: Array) -> None:
        """Write values that can be broadcast to (N, points, unknowns) into the variables z."""
        shape = (self.intervals, len(self.points), self.unknowns)
        filled = np.broadcast_to(values, shape).reshape(self.intervals, -1)
        self.blocks(z)[:, self._motion : self._motion + self._algebraic] = filled

    def at(self, c: Array, *, algebraic: bool) -> Layout:
        """The layout of y = (X, V, A, [unknowns,] T) at fractions c of every interval.

        With ``algebraic`` unknowns c must be the points that have them.
        """
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
        """The layout of y = (the first ``count`` unknowns at a point, the same at the next point of
        the interval), for all intervals."""
        points = self.unknowns * np.arange(len(self.points))[:, None] + np.arange(count)
        pairs = np.concatenate([points[:-1], points[1:]], axis=1)
        columns = self._begins()[:, None, None] + self._motion + pairs
        return Layout(columns.reshape(-1, 1), np.ones((columns.size, 1)))

    def ends(self) -> Layout:
        """The layout of y = (X, V at the end of an interval; X, V at the beginning of the next; the
        further unknowns at that end), for every interval."""
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
        """The layout of continuity: X and V of some components at the end of an interval less those
        at the beginning of the next."""
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

    def _begins(self) -> Index:
        return np.asarray(self._block * np.arange(self.intervals), dtype=np.intp)

    def _columns(self) -> Index:
        """Indices of the variables that determine each component in an interval, (N, m,
        degree + 3)."""
        steps = self.components * np.arange(self.transcription.degree + 3)
        own = np.arange(self.components)[:, None] + steps
        return np.asarray(self._begins()[:, None, None] + own, dtype=np.intp)
