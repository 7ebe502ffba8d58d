"""A nonlinear program on a mesh, written stage by stage for the solvers that want it so.

fatrop, HPIPM and convexification by blocks exploit variables and rows in this order, the rows
that close gaps with exactly this sign:

    s = (x_0, u_0, x_1, u_1, …, x_N, u_N)      rows = (x_1 - F(x_0, u_0), g_0, …, g_N)

A program's variables lie interval by interval already, but for the duration that is common to
all. So every stage has a duration of its own, and hands it on as a state: T_{k+1} - T_k = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.codegen.compile import library
from deltaopt.errors import MissingPackage
from deltaopt.motion.trajectory import Array
from deltaopt.planning.nlp.program import Layout, Options, Points, assemble_hessian, assemble_rows

Integers = NDArray[np.intp]

_FUNCTIONS = {
    "nlp": (2, "f g"),
    "nlp_f": (2, "f"),
    "nlp_g": (2, "g"),
    "nlp_fg": (2, "f g"),
    "nlp_grad_f": (2, "grad_f_x"),
    "nlp_jac_g": (2, "g jac_g_x"),
    "nlp_hess_l": (4, "grad_gamma_x hess_gamma_x_x"),
    "nlp_grad": (4, "f g grad_gamma_x grad_gamma_p"),
    "fg": (2, "f grad_f_x"),
    "jac_g": (2, "jac_g_x"),
    "jac_fg": (2, "f grad_f_x g jac_g_x"),
    "hess_lag": (4, "hess_gamma_x_x"),
    "upper_hess_lag": (4, "triu_hess_gamma_x_x"),
}
"""Those that CasADi looks for in a library by these names, then those that solvers are handed
as options: how many of the inputs (x, p, λ_f, λ_g), and the results. Of the parameters'
multipliers, which nobody asks for, only the place is kept."""


@dataclass(frozen=True)
class Stages:
    """A program of n variables z, the last of them T, in this order.

    ``linear``: rows G z = 0, for every interval one for each state but T. ``points``: all other
    rows. ``block``: variables of an interval. ``states``: places in the block of what goes on
    continuously; the others, and at the end what there is of them, are controls.
    """

    n: int
    linear: Layout
    points: list[Points]
    block: int
    states: tuple[int, ...]

    @property
    def horizon(self) -> int:
        return (self.n - 1) // self.block

    @property
    def nx(self) -> int:
        return len(self.states) + 1

    @cached_property
    def order(self) -> list[Integers]:
        """Of every stage the places of its variables among z."""
        T, own = self.n - 1, np.array(self.states)
        rest = np.setdiff1d(np.arange(self.block), own)
        first = self.block * np.arange(self.horizon + 1)
        parts = [(k + own, [T], k + rest) for k in first]
        return [np.concatenate([x, t, u[u < T]]) for x, t, u in parts]

    @cached_property
    def copies(self) -> Integers:
        """s = z[copies]."""
        return np.concatenate(self.order)

    @cached_property
    def durations(self) -> Integers:
        """Places of every stage's T in s."""
        return np.flatnonzero(self.copies == self.n - 1)

    @cached_property
    def gaps(self) -> Layout:
        """x_{k+1} - F(x_k, u_k), all but T; then T_{k+1} - T_k."""
        N, k = self.horizon, self.linear.columns.shape[1]
        columns, weights = np.zeros((N, k), dtype=np.intp), np.zeros((N, k))
        columns[:, 0], columns[:, 1] = self.durations[1:], self.durations[:-1]
        weights[:, 0], weights[:, 1] = 1.0, -1.0
        return Layout(
            np.vstack([self._places[self.linear.columns], columns]),
            np.vstack([-self.linear.weights, weights]),
        )

    @cached_property
    def rows(self) -> list[Integers]:
        """Of every stage the places of its rows among gaps and points, gaps first."""
        N, own = self.horizon, self.nx - 1
        gaps = np.column_stack([np.arange(own * N).reshape(N, own), own * N + np.arange(N)])
        found: list[list[Integers]] = [[gap] for gap in gaps] + [[]]
        first = self.nx * N
        for points in self.points:
            stages = self._stages_of(points)
            places = first + np.arange(points.number * points.rows).reshape(points.number, -1)
            for k in range(N + 1):
                found[k].append(places[stages == k].ravel())
            first += places.size
        return [np.concatenate(parts) for parts in found]

    @property
    def structure(self) -> dict[str, int | list[int]]:
        """N, nx, nu, ng: options of CasADi's solvers that know stages."""
        N, nx = self.horizon, self.nx
        closing = [nx] * N + [0]
        return {
            "N": N,
            "nx": [nx] * (N + 1),
            "nu": [len(own) - nx for own in self.order],
            "ng": [len(rows) - gap for rows, gap in zip(self.rows, closing, strict=True)],
        }

    @cached_property
    def row_bounds(self) -> tuple[Array, Array]:
        zero, order = np.zeros(self.nx * self.horizon), np.concatenate(self.rows)
        lower = np.concatenate([zero, *(q.bounds(q.lower) for q in self.points)])
        upper = np.concatenate([zero, *(q.bounds(q.upper) for q in self.points)])
        return lower[order], upper[order]

    @cached_property
    def code(self) -> Path:
        """Machine code of the program and its exact derivatives, for any solver of CasADi's.

        Raises MissingPackage where there is no C compiler.
        """
        inputs, results = self._expressions()
        generator = ca.CodeGenerator("program.c")
        for name, (number, asked) in _FUNCTIONS.items():
            given, names = dict(list(inputs.items())[:number]), asked.split()
            outputs = [results[key] for key in names]
            generator.add(ca.Function(name, list(given.values()), outputs, list(given), names))
        built = library(generator.dump())
        if built is None:
            raise MissingPackage("no C compiler is installed")
        return built

    def function(self, name: str) -> ca.Function:
        """One of them."""
        return ca.external(name, str(self.code))

    def _expressions(self) -> tuple[dict[str, ca.MX], dict[str, ca.MX]]:
        """Inputs and results by their names."""
        n, order = len(self.copies), np.concatenate(self.rows)
        s = ca.MX.sym("x", n)
        p = ca.MX.sym("p", self.points[0].function.function.size1_in(1))
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", len(order))
        prices = lam_g[_integers(np.argsort(order))]
        points, derived = [self._moved(points) for points in self.points], attrgetter("derived")
        g, jac, curvature = assemble_rows(self.gaps, points, derived, s, p, prices)
        slope = ca.DM.zeros(n)
        slope[int(self.durations[-1])] = 1.0
        upper = assemble_hessian(curvature, n)
        jac = jac[_integers(order), :]
        results = {
            "f": ca.dot(slope, s),
            "g": g[_integers(order)],
            "grad_f_x": ca.MX(slope),
            "jac_g_x": jac,
            "grad_gamma_x": lam_f * slope + ca.mtimes(jac.T, lam_g),
            "grad_gamma_p": ca.MX.zeros(p.numel()),
            "hess_gamma_x_x": ca.triu2symm(upper),
            "triu_hess_gamma_x_x": upper,
        }
        return {"x": s, "p": p, "lam_f": lam_f, "lam_g": lam_g}, results

    def result(
        self, s: Array, prices: Array, row_prices: Array, stats: dict[str, Any]
    ) -> StageResult:
        """What a solver of CasADi's found, with its statistics."""
        return StageResult(
            s,
            prices,
            row_prices,
            float(s[self.durations[-1]]),
            bool(stats["success"]),
            int(stats["iter_count"]),
            sum(t for name, t in stats.items() if name.startswith("t_wall_nlp_")),
            stats["t_wall_total"],
        )

    @cached_property
    def _places(self) -> Integers:
        """Of z in s, T's in the last stage."""
        places = np.zeros(self.n, dtype=np.intp)
        places[self.copies] = np.arange(len(self.copies))
        return places

    def _stages_of(self, points: Points) -> Integers:
        """In which stage each point lies: a knot's rows are the later interval's."""
        columns = points.layout.columns.reshape(points.number, -1)
        latest = np.where(columns < self.n - 1, columns, -1).max(axis=1)
        return np.asarray(latest // self.block, dtype=np.intp)

    def _moved(self, points: Points) -> Points:
        """The same points among s."""
        columns = points.layout.columns.reshape(points.number, -1)
        durations = self.durations[self._stages_of(points)][:, None]
        moved = np.where(columns == self.n - 1, durations, self._places[columns])
        layout = Layout(moved.reshape(points.layout.columns.shape), points.layout.weights)
        return replace(points, layout=layout)


@dataclass(frozen=True)
class Start:
    """Where a solver begins: a program's variables, their bounds and its parameters."""

    z: Array
    lower: Array
    upper: Array
    p: Array


@dataclass(frozen=True)
class StageResult:
    """``s``, multipliers of its bounds and of the rows; seconds of evaluation and in total."""

    s: Array
    prices: Array
    row_prices: Array
    T: float
    solved: bool
    iterations: int
    evaluation: float
    total: float


class StageSolver:
    """A solver of CasADi's for the stages' program."""

    def __init__(self, stages: Stages, plugin: str, options: dict[str, Any]) -> None:
        self._stages = stages
        quiet = {"print_time": False, "record_time": True, "show_eval_warnings": False}
        self._solver = ca.nlpsol("solver", plugin, str(stages.code), {**quiet, **options})

    def solve(self, start: Start, multipliers: StageResult | None = None) -> StageResult:
        """From a start, and the multipliers of a similar problem where there are any."""
        copies, (lower, upper) = self._stages.copies, self._stages.row_bounds
        begin = {"x0": start.z[copies], "lbx": start.lower[copies], "ubx": start.upper[copies]}
        if multipliers is not None:
            begin |= {"lam_x0": multipliers.prices, "lam_g0": multipliers.row_prices}
        result = self._solver(**begin, p=start.p, lbg=lower, ubg=upper)
        s, prices, row_prices = (result[k].full().ravel() for k in ("x", "lam_x", "lam_g"))
        return self._stages.result(s, prices, row_prices, self._solver.stats())


def fatrop(stages: Stages, settings: Options) -> StageSolver:
    """fatrop, told the structure, to 200 iterations."""
    own = {"print_level": 0, "max_iter": 200, **settings}
    options = {"structure_detection": "manual", **stages.structure, "fatrop": own}
    return StageSolver(stages, "fatrop", options)


def _integers(indices: Sequence[int] | Integers) -> list[int]:
    return [int(i) for i in indices]
