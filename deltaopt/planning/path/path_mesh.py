"""Meshes in the parameter of a path, and the fastest motion on one of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from deltaopt.curves.piecewise import (
    Array,
    Index,
    PiecewisePolynomial,
    Truths,
    quintic_rest,
    shifted,
)
from deltaopt.planning.path.path_rows import Places
from deltaopt.planning.path.sweep import Speeds
from deltaopt.scene.path import Path

_SAME = 1e-10
"""Share of the path within which two nodes are one."""
SERIES = 1e-3
"""Of z: below it the series of the duration of a cell is exact to rounding."""
STOPPING = 1 - 1e-9
"""Of z, which is 1 in a cell at whose end a motion that brakes less and less stops."""
LONGEST = 1e4
"""Of the time that the path takes at its largest speed: a cell that takes longer is at rest."""


@dataclass(frozen=True, eq=False)
class PathMesh:
    """Cells of a path: ``nodes`` (N + 1,), increasing, the knots of the path among them."""

    path: Path
    nodes: Array

    @classmethod
    def first(cls, path: Path, cells: int) -> PathMesh:
        """About so many cells, narrower at both ends, where a motion from rest is slow."""
        share = (1 - np.cos(np.linspace(0.0, pi, cells + 1))) / 2
        begin, end = path.knots[[0, -1]]
        return cls.of(path, begin + (end - begin) * share)

    @classmethod
    def of(cls, path: Path, nodes: Array) -> PathMesh:
        """With these nodes and the path's knots."""
        own, begin, end = path.knots, path.knots[0], path.knots[-1]
        nearest = np.rint(np.interp(nodes, own, np.arange(len(own)))).astype(np.intp)
        same = _SAME * (end - begin)
        inner = np.sort(nodes[np.abs(own[nearest] - nodes) > same])
        inner = inner[np.diff(inner, prepend=begin) > same]
        return cls(path, np.sort(np.concatenate([own, inner])))

    @cached_property
    def h(self) -> Array:
        """Lengths of the cells, (N,)."""
        return np.diff(self.nodes)

    @cached_property
    def pieces(self) -> Index:
        """The piece of the path that each cell is in, (N,)."""
        return self.path.interval((self.nodes[1:] + self.nodes[:-1]) / 2)

    @cached_property
    def begins(self) -> Array:
        """Where each cell begins, since its piece does, (N,)."""
        return self.nodes[:-1] - self.path.knots[self.pieces]

    def places(self, fractions: Array) -> Places:
        """Places at these fractions of every cell, (N, n) or the same n of all: (N · n,)."""
        since = (self.begins[:, None] + self.h[:, None] * fractions).ravel()
        return self.path.with_derivatives(np.repeat(self.pieces, fractions.shape[-1]), since)

    @cached_property
    def ends(self) -> Places:
        """Begin and end of every cell, (2 N,)."""
        return self.places(np.array([0.0, 1.0]))

    def split(self, parts: Index) -> PathMesh:
        """With each cell cut in so many equal parts, (N,)."""
        cell = np.repeat(np.arange(len(parts)), parts)
        rank = np.arange(len(cell)) - np.repeat(np.cumsum(parts) - parts, parts)
        inner = self.nodes[cell] + self.h[cell] * (rank / parts[cell])
        return PathMesh(self.path, np.append(inner, self.nodes[-1]))


@dataclass(frozen=True, eq=False)
class MeshMotion:
    """The fastest motion on a mesh: in every cell u = s̈ is linear in s, and b = ṡ² quadratic.

    ``durations``: time in every cell, (N,), s. ``stops``: cells in which the motion comes to a
    stop, (N,): there are some only on meshes that are too coarse for what the rows do in them.
    """

    mesh: PathMesh
    speeds: Speeds
    durations: Array
    stops: Truths

    @classmethod
    def of(cls, mesh: PathMesh, speeds: Speeds) -> MeshMotion:
        """With these speeds."""
        return cls(mesh, speeds, *_durations(mesh.h, speeds))

    def at(self, fractions: Array) -> tuple[Array, Array]:
        """b and u at these fractions of every cell, (N, n) each."""
        return self._states(np.arange(len(self.mesh.h)), fractions)

    def shares_of_way(self, parts: Array) -> Array:
        """Of every cell, (N, n), that are made in these parts of the time in it, (n,), as if u were
        the same in all of the cell."""
        speeds = np.sqrt(np.maximum(self.speeds.b, 0.0))[:, None]
        first, last = speeds[:-1], speeds[1:]
        total = np.where(first + last > 0, first + last, np.inf)
        made = parts * (2 * first + (last - first) * parts) / total
        return np.where(np.isfinite(total), made, parts)

    def states_at_ends(self, mesh: PathMesh) -> tuple[Array, Array]:
        """b and u at both ends of the cells of another mesh of the path, (2 N,) each."""
        own, nodes = self.mesh.nodes, mesh.nodes
        cell = np.searchsorted(own, (nodes[1:] + nodes[:-1]) / 2) - 1
        ends = np.stack([nodes[:-1], nodes[1:]], axis=1)
        z = np.clip((ends - own[cell][:, None]) / self.mesh.h[cell][:, None], 0.0, 1.0)
        b, u = self._states(cell, z)
        return b.ravel(), u.ravel()

    def _states(self, cell: Index, z: Array) -> tuple[Array, Array]:
        """b and u in some cells, (M,), at fractions of each, (M, n) or (n,): (M, n) each."""
        first, last = (each[:, None] for each in self.speeds.u[cell].T)
        h, b = self.mesh.h[cell][:, None], self.speeds.b[cell][:, None]
        found = b + h * z * (2 * first + (last - first) * z)
        return np.maximum(found, 0.0), first + (last - first) * z

    @cached_property
    def duration(self) -> float:
        """Time from start to goal, s."""
        return float(self.durations.sum())

    def evenly(self, cells: int) -> PathMesh:
        """A mesh of about so many cells of equal time."""
        t = np.concatenate([[0.0], np.cumsum(self.durations)])
        wanted = np.linspace(0.0, t[-1], cells + 1)
        i = np.clip(np.searchsorted(t, wanted, side="right") - 1, 0, len(t) - 2)
        T, rate = self.durations[i], np.sqrt(self.speeds.b)
        z = (wanted - t[i]) / T
        inside = z**2 * (3 - 2 * z) * self.mesh.h[i]
        inside += T * z * (1 - z) * (rate[i] * (1 - z) - rate[i + 1] * z)
        nodes = self.mesh.nodes
        s = np.clip(nodes[i] + inside, nodes[i], nodes[i + 1])
        return PathMesh.of(self.mesh.path, s)

    @cached_property
    def position(self) -> PiecewisePolynomial:
        """The platform's position over time, m: x = p(s(t)), exactly on the path.

        In a cell s is the quintic of time with the motion's s, ṡ and s̈ at both ends.
        """
        rate, T = np.sqrt(self.speeds.b), self.durations
        u0, u1 = self.speeds.u.T
        v0, v1, a0, a1 = rate[:-1] * T, rate[1:] * T, u0 * T**2, u1 * T**2
        change = self.mesh.h - v0 - a0 / 2
        speed, bend = v1 - v0 - a0, a1 - a0
        # Of powers 1 to 5 of the share of the cell's time.
        within = np.array([v0, a0 / 2, *quintic_rest(change, speed, bend)])
        coefficients = _composed(self._taylor, within)
        scales = np.multiply.accumulate(np.broadcast_to(1 / T, (len(coefficients) - 1, len(T))))
        coefficients[1:] *= scales[:, None]
        knots = np.concatenate([[0.0], np.cumsum(T)])
        return PiecewisePolynomial(knots, np.ascontiguousarray(coefficients.transpose(2, 0, 1)))

    @property
    def _taylor(self) -> Array:
        """The path's Taylor coefficients where each cell begins, (d + 1, 3, N)."""
        own = self.mesh.path.coefficients.transpose(1, 2, 0)[..., self.mesh.pieces]
        return shifted(np.ascontiguousarray(own), self.mesh.begins)


def _durations(h: Array, speeds: Speeds) -> tuple[Array, Truths]:
    """Time in every cell, ∫ ds / √b, (N,), s, and whether the motion stops there, (N,).

    With k = (u at end - u at begin) / h the motion obeys s̈ = u₀ + k (s - s₀), so that the
    tangent of half of the angle √-k T is √-k h / (ṡ₀ + ṡ₁). In a cell in which such a motion
    stops it is that of constant acceleration.
    """
    rate = np.sqrt(speeds.b)
    largest = float(rate.max())
    share = h / np.maximum(rate[1:] + rate[:-1], largest / LONGEST**2)
    z = (speeds.u[:, 1] - speeds.u[:, 0]) / h * share**2
    longest = LONGEST * float(h.sum()) / largest
    stops = np.logical_not((z < STOPPING) & (share < longest))
    z = np.where(stops, 0.0, z)
    root = np.sqrt(np.maximum(np.abs(z), SERIES))
    bent = np.where(z > 0, np.arctanh(np.minimum(root, STOPPING)), np.arctan(root)) / root
    series = 1 + z * (1 / 3 + z * (1 / 5 + z / 7))
    return np.asarray(2 * share * np.where(np.abs(z) < SERIES, series, bent)), stops


def _composed(outer: Array, inner: Array) -> Array:
    """Coefficients of outer(inner(z)), (n, 3, N), by powers of z, from those of ``outer``, (d + 1,
    3, N), and those of powers 1 and more of ``inner``, (m, N)."""
    count, degree = len(outer) - 1, len(inner)
    result = outer[count:]
    for k in reversed(range(count)):
        product = np.zeros((len(result) + degree, *outer.shape[1:]))
        for power, factor in enumerate(inner, start=1):
            product[power : power + len(result)] += result * factor
        result = product
        result[0] = outer[k]
    return result
