"""The fastest motion on a mesh of a path, what it does between nodes, and its multipliers.

``on_mesh.c`` does all of it in one call; without a compiler, arrays do the same step by step.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from math import log
from typing import Any

import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import Array
from deltaopt.planning.path.path_mesh import LONGEST, SERIES, STOPPING, MeshMotion, PathMesh
from deltaopt.planning.path.path_rows import PathRows, State, kept_rows
from deltaopt.planning.path.sweep import FASTEST, Speeds, Unattainable, compiled, swept

INSIDE = np.array([0.01, 0.06, 0.2, 0.5, 0.8, 0.94, 0.99])
"""Fractions of the time in a cell when rows are looked at: near its ends more closely, for there
friction changes fast beside a rest."""
_WEIGHTS = np.array([0.03, 0.07, 0.23, 0.34, 0.23, 0.07, 0.03])
"""Of these instants."""
_NO_NUMBERS, _NO_MEMORY = -2, -3
"""What the compiled code returns beside what the sweep does."""
_STEP = 1e-4
"""Share of a bound by which it is moved to and fro: its cube is what the difference of both
durations errs by, which sweeps know to some 1e-12."""


@dataclass(frozen=True)
class Tangency:
    """Where rows are replaced by tangents, at both ends of cells: all of them at the ``last``
    motion, those that are curved at the state ``halfway`` to the one before too."""

    last: State
    halfway: State


@dataclass(frozen=True)
class OnMesh:
    """The fastest motion on a mesh.

    ``tangency``, ``tighter``: as ``fastest_on_mesh`` was given them. ``beyond``: by how much rows
    are exceeded inside of cells, (N, places, rows), negative within bounds. ``losses``: relative
    losses of time in each cell, (N,), infinite where the motion stops.
    """

    motion: MeshMotion
    tangency: Tangency
    tighter: Array | None
    beyond: Array
    losses: Array


def fastest_on_mesh(
    rows: PathRows, mesh: PathMesh, tangency: Tangency, tighter: Array | None
) -> OnMesh:
    """The fastest motion on a mesh.

    ``tighter``: by how much the bounds of all rows, in the order of ``PathRows.owners``, are moved
    inwards in each cell, (N, owners). Raises Unattainable where there is none, Unreachable or
    Singular where the platform cannot be.
    """
    code = None if rows.function.address is None else compiled()
    if code is None:
        return by_arrays(rows, mesh, tangency, tighter)
    n, curve = len(mesh.nodes) - 1, mesh.path.stacked
    others = rows.others(mesh.ends, tangency.halfway) if len(rows.curved) else None
    more = None if others is None else np.stack(list(vars(others).values()))
    number = 0 if others is None else others.alpha.shape[1]
    sizes = n, len(rows.sides), number, curve.shape[1], len(curve), int(rows.are_convex)
    numbers = *rows.ends, FASTEST, SERIES, STOPPING, LONGEST, rows.slowest
    arrays = [mesh.path.knots, curve, mesh.nodes, *tangency.last, more, tighter, rows.bounds]
    arrays += [INSIDE, _WEIGHTS, rows.parameters]
    status, results = run(code, rows.function, sizes, numbers, arrays)
    if status == _NO_NUMBERS:
        by_arrays(rows, mesh, tangency, tighter)  # says what is the matter
    if status == _NO_MEMORY:
        raise MemoryError(f"a mesh of {n} cells")
    if status:
        raise Unattainable(status - 1 if status > 0 else None)
    squares, rest = results[: n + 1], results[n + 1 :]
    durations, losses, stops = rest[2 * n : 5 * n].reshape(3, n)
    motion = MeshMotion(mesh, Speeds(squares, rest[: 2 * n].reshape(n, 2)), durations, stops != 0)
    beyond = rest[5 * n :].reshape(n, len(INSIDE), -1)
    return OnMesh(motion, tangency, tighter, beyond, losses)


def by_arrays(rows: PathRows, mesh: PathMesh, tangency: Tangency, tighter: Array | None) -> OnMesh:
    """``fastest_on_mesh`` without ``on_mesh.c``."""
    tangents = rows.tangents(mesh.ends, tangency.last, tangency.halfway)
    if tighter is not None:
        tangents = tangents.tightened(np.repeat(tighter, 2, axis=0))
    motion = MeshMotion.of(mesh, swept(mesh.h, tangents, *rows.ends, convex=rows.are_convex))
    fractions = motion.shares_of_way(INSIDE)
    b, u = motion.at(fractions)
    beyond = rows.beyond(mesh.places(fractions), b.ravel(), u.ravel()).reshape(*b.shape, -1)
    return OnMesh(motion, tangency, tighter, beyond, _losses(motion, beyond))


def _losses(motion: MeshMotion, beyond: Array) -> Array:
    """Relative loss of time in each cell, (N,), infinite where the motion stops: the part of the
    nearest limit that is exceeded or not used. Limits are those of squares of speeds, so that half
    of it would do, if gravity did not take its share of the torques."""
    missed = np.abs(beyond.max(axis=2)) @ _WEIGHTS
    missed = np.where(motion.stops, np.inf, missed)
    return np.asarray(missed * motion.durations / motion.duration)


class _Mesh(ctypes.Structure):
    """``Mesh`` of ``on_mesh.c``."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("cells", "rows", "others", "powers", "pieces")),
        ("convex", ctypes.c_int64),
        *((name, ctypes.c_double) for name in ("start", "goal", "most")),
        *((name, ctypes.c_double) for name in ("series", "stopping", "longest", "slowest")),
        *((name, ctypes.c_void_p) for name in ("knots", "curve", "nodes", "b", "u")),
        *((name, ctypes.c_void_p) for name in ("more", "tighter", "sides", "inside", "weights")),
        *((name, ctypes.c_void_p) for name in ("parameters", "evaluate", "results")),
    )


def run(
    code: Any,
    function: RowFunction,
    sizes: tuple[int, ...],
    numbers: tuple[float, ...],
    arrays: Sequence[Array | None],
) -> tuple[int, Array]:
    """What the compiled function returns, and its results.

    ``function``: the rows. ``sizes``, ``numbers``, ``arrays``: as in ``Mesh`` of ``on_mesh.c``;
    some arrays may be absent.
    """
    cells, rows = sizes[:2]
    results = np.empty(1 + (6 + len(INSIDE) * rows) * cells)
    given = [None if a is None else np.ascontiguousarray(a) for a in arrays]
    addresses = (None if a is None else a.ctypes.data for a in given)
    call = _Mesh(*sizes, *numbers, *addresses, function.address, results.ctypes.data)
    return code.on_mesh(ctypes.byref(call)), results


@dataclass(frozen=True, eq=False)
class PathMultipliers:
    """Multipliers of the limits of the fastest motion on a mesh.

    Sweeps find that motion without multipliers. By what share the duration grows as the bound of a
    row is tightened follows from two more sweeps on the same mesh, with all that bound a little
    further out and further in: on one mesh errors of the mesh cancel.

    ``on_mesh``: that motion, and where the ``rows`` were replaced by tangents.
    """

    rows: PathRows
    on_mesh: OnMesh

    def of_rows(self) -> Array:
        """By what share the duration grows per unit by which the bound of each normalised row is
        tightened, all along the path, (rows,); NaN where no motion keeps a tighter bound."""
        constraints = self.rows.limits.constraints
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
        """ln T of the fastest motion with bounds moved inwards by so much more, (owners,)."""
        found, mesh = self.on_mesh, self.on_mesh.motion.mesh
        moved = by if found.tighter is None else found.tighter + by
        tighter = np.broadcast_to(moved, (len(mesh.h), len(by)))
        same = fastest_on_mesh(self.rows, mesh, found.tangency, tighter)
        return log(same.motion.duration)
