"""SQP methods of CasADi's for a program written stage by stage, and Ipopt beside them."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator, Sequence
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.planning.nlp.program import IPOPT, Options
from studies.stages import StageResult, Stages, StageSolver, Start

_MARGIN = 1e-5
"""Least curvature of the quadratic programs, in any direction."""
_QUIET = {
    "print_time": False,
    "record_time": True,
    "show_eval_warnings": False,
    "calc_lam_p": False,
    "no_nlp_grad": True,
}
_SQP = {
    "print_header": False,
    "print_iteration": False,
    "print_status": False,
    "max_iter": 60,
    "tol_pr": 1e-6,
    "tol_du": 1e-4,
}


def ipopt(stages: Stages, options: Options) -> StageSolver:
    """With the planner's options but for some."""
    functions = {
        "grad_f": stages.function("fg"),
        "jac_g": stages.function("nlp_jac_g"),
        "hess_lag": stages.function("upper_hess_lag"),
    }
    return StageSolver(stages, "ipopt", {**functions, **IPOPT, **options})


def sqp(stages: Stages, quadratic: str) -> StageSolver:
    """CasADi's SQP method with a solver of quadratic programs."""
    options = {"jac_fg": stages.function("jac_fg"), **_quadratic(stages, quadratic)}
    return StageSolver(stages, "sqpmethod", {**options, **_SQP})


class FeasibleSqp:
    """CasADi's feasible SQP method: every iterate keeps all rows, to 1e-6.

    Variables are differences from the start, and fixed ones have 1e-9 to move in: in its
    feasibility steps CasADi 3.8.2 poses bounds that are off by the iterate, which leaves nothing
    for a variable that is fixed elsewhere than at zero.
    """

    def __init__(self, stages: Stages, quadratic: str) -> None:
        self._stages = stages
        convex = _convex(stages)
        inputs = [ca.MX.sym(convex.name_in(i), convex.size1_in(i)) for i in range(convex.n_in())]
        d, p, *prices = inputs
        origin = ca.MX.sym("origin", d.numel())
        at, pair = (d + origin, p), [d, ca.vertcat(p, origin)]
        f, g, gradient, jacobian = (
            stages.function(name)(*at) for name in ("nlp_f", "nlp_g", "nlp_grad_f", "jac_g")
        )
        functions = {
            "f": ca.Function("f", pair, [f]),
            "g": ca.Function("g", pair, [g]),
            "grad_f": ca.Function("grad_f", pair, [gradient]),
            "jac_g": ca.Function("jac_g", pair, [jacobian]),
            "hess_lag": ca.Function("hess_lag", [*pair, *prices], [convex(*at, *prices)]),
        }
        options = {**functions, **_solver(stages, quadratic), **_SQP, **_QUIET}
        options |= {"feas_tol": 1e-6, "optim_tol": 1e-6}
        program = {"x": d, "p": pair[1], "f": f, "g": g}
        with _silence():
            self._solver = ca.nlpsol("solver", "feasiblesqpmethod", program, options)

    def solve(self, start: Start, multipliers: StageResult | None = None) -> StageResult:
        """From a start that keeps all rows, and the multipliers of a similar problem."""
        copies, (lower, upper) = self._stages.copies, self._stages.row_bounds
        origin = start.z[copies]
        prices, row_prices = (
            (multipliers.prices, multipliers.row_prices) if multipliers else (0.0, 0.0)
        )
        with _silence():
            result = self._solver(
                x0=0,
                p=np.concatenate([start.p, origin]),
                lbx=start.lower[copies] - origin - 1e-9,
                ubx=start.upper[copies] - origin + 1e-9,
                lbg=lower,
                ubg=upper,
                lam_x0=prices,
                lam_g0=row_prices,
            )
        d, prices, row_prices = (result[k].full().ravel() for k in ("x", "lam_x", "lam_g"))
        return self._stages.result(origin + d, prices, row_prices, self._solver.stats())


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """It tells its steps, and the programs that it cannot pose, come what may."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        yield


def _quadratic(stages: Stages, name: str) -> dict[str, Any]:
    """Exact Hessians, convex, and the solver."""
    return {"hess_lag": _convex(stages), **_solver(stages, name)}


def _solver(stages: Stages, name: str) -> dict[str, Any]:
    """A solver of quadratic programs with what it wants to know."""
    known: dict[str, Any] = {"error_on_fail": False, "print_time": False}
    if name == "hpipm":
        known |= stages.structure
    return {"qpsol": name, "qpsol_options": known}


def _convex(stages: Stages) -> ca.Function:
    """The Hessian with every stage's eigenvalues raised to the margin.

    CasADi's own convexification by eigenvalues does not converge on these blocks, and its shift
    by Gershgorin's bound is thousands of times the curvature that matters.
    """
    exact = stages.function("hess_lag")
    inputs = [ca.MX.sym(exact.name_in(i), exact.sparsity_in(i)) for i in range(exact.n_in())]
    raised = _Raised(exact.sparsity_out(0), [len(own) for own in stages.order])
    convex = ca.Function("convex", inputs, [raised(exact(*inputs))])
    _KEPT.append(raised)
    return convex


_KEPT: list[ca.Callback] = []
"""CasADi calls what Python must not have collected."""


class _Raised(ca.Callback):
    """A symmetric matrix of diagonal blocks with all eigenvalues at least at the margin."""

    def __init__(self, sparsity: ca.Sparsity, sizes: list[int]) -> None:
        ca.Callback.__init__(self)
        self._given = sparsity
        self._full = ca.diagcat(*(ca.DM.ones(size, size) for size in sizes)).sparsity()
        self._first, self._width = np.cumsum([0, *sizes]), max(sizes)
        self._from, self._to = self._padded(sparsity), self._padded(self._full)
        self.construct("raised", {})

    def get_sparsity_in(self, _: int) -> ca.Sparsity:
        return self._given

    def get_sparsity_out(self, _: int) -> ca.Sparsity:
        return self._full

    def eval(self, arguments: Sequence[ca.DM]) -> list[ca.DM]:
        blocks = np.zeros((len(self._first) - 1, self._width, self._width))
        blocks[self._from] = arguments[0].nonzeros()
        values, vectors = np.linalg.eigh(blocks)
        raised = (vectors * np.maximum(values, _MARGIN)[:, None]) @ vectors.transpose(0, 2, 1)
        return [ca.DM(self._full, raised[self._to])]

    def _padded(self, sparsity: ca.Sparsity) -> tuple[Any, Any, Any]:
        """Places of nonzeros among blocks of equal width."""
        rows, columns = (np.array(i, dtype=np.intp) for i in sparsity.get_triplet())
        block = np.searchsorted(self._first, rows, side="right") - 1
        return block, rows - self._first[block], columns - self._first[block]
