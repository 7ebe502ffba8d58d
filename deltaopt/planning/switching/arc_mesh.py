"""Arcs cut into intervals, and the polynomials on them.

The acceleration is a polynomial of one degree on every interval, given by its values at Lobatto's
nodes. A singular control, which is held by no limit, is a sum of Legendre polynomials over its
whole arc: its value where the arc ends and the instant of that end are nearly one unknown, and with
a value at every node the KKT system would be singular.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial.legendre import legder, legvander

from deltaopt.curves.piecewise import Array, Index
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.planning.switching.structure import SwitchingStructure

DENSE = np.linspace(0.0, 1.0, 21)
"""Fractions of every interval, both ends included, at which a motion is checked between its
nodes: more take longer, fewer may miss where a row exceeds its limit."""
_LONGEST = 0.15
"""Longest interval, as a fraction of the duration: shorter ones make a larger system, longer ones
are cut later anyway because polynomials stray from the limits between nodes."""


def parts_of(lengths: Array) -> Index:
    """Numbers of intervals for arcs of these lengths, fractions of the duration, (arcs,)."""
    return np.ceil(lengths / _LONGEST).clip(1).astype(np.intp)


@dataclass(frozen=True)
class Polynomials(PiecewiseAcceleration):
    """The acceleration on an interval, and weights of its values at the nodes."""

    between: tuple[float, ...] = ()

    @cached_property
    def at_nodes(self) -> tuple[Array, Array, Array]:
        """Weights in the position, velocity and acceleration at the nodes, (nodes, nodes) each."""
        return self._of_values(self.nodes)

    @cached_property
    def at_dense(self) -> tuple[Array, Array, Array]:
        """Weights in the same at ``DENSE``, (dense, nodes) each."""
        return self._of_values(DENSE)

    def _of_values(self, c: Array) -> tuple[Array, Array, Array]:
        position, velocity, acceleration = self.weights(c, 1.0)
        return position[:, 2:], velocity[:, 2:], acceleration[:, 2:]

    @cached_property
    def slope_at_dense(self) -> Array:
        """Derivatives at ``DENSE`` of polynomials given by values at the nodes, (dense, nodes)."""
        at_nodes, powers = legvander(2 * self.nodes - 1, self.degree), np.eye(self.degree + 1)
        slopes = legvander(2 * DENSE - 1, self.degree - 1) @ (2 * legder(powers))
        return np.asarray(slopes @ np.linalg.inv(at_nodes))


_polynomials = lru_cache(maxsize=8)(Polynomials)


@dataclass(frozen=True)
class ArcMesh:
    """Arcs cut into intervals with polynomials on them.

    ``parts``: number of intervals of each arc, (arcs,). ``polynomials``: the accelerations in an
    interval. ``modes``: number of Legendre coefficients of a singular control on each arc, (arcs,).
    """

    parts: Index
    polynomials: Polynomials
    modes: Index

    @classmethod
    def of(cls, structure: SwitchingStructure, degree: int, more_modes: int = 0) -> ArcMesh:
        """A mesh for a structure: longer arcs get more intervals and more Legendre coefficients,
        about ``more_modes`` more than at first on an arc of half of the duration."""
        lengths = np.clip(structure.lengths, 0.0, 1.0)
        modes = 1 + (more_modes + 10) * lengths.clip(0.0, 0.3) / 0.5 + 4 * lengths
        return cls(parts_of(lengths), _polynomials(degree), np.ceil(modes).astype(np.intp))

    @cached_property
    def arc(self) -> Index:
        """The arc of each interval, (n,)."""
        return np.repeat(np.arange(len(self.parts)), self.parts)

    @cached_property
    def first(self) -> Index:
        """The first interval of each arc, (arcs,)."""
        return np.cumsum(self.parts) - self.parts

    @property
    def arcs(self) -> int:
        """The number of arcs."""
        return len(self.parts)

    @property
    def intervals(self) -> int:
        """The number n of intervals."""
        return len(self.arc)

    @property
    def most_modes(self) -> int:
        """The largest number of Legendre coefficients on an arc."""
        return int(self.modes.max())

    def interval_lengths(self, lengths: Array) -> Array:
        """Lengths of the intervals, (n,), from those of the arcs, (arcs,)."""
        return np.asarray((lengths / self.parts)[self.arc])

    def singular_controls(self, coefficients: Array) -> Array:
        """Singular controls at the nodes, (n, nodes, m), from their Legendre coefficients by arc,
        (arcs, m, most modes)."""
        return np.asarray(np.einsum("nkl,nrl->nkr", self.legendre, coefficients[self.arc]))

    @cached_property
    def legendre(self) -> Array:
        """Legendre polynomials over the arc at the nodes, (n, nodes, most modes)."""
        number = np.arange(self.intervals) - self.first[self.arc]
        share = (number[:, None] + self.polynomials.nodes) / self.parts[self.arc][:, None]
        return np.asarray(legvander(2 * share - 1, self.most_modes - 1))
