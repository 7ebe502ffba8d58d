"""Nonlinear programs for Ipopt, most of whose work is what motions ask of motors at many points.

Torques and speeds at a point are unknowns. That they are those of the point's motion are
constraints whose derivatives are made once, for one point; all other constraints are polynomials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

QUIET = {
    "print_time": False,
    "show_eval_warnings": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.max_iter": 500,
}
"""Options of Ipopt that print nothing."""
OPTIONS = QUIET | {"ipopt.tol": 1e-8}
_FAST = 10.0
"""Size of the speed of a motor, rad/s."""


@dataclass(frozen=True)
class _Point:
    """A motion (x, v, a) and what it asks, 6, in units of ``scale``; ``place``: of these among the
    unknowns."""

    motion: ca.SX
    asked: ca.SX
    scale: Array
    place: int


class SparseProgram:
    """Unknowns, in units that make them of size one, and constraints, as they come."""

    def __init__(self) -> None:
        self._unknowns: list[ca.SX] = []
        self._guess: list[Array] = []
        self._least: list[Array] = []
        self._rows: list[ca.SX] = []
        self._limits: list[Array] = []
        self._points: dict[ca.Function, list[_Point]] = {}

    def unknown(self, guess: Array, scale: ArrayLike, least: float = -np.inf) -> ca.SX:
        """A column of unknowns of the size ``scale``."""
        new = ca.SX.sym(f"w{len(self._unknowns)}", len(guess))
        self._unknowns.append(new)
        self._guess.append(guess / scale)
        self._least.append(np.broadcast_to(np.divide(least, scale), len(guess)))
        return ca.DM(scale) * new

    def limit(self, rows: ca.SX, low: float, high: float) -> None:
        """Rows of size one."""
        self._rows.append(rows)
        self._limits.append(np.repeat([[low], [high]], rows.numel(), axis=1))

    def equal(self, this: ca.SX, that: ca.SX | ArrayLike, scale: float) -> None:
        self.limit((this - that) / scale, 0, 0)

    def asked(self, of_motors: ca.Function, motion: Sequence[ca.SX], torque: Array) -> ca.SX:
        """The torques, of the size of ``torque``, and the speeds, 6, that a motion (x, v, a),
        linear in the unknowns, asks of motors."""
        place = sum(map(len, self._guess))
        scale = np.append(torque, np.full(3, _FAST))
        asked = self.unknown(np.zeros(6), scale)
        point = _Point(ca.vertcat(*motion), asked, scale, place)
        self._points.setdefault(of_motors, []).append(point)
        return asked

    def solved(self, cost: ca.SX, wanted: Sequence[ca.SX]) -> list[Array]:
        """The values of what is wanted where the cost is least."""
        w, g = ca.vertcat(*self._unknowns), ca.vertcat(*self._rows)
        blocks = [_Block(of_motors, w, points) for of_motors, points in self._points.items()]
        guess = np.concatenate(self._guess)
        for block in blocks:
            block.complete(guess)
        sizes = [g.numel(), *(block.size for block in blocks)]
        x, p, weight = ca.MX.sym("x", len(guess)), ca.MX.sym("p", 0), ca.MX.sym("weight")
        lam = ca.MX.sym("lam", sum(sizes))
        mine, *theirs = ca.vertsplit(lam, np.cumsum([0, *sizes]).tolist())

        of_cost, of_rows = ca.SX.sym("of_cost"), ca.SX.sym("of_rows", g.numel())
        curvature = ca.hessian(of_cost * cost + ca.dot(of_rows, g), w)[0]
        row, slope = ca.Function("rows", [w], [g, ca.jacobian(g, w)])(x)
        bend = ca.Function("bend", [w, of_cost, of_rows], [curvature])(x, weight, mine)
        parts = [block.rows(x) for block in blocks]
        rows = ca.vertcat(row, *(part[0] for part in parts))
        slopes = ca.vertcat(slope, *(part[1] for part in parts))
        for block, its in zip(blocks, theirs, strict=True):
            bend += block.bend(x, its)
        derivatives = {
            "jac_g": ca.Function("jac_g", [x, p], [rows, slopes]),
            "hess_lag": ca.Function("hess_lag", [x, p, weight, lam], [ca.triu(bend)]),
        }
        problem = {"x": x, "p": p, "f": ca.Function("cost", [w], [cost])(x), "g": rows}
        solver = ca.nlpsol("cycle", "ipopt", problem, OPTIONS | derivatives)
        limits = np.hstack([*self._limits, np.zeros((2, sum(sizes[1:])))])
        least = np.concatenate(self._least)
        found = solver(x0=guess, lbx=least, lbg=limits[0], ubg=limits[1], p=[])
        assert solver.stats()["success"], solver.stats()["return_status"]
        values = ca.Function("values", [w], list(wanted))(found["x"])
        return [each.full().ravel() for each in values]


class _Block:
    """The constraints of all points that ask one function of motors."""

    def __init__(self, of_motors: ca.Function, w: ca.SX, points: Sequence[_Point]) -> None:
        self._points, self._count = points, len(points)
        self._asked, self._slope, self._bend = (
            function.map(self._count) for function in _derivatives(of_motors)
        )
        motions = ca.vertcat(*(point.motion for point in points))
        motions = ca.Function("motions", [w], [motions, ca.jacobian(motions, w)])
        self._offset, self._gather = motions(0)
        asked = ca.vertcat(*(point.asked for point in points))
        self._scale = np.concatenate([point.scale for point in points])
        self._own = ca.Function("own", [], [ca.jacobian(asked, w)])()["o0"]

    @property
    def size(self) -> int:
        return 6 * self._count

    def complete(self, guess: Array) -> None:
        """Write what the points of a guess ask into it."""
        asked = self._asked(self._motions(ca.DM(guess))).full()
        for point, each in zip(self._points, asked.T, strict=True):
            guess[point.place : point.place + 6] = each / point.scale

    def rows(self, x: ca.MX) -> tuple[ca.MX, ca.MX]:
        """What is asked less what the unknowns say, and its derivatives."""
        motions, scale = self._motions(x), 1 / self._scale
        slope = _on_diagonal(self._slope(motions), 6, self._count)
        scaled = ca.mtimes(ca.diag(ca.DM(scale)), ca.mtimes(slope, self._gather))
        own = ca.mtimes(ca.diag(ca.DM(scale)), self._own)
        return scale * ca.vec(self._asked(motions)) - ca.mtimes(own, x), scaled - own

    def bend(self, x: ca.MX, multipliers: ca.MX) -> ca.MX:
        """The second derivatives of the rows times multipliers."""
        each = ca.reshape(multipliers / self._scale, 6, self._count)
        bend = _on_diagonal(self._bend(self._motions(x), each), 9, self._count)
        return ca.mtimes(self._gather.T, ca.mtimes(bend, self._gather))

    def _motions(self, x: ca.MX | ca.DM) -> ca.MX | ca.DM:
        return ca.reshape(ca.mtimes(self._gather, x) + self._offset, 9, self._count)


def _on_diagonal(blocks: ca.MX, rows: int, count: int) -> ca.MX:
    """Dense blocks beside each other as those on the diagonal of a matrix."""
    block = ca.Sparsity.dense(rows, blocks.shape[1] // count)
    return ca.MX(ca.diagcat(*[block] * count), ca.vec(blocks))


@lru_cache(maxsize=16)
def _derivatives(of_motors: ca.Function) -> tuple[ca.Function, ca.Function, ca.Function]:
    """Torques and speeds of a motion (9), their derivatives, and the second ones of their sum with
    multipliers (6)."""
    motion, lam = ca.SX.sym("motion", 9), ca.SX.sym("lam", 6)
    asked = ca.vertcat(*of_motors(*ca.vertsplit(motion, 3)))
    cse = {"cse": True}
    bend = ca.hessian(ca.dot(lam, asked), motion)[0]
    return (
        ca.Function("asked", [motion], [asked], cse),
        ca.Function("slope", [motion], [ca.densify(ca.jacobian(asked, motion))], cse),
        ca.Function("bend", [motion, lam], [ca.densify(bend)], cse),
    )
