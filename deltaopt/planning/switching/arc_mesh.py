"""What the arcs of a structure hold, and the polynomials on them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legder, legvander
from numpy.typing import NDArray

from deltaopt.planning.flat.constraint_rows import (
    OPENING,
    OPENING_BEND,
    OPENING_RATE,
    SPEED,
    SPEED_RATE,
    TORQUE,
)
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.planning.switching.structure import FREE, Arc, Structure

Array = NDArray[np.float64]
Integers = NDArray[np.intp]

DENSE = np.linspace(0.0, 1.0, 21)
"""Where in every interval a solution is examined, both ends included."""
_LONGEST = 0.15
"""Of the duration: arcs longer than this are cut into intervals."""


class Entry(NamedTuple):
    """A row of the stage that has a value where an arc begins."""

    arc: int
    row: int
    value: float

    @property
    def motor(self) -> int:
        return self.row % 3

    @property
    def of_speed(self) -> bool:
        """Otherwise of an opening."""
        return self.row >= SPEED


class Pin(NamedTuple):
    """A torque without limit that begins (``end`` 0) or ends (1) an arc at a value."""

    arc: int
    motor: int
    end: int
    value: float

    def shapes(self, modes: int) -> Array:
        """Legendre's polynomials there, (modes,)."""
        return np.asarray(np.ones(modes) if self.end else (-1.0) ** np.arange(modes), np.float64)


@dataclass(frozen=True)
class Held:
    """What the arcs hold: a row of the stage for each motor at every node, and more where an
    arc begins.

    ``row``, ``value``: (arcs, 3). ``free``: (arc, motor) where the row is a torque that no
    limit holds: its value is a polynomial to be found.
    """

    row: Integers
    value: Array
    free: tuple[tuple[int, int], ...]
    entries: tuple[Entry, ...]

    @classmethod
    def of(cls, structure: Structure) -> Held:
        """A speed is held by its derivative along the arc and by itself where it begins, an
        opening by its second derivative and, where it begins, by itself and the first; both in
        place of a torque at no limit, the motor's own or, if that is at one, another's."""
        arcs = len(structure.lengths)
        row, value = np.zeros((arcs, 3), np.intp), np.zeros((arcs, 3))
        free, entries = [], []
        for a, limits in enumerate(structure.limits):
            row[a] = TORQUE + np.arange(3)
            value[a] = [limit.torque for limit in limits]
            without = [k for k in range(3) if not limits[k].torque]
            for k, state in sorted(held_states(limits), key=lambda state: state[0] not in without):
                row[a, without.pop(without.index(k) if k in without else 0)] = state
            free += [(a, k) for k in without]
            for k, now in enumerate(limits):
                before = structure.limits[a - 1][k] if a else FREE
                if now.touched and before != now:
                    entries.append(Entry(a, OPENING + k, 0.0))
                if now.grazed and before != now:
                    entries.append(Entry(a, SPEED + k, float(now.grazed)))
                if now.speed and before.speed != now.speed:
                    entries.append(Entry(a, SPEED + k, float(now.speed)))
                if now.opening and not before.opening:
                    entries += [Entry(a, OPENING + k, 0.0), Entry(a, OPENING_RATE + k, 0.0)]
        return cls(row, value, tuple(free), tuple(entries))

    @property
    def without_row(self) -> NDArray[np.bool]:
        """Torques that follow from a speed or an opening that is held, (arcs, 3)."""
        return np.asarray(self.row != TORQUE + np.arange(3))


def held_states(limits: Arc) -> list[tuple[int, int]]:
    """(motor, row that holds it) of the speeds and openings that are held."""
    states = [(k, SPEED_RATE + k) for k, limit in enumerate(limits) if limit.speed]
    return states + [(k, OPENING_BEND + k) for k, limit in enumerate(limits) if limit.opening]


def parts_of(lengths: Array) -> Integers:
    """Into how many intervals arcs of these shares of the duration are cut, (arcs,)."""
    return np.ceil(lengths / _LONGEST).clip(1).astype(np.intp)


@dataclass(frozen=True)
class Grid:
    """Arcs cut into ``parts`` intervals, (arcs,); acceleration of a ``degree`` on each; torques
    without limit of so many ``modes``, Legendre's polynomials over the arc, (arcs,)."""

    parts: Integers
    degree: int
    modes: Integers

    @classmethod
    def of(cls, structure: Structure, degree: int, more_modes: int = 0) -> Grid:
        """Long arcs in several parts and with more modes."""
        lengths = np.clip(structure.lengths, 0.0, 1.0)
        modes = 1 + (more_modes + 10) * lengths.clip(0.0, 0.3) / 0.5 + 4 * lengths
        return cls(parts_of(lengths), degree, np.ceil(modes).astype(np.intp))

    @cached_property
    def arc(self) -> Integers:
        """The arc of each interval, (n,)."""
        return np.repeat(np.arange(len(self.parts)), self.parts)

    @cached_property
    def first(self) -> Integers:
        """The first interval of each arc, (arcs,)."""
        return np.cumsum(self.parts) - self.parts

    @property
    def intervals(self) -> int:
        return len(self.arc)

    def intervals_of(self, lengths: Array) -> Array:
        """Lengths of the intervals, (n,), from those of the arcs."""
        return np.asarray((lengths / self.parts)[self.arc])

    def torques(self, free: Array) -> Array:
        """Torques without limit at the nodes, (n, nodes, 3), from their modes by arc."""
        return np.asarray(np.einsum("nkl,nrl->nkr", self.shapes, free[self.arc]))

    @property
    def most_modes(self) -> int:
        return int(self.modes.max())

    @property
    def nodes(self) -> Array:
        """Lobatto's, from 0 to 1."""
        return self.transcription.nodes

    @property
    def quadrature(self) -> Array:
        return self.transcription.quadrature

    @property
    def transcription(self) -> PiecewiseAcceleration:
        return _weights(self.degree).transcription

    @property
    def at_nodes(self) -> tuple[Array, Array, Array]:
        """Weights l̿_j(c), l̄_j(c) and l_j(c) of A_j at the nodes c, (nodes, nodes) each."""
        return _weights(self.degree).at_nodes

    @property
    def at_dense(self) -> tuple[Array, Array, Array]:
        """The same at ``DENSE``, (dense, nodes) each."""
        return _weights(self.degree).at_dense

    @property
    def slope_at_dense(self) -> Array:
        """Derivatives at ``DENSE`` of polynomials that are given at the nodes, (dense, nodes)."""
        return _weights(self.degree).slope_at_dense

    @cached_property
    def shapes(self) -> Array:
        """Legendre's polynomials over the arc at the nodes, (n, nodes, most modes)."""
        number = np.arange(self.intervals) - self.first[self.arc]
        share = (number[:, None] + self.nodes) / self.parts[self.arc][:, None]
        return np.asarray(legvander(2 * share - 1, self.most_modes - 1))


@dataclass(frozen=True)
class _Weights:
    """Of polynomials of one degree."""

    transcription: PiecewiseAcceleration
    at_nodes: tuple[Array, Array, Array]
    at_dense: tuple[Array, Array, Array]
    slope_at_dense: Array


@lru_cache(maxsize=8)
def _weights(degree: int) -> _Weights:
    transcription = PiecewiseAcceleration(degree, between=())

    def of_acceleration(c: Array) -> tuple[Array, Array, Array]:
        position, velocity, acceleration = transcription.weights(c, 1.0)
        return position[:, 2:], velocity[:, 2:], acceleration[:, 2:]

    nodes = transcription.nodes
    at_nodes = legvander(2 * nodes - 1, degree)
    slopes = legvander(2 * DENSE - 1, degree - 1) @ (2 * legder(np.eye(degree + 1)))
    return _Weights(
        transcription,
        of_acceleration(nodes),
        of_acceleration(DENSE),
        np.asarray(slopes @ np.linalg.inv(at_nodes)),
    )
