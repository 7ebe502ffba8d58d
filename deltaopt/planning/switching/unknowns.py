"""The unknowns of a switched motion's conditions of optimality: their values, and their places in
the condensed KKT system."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np

from deltaopt.curves.piecewise import Array, Index
from deltaopt.planning.switching.arc_mesh import ArcMesh


@dataclass(frozen=True)
class PrimalDualPoint:
    """Values of all unknowns, scaled; or a step of them. m motors, n intervals.

    ``knots``: (X, V) at the ends of the intervals, (n + 1, 2 m). ``A``: accelerations, (n, nodes,
    m). ``lengths``: of the arcs, (arcs,). ``costates``: p at the ends of the intervals, (n, 2 m).
    ``multipliers``: λ of the active rows, (n, nodes, m). ``entry``: ν of the entry conditions.
    ``singular``: w, Legendre coefficients of singular controls, (arcs, m, most modes).
    ``end_values``: multipliers of given end values of singular controls. ``slack``, ``upper``,
    ``lower``: of the rows that a barrier bounds, copies of them strictly within ±1, and the
    multipliers of these bounds, (n, nodes, bounded rows) each.
    """

    knots: Array
    A: Array
    lengths: Array
    costates: Array
    multipliers: Array
    entry: Array
    singular: Array
    end_values: Array
    slack: Array
    upper: Array
    lower: Array

    def moved(self, step: PrimalDualPoint, share: float = 1.0) -> PrimalDualPoint:
        """The point after a part of a step."""
        names = (field.name for field in fields(self))
        moved = (getattr(self, name) + share * getattr(step, name) for name in names)
        return PrimalDualPoint(*moved)

    @property
    def duration(self) -> float:
        """The duration in units of the scaling's time."""
        return float(self.lengths.sum())

    @property
    def size(self) -> float:
        """Of a step: the largest change of a state, a length or, by a third, a coefficient of a
        singular control; infinite if it is no number."""
        parts = (self.knots, self.lengths, self.singular / 3)
        largest = float(max(np.abs(part).max(initial=0.0) for part in parts))
        return largest if np.isfinite(largest) else np.inf

    def interval_lengths(self, mesh: ArcMesh) -> Array:
        """Lengths of the intervals, (n,)."""
        return mesh.interval_lengths(self.lengths)

    def at_nodes(self, mesh: ArcMesh) -> Array:
        """y = (X, V, A) at the nodes, (n, nodes, 3 m)."""
        return self.at(mesh, mesh.polynomials.nodes, mesh.polynomials.at_nodes)

    def at(self, mesh: ArcMesh, c: Array, weights: tuple[Array, Array, Array]) -> Array:
        """y at fractions c of the intervals, (n, c, 3 m), by the weights of A there."""
        h, m = self.interval_lengths(mesh)[:, None, None], self.A.shape[2]
        position, velocity, acceleration = (weight @ self.A for weight in weights)
        X, V = self.knots[:-1, None, :m], self.knots[:-1, None, m:]
        x = X + h * c[:, None] * V + h**2 * position
        return np.concatenate([x, V + h * velocity, acceleration], axis=2)


class KKTIndex:
    """Places of the unknowns in the condensed KKT system, and in what each interval adds to it.

    The system has, in this order, states at the inner knots, lengths of arcs, coefficients of
    singular controls, costates, multipliers of entry conditions and of end values, (size,); behind
    them a bin for the given first state. What an interval adds has (X_i, V_i, h), p at its end, the
    right-hand side, and the coefficients of all controls of its arc, (width,).
    """

    def __init__(
        self,
        mesh: ArcMesh,
        motors: int,
        singular: tuple[tuple[int, int], ...],
        entries: int,
        end_values: int,
    ) -> None:
        """``singular``: (arc, motor) of singular controls; ``entries``, ``end_values``: how many
        entry conditions and given end values there are.

        ``inner_states``: places of (X, V) at the inner knots, (n - 1, 2 m); ``costates``: of p at
        the ends of the intervals, (n, 2 m).
        """
        self._mesh, self._singular, n = mesh, singular, mesh.intervals
        self.states = 2 * motors
        self.own, self.right = self.states + 1, 2 * self.states + 1
        modes = [int(mesh.modes[a]) for a, _ in singular]
        sizes = [self.states * (n - 1), mesh.arcs, sum(modes), self.states * n, entries]
        ends = np.cumsum([*sizes, end_values]).tolist()
        inner, self.lengths, coefficients, costates, self.entries, self.end_values = (
            np.arange(begin, end) for begin, end in zip([0, *ends[:-1]], ends, strict=True)
        )
        self.singular = np.split(coefficients, np.cumsum(modes)[:-1]) if modes else []
        self.size, self.inner_states = ends[-1], inner.reshape(-1, self.states)
        self.costates = costates.reshape(-1, self.states)
        self.coefficients = motors * mesh.most_modes if singular else 0
        self.width = self.right + 1 + self.coefficients
        self.duals = np.concatenate([costates, self.entries, self.end_values])

    def state(self, knot: int) -> Index:
        """Places of (X, V) at a knot, (2 m,); the bin for the first, which is given."""
        begin = self.states * (knot - 1) if knot else self.size
        return np.arange(begin, begin + self.states)

    def summed(self, by_interval: Array) -> tuple[Array, Array]:
        """The sum of what the intervals add, (n, width, width), as a matrix and a right-hand side
        that still have the bin."""
        size = self.size + self.states
        total = np.zeros((size, size + 1))
        for interval, own in enumerate(by_interval):
            inside, here, share = self._borders[interval]
            factors = np.outer(share, np.append(share, 1.0))
            part = own[np.ix_(inside, np.append(inside, self.right))]
            total[np.ix_(here, np.append(here, size))] += part * factors
        return total[:, :size], total[:, size]

    @cached_property
    def _borders(self) -> list[tuple[Index, Index, Array]]:
        """Of every interval."""
        return [self._border(interval) for interval in range(self._mesh.intervals)]

    def _border(self, interval: int) -> tuple[Index, Index, Array]:
        """Unknowns outside of an interval: their places in what it adds, in the system, and
        factors: its length h is a part of that of its arc."""
        a = int(self._mesh.arc[interval])
        here = [self.state(interval), self.lengths[[a]], self.costates[interval]]
        for_interval = [np.arange(self.right)]
        for (arc, motor), places in zip(self._singular, self.singular, strict=True):
            if arc == a:
                here.append(places)
                first = self.right + 1 + motor * self._mesh.most_modes
                for_interval.append(first + np.arange(len(places)))
        inside = np.concatenate(for_interval)
        share = np.ones(len(inside))
        share[self.states] = 1.0 / self._mesh.parts[a]
        return inside, np.concatenate(here), share
