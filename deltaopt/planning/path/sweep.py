"""The fastest speeds along a path that keep affine rows: reachability, backwards and forwards.

``sweep.c`` says how, and does it for ``on_mesh.c``. A linear program does the same without a
compiler: the largest b at all nodes is that of the largest sum. Of all u that lead from node to
node, those of a cell are chosen that are nearest to each other. Speeds are the same but where u may
change little in a cell: the sweep leaves something to spare there, of the duration some 1e-6.
"""

from __future__ import annotations

import ctypes
from bisect import bisect_left
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.codegen.compile import library
from deltaopt.curves.piecewise import Array
from deltaopt.errors import Infeasible
from deltaopt.planning.path.path_rows import AffineRows

FASTEST = 1e6
"""The largest b where no row bounds it, in the units of the sweep, in which motions have b of about
one. Speeds are found downwards from it, and known to its rounding."""
_VANISHING, _LOSING, _STEEPEST = 1e-13, 0.1, 50.0
"""As in ``sweep.c``: an alpha that is none; the share of a row's range at which a row that loses
its u counts; and how much u may then change in a cell, in units of its range."""
_OPTIONS = {"output_flag": False, "primal_feasibility_tolerance": 1e-10}


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
    ends, by the linear program.

    ``rows``: at both ends of every cell, the begin first, (2 N, rows). ``convex``: whether they are
    no tangents to something that is not convex, see ``PathRows.are_convex``. Raises Unattainable.
    """
    length, largest = float(h.sum()), float(np.abs(rows.alpha).max()) or 1.0
    b_unit = length / largest
    scaled = AffineRows(rows.alpha / largest, rows.beta * b_unit, rows.low, rows.high)
    cells, first, last = h / length, start / b_unit, goal / b_unit
    change = _largest_changes(cells, scaled, convex)
    b = _largest(cells, scaled, change, (first, first), last)
    if b is not None:
        return Speeds(b * b_unit, _accelerations(cells, scaled, change, b) / largest)

    def leads_to_goal(node: int) -> bool:
        left = AffineRows(*(each[2 * node :] for each in vars(scaled).values()))
        return _largest(cells[node:], left, change[node:], (0.0, FASTEST), last) is not None

    node = bisect_left(range(len(h)), True, key=leads_to_goal)
    raise Unattainable(node - 1 if node else None)


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
    code.on_mesh.restype = ctypes.c_int64
    return code


def _largest_changes(h: Array, rows: AffineRows, convex: bool) -> Array:
    """By how much u may change in each cell, (N,): not at all where no row depends on it at an end,
    and little where a row does at one end alone."""
    a = np.abs(rows.alpha).reshape(len(h), 2, -1)
    there, width = a > _VANISHING, (rows.high - rows.low).reshape(a.shape)
    room = np.divide(width, a, out=np.full(a.shape, np.inf), where=there).min(axis=(1, 2))
    finite = np.where(np.isfinite(room), room, 0.0)
    loses = there.any(axis=1) & (a.min(axis=1) * finite[:, None] < _LOSING)
    is_little = convex & np.isfinite(room) & loses.any(axis=1)
    change = np.where(is_little, _STEEPEST * h * finite, np.inf)
    acts = there & np.isfinite(np.minimum(-rows.low, rows.high)).reshape(a.shape)
    return np.where(np.asarray(acts.any(axis=2)).all(axis=1), change, 0.0)


def _largest(
    h: Array, rows: AffineRows, change: Array, start: tuple[float, float], goal: float
) -> Array | None:
    """The largest b at the nodes, (N + 1,), within ``start`` at the first; None if there is
    none."""
    N, m = len(h), rows.alpha.shape[1]
    b, u = ca.SX.sym("b", N + 1), ca.SX.sym("u", 2 * N)
    first, last, at_ends = u[::2], u[1::2], b[np.repeat(range(N + 1), 2)[1:-1].tolist()]
    alpha, beta, low, high = (ca.DM(each) for each in vars(rows).values())
    kept = [
        ca.diff(b) - h * (first + last),  # b' = 2 u
        ca.vec(alpha * ca.repmat(u, 1, m) + beta * ca.repmat(at_ends, 1, m)),
        last - first,
    ]
    program = {"x": ca.vertcat(b, u), "f": -ca.sum1(b), "g": ca.vertcat(*kept)}
    solver = ca.qpsol("speeds", "highs", program, {"error_on_fail": False, "highs": _OPTIONS})
    found = solver(
        lbx=ca.vertcat(start[0], ca.DM.zeros(N - 1), goal, -ca.DM.inf(2 * N)),
        ubx=ca.vertcat(start[1], FASTEST * ca.DM.ones(N - 1), goal, ca.DM.inf(2 * N)),
        lbg=ca.vertcat(ca.DM.zeros(N), ca.vec(low), -change),
        ubg=ca.vertcat(ca.DM.zeros(N), ca.vec(high), change),
    )["x"]
    return np.asarray(found[: N + 1]).ravel() if solver.stats()["success"] else None


def _accelerations(h: Array, rows: AffineRows, change: Array, b: Array) -> Array:
    """u at both ends of every cell, (N, 2), as near to each other as rows allow."""
    at_ends = np.repeat(b, 2)[1:-1, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        bounds = [(each - rows.beta * at_ends) / rows.alpha for each in (rows.low, rows.high)]
    there = np.abs(rows.alpha) > _VANISHING
    slow = np.where(there, np.minimum(*bounds), -np.inf).max(axis=1).reshape(-1, 2)
    fast = np.where(there, np.maximum(*bounds), np.inf).min(axis=1).reshape(-1, 2)
    total = np.diff(b) / h
    least = np.maximum(np.maximum(slow[:, 0], total - fast[:, 1]), (total - change) / 2)
    most = np.minimum(np.minimum(fast[:, 0], total - slow[:, 1]), (total + change) / 2)
    between = np.maximum(np.minimum(total / 2, most), least)
    first = np.where(least > most, (least + most) / 2, between)
    return np.stack([first, total - first], axis=1)
