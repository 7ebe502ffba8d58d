"""Nonlinear programs for Ipopt, made of small functions evaluated at many points.

    minimise  c · z   subject to   l ≤ z ≤ u,   G z = 0,   l_i ≤ r(y_i, p) ≤ u_i,   y_i = L_i z

The functions r, their arguments and their derivatives by z are in `points`.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import NotConverged
from deltaopt.interrupts.requests import interrupts_not_lost
from deltaopt.planning.nlp.points import Layout, Points, derived_at

Options = dict[str, str | float | int | bool]

IPOPT: Options = {
    "print_time": False,
    "record_time": True,
    "show_eval_warnings": False,  # out of reach a trial point is NaN: Ipopt shortens its step
    "calc_lam_p": False,
    "no_nlp_grad": True,  # needed for sensitivities only; machine code has none
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.mu_strategy": "adaptive",
    "ipopt.nlp_scaling_method": "none",  # variables and rows come scaled by the scene
    "ipopt.tol": 1e-8,
    "ipopt.max_iter": 200,
}
OF_EFFORT: Options = {
    # From a bang-bang guess the default filter lets the duration diverge.
    "ipopt.adaptive_mu_globalization": "kkt-error",
}

_LOG = logging.getLogger(__name__)
"""Ipopt's iterations are told at the level DEBUG."""


def _log(stats: Mapping[str, Any]) -> None:
    """Say what every iteration of Ipopt did, to whoever wants to know."""
    if not _LOG.isEnabledFor(logging.DEBUG):
        return
    names = ("obj", "inf_pr", "inf_du", "mu", "alpha_pr")
    _LOG.debug("Ipopt: objective, infeasibility primal and dual, barrier, step")
    columns = [stats.get("iterations", {}).get(name, ()) for name in names]
    for number, (objective, *others) in enumerate(zip(*columns, strict=False)):
        line = f"{number:4d}  {objective:.9f}" + "".join(f"  {value:9.2e}" for value in others)
        _LOG.debug("%s", line)
    _LOG.debug("%s", stats["return_status"])


@dataclass(frozen=True)
class RunningCost:
    """The sum Σ weights[i] l(y_i, p) that is added to the cost: an integral by quadrature.

    ``points``: of the function l, which has one row; its bounds are not used. ``weights``: (n,).
    """

    points: Points
    weights: Array


@dataclass(frozen=True)
class IpoptSolution:
    """A solution by Ipopt: the variables ``z``, the multipliers of their bounds, unless these fix
    them, and of the rows.

    A multiplier is positive where an upper bound is active, negative where a lower one is.
    ``seconds``: wall time, of which ``evaluation_seconds`` in CasADi's functions.
    """

    z: Array
    bound_multipliers: Array
    row_multipliers: Array
    status: str
    iterations: int
    seconds: float
    evaluation_seconds: float


class IpoptProgram:
    """A nonlinear program, built once and solved many times with other bounds and parameters.

    ``cost``: the vector c, (n,). ``linear``: layout of the rows G z = 0. ``points``: the nonlinear
    rows. ``options``: of Ipopt, where they differ from ``IPOPT``. ``running``: a running cost.

    A program is solved by one thread at a time, since its solver remembers the last call; every
    plan builds its own.
    """

    def __init__(
        self,
        cost: Array,
        linear: Layout,
        points: list[Points],
        options: Options | None = None,
        running: RunningCost | None = None,
    ) -> None:
        self._n = len(cost)
        self.linear = linear
        self.points = points
        continuity = np.zeros(len(linear.columns))
        lower = np.concatenate([continuity, *(q.bounds(q.lower) for q in points)])
        upper = np.concatenate([continuity, *(q.bounds(q.upper) for q in points)])
        self.rows = lower, upper  # of all rows, linear ones first
        self._solver = self._build(cost, options or {}, running)

    @property
    def row_names(self) -> list[str]:
        """The name and the instant of each row, for error messages."""
        names = list(self.linear.names) or ["continuity"] * len(self.linear.columns)
        return names + [name for points in self.points for name in points.row_names()]

    def solve(
        self, guess: Array, lower: Array, upper: Array, p: Array, shares: Array | float = 1.0
    ) -> IpoptSolution:
        """Solve from a guess, within bounds of the variables, (n,) each, with parameters p.

        ``shares``: part of their bounds that the nonlinear rows may use, (rows,) or one for all.
        Raises NotConverged with Ipopt's status and the last iterate.
        """
        begin, linear = perf_counter(), len(self.linear.columns)
        rows = [bounds.copy() for bounds in self.rows]
        for bounds in rows:
            bounds[linear:] *= shares
        if (lower > upper).any() or (rows[0] > rows[1]).any():  # Ipopt would refuse to begin
            raise NotConverged("limits, once tightened, leave no room", "Ill_posed", guess)
        with interrupts_not_lost():
            result = self._solver(x0=guess, lbx=lower, ubx=upper, lbg=rows[0], ubg=rows[1], p=p)
        stats = self._solver.stats()
        _log(stats)
        z = np.asarray(result["x"].full()).ravel()
        if not stats["success"]:
            raise NotConverged(
                self._failure(stats, np.asarray(result["g"].full()).ravel()),
                stats["return_status"],
                z,
            )
        return IpoptSolution(
            z=z,
            bound_multipliers=np.asarray(result["lam_x"].full()).ravel(),
            row_multipliers=np.asarray(result["lam_g"].full()).ravel(),
            status=stats["return_status"],
            iterations=stats["iter_count"],
            seconds=perf_counter() - begin,
            evaluation_seconds=sum(
                t for name, t in stats.items() if name.startswith("t_wall_nlp_")
            ),
        )

    def _build(self, cost: Array, options: Options, running: RunningCost | None) -> ca.Function:
        np_ = self.points[0].function.function.size1_in(1)
        z, p = ca.MX.sym("z", self._n), ca.MX.sym("p", np_)
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", len(self.rows[0]))
        G = self.linear.matrix(self._n)
        f, gradient, hessian = ca.dot(ca.DM(cost), z), ca.MX(ca.DM(cost)), ca.MX(self._n, self._n)
        g, jac, first = [ca.mtimes(G, z)], [ca.MX(G)], G.shape[0]
        for each in self.points:
            end = first + each.number * each.rows
            own = ca.reshape(lam_g[first:end], each.rows, each.number)
            r, slope, curved = derived_at(each, z, p, own)
            g.append(ca.vec(r))
            jac.append(slope)
            hessian += curved
            first = end
        if running is not None:
            weights = ca.DM(running.weights).T
            r, slope, curved = derived_at(running.points, z, p, lam_f * weights)
            f += ca.dot(weights, r)
            gradient += ca.densify(ca.mtimes(weights, slope)).T
            hessian += curved
        program = {"x": z, "p": p, "f": f, "g": ca.vertcat(*g)}
        functions = {
            "grad_f": ca.Function("nlp_grad_f", [z, p], [f, gradient]),
            "jac_g": ca.Function("nlp_jac_g", [z, p], [program["g"], ca.vertcat(*jac)]),
            "hess_lag": ca.Function("nlp_hess_l", [z, p, lam_f, lam_g], [ca.triu(hessian)]),
        }
        return ca.nlpsol("nlp", "ipopt", program, {**functions, **IPOPT, **options})

    def _failure(self, stats: dict[str, object], g: Array) -> str:
        """A sentence with Ipopt's status and the row that is violated most."""
        lower, upper = self.rows
        violation = np.maximum(lower - g, g - upper)
        worst = int(np.nanargmax(violation)) if np.isfinite(violation).any() else 0
        return (
            f"Ipopt stopped after {stats['iter_count']} iterations: {stats['return_status']}; "
            f"worst constraint: {self.row_names[worst]}, violated by {violation[worst]:.1e}"
        )
