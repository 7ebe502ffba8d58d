"""The fastest speeds along a path that keep affine rows: reachability, backwards and forwards.

``sweep.c`` says how, and does it; a linear program does the same without a compiler.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np

from deltaopt.codegen.compile import library
from deltaopt.curves.piecewise import Array
from deltaopt.errors import Infeasible
from deltaopt.planning.path.linear_program import fastest
from deltaopt.planning.path.path_rows import AffineRows

FASTEST = 1e6
"""The largest b where no row bounds it, in the units of the sweep, in which motions have b of about
one. Speeds are found downwards from it, and known to its rounding."""


@dataclass(frozen=True)
class Speeds:
    """The fastest motion on a mesh in s. ``b``: ṡ² at the nodes, (N + 1,). ``u``: s̈ at both ends
    of every cell, (N, 2); between them it is linear in s."""

    b: Array
    u: Array


class Unattainable(Infeasible):
    """No motion on a mesh keeps the rows. ``node``: where none does; None if some do all along, but
    none that begins at the given speed."""

    def __init__(self, node: int | None) -> None:
        super().__init__(node)
        self.node = node

    def __str__(self) -> str:
        return "no speed along the path keeps the limits"


def swept(h: Array, rows: AffineRows, start: float, goal: float, *, convex: bool = True) -> Speeds:
    """The fastest motion over cells of lengths h, (N,), with b = ``start`` and ``goal`` at its
    ends.

    ``rows``: at both ends of every cell, the begin first, (2 N, rows). ``convex``: whether they are
    no tangents to something that is not convex, see ``PathRows.are_convex``. Raises Unattainable.
    """
    length, largest = float(h.sum()), float(np.abs(rows.alpha).max()) or 1.0
    b_unit = length / largest
    scaled = AffineRows(rows.alpha / largest, rows.beta * b_unit, rows.low, rows.high)
    b, u = _swept(h / length, scaled, start / b_unit, goal / b_unit, convex)
    return Speeds(b * b_unit, u / largest)


def _swept(
    h: Array, rows: AffineRows, start: float, goal: float, convex: bool
) -> tuple[Array, Array]:
    """The fastest b and u in units of the path's length and of the largest alpha."""
    code, n = compiled(), len(h)
    if code is None:
        found = fastest(h, rows, start, goal, FASTEST, convex)
        if isinstance(found, int | None):
            raise Unattainable(found)
        return found
    b, u, memory = np.empty(n + 1), np.empty((n, 2)), np.empty((n + 1, 3))
    given = [h, rows.alpha, rows.beta, rows.low, rows.high]
    arrays = [np.ascontiguousarray(each, dtype=float) for each in given]
    size, number = ctypes.c_int64, ctypes.c_double
    status = code.sweep(
        size(n),
        size(rows.alpha.shape[1]),
        size(convex),
        *(ctypes.c_void_p(each.ctypes.data) for each in arrays),
        number(start),
        number(goal),
        number(FASTEST),
        *(ctypes.c_void_p(each.ctypes.data) for each in (b, u, memory)),
    )
    if status:
        raise Unattainable(status - 1 if status > 0 else None)
    return b, u


def source() -> str:
    """C text of the compiled functions: of the sweep, and of all that is done on a mesh."""
    folder = files("deltaopt.planning.path")
    return "".join(folder.joinpath(name).read_text() for name in ("sweep.c", "on_mesh.c"))


@lru_cache(maxsize=1)
def compiled() -> Any:
    """The compiled functions; None without a compiler."""
    built = library(source())
    if built is None:
        return None
    code = ctypes.CDLL(str(built))
    code.sweep.restype = code.on_mesh.restype = ctypes.c_int64
    return code
