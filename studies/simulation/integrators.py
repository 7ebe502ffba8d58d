"""Methods that integrate the equations of motion over time, as values for ``simulate``.

Two families. In the first the formulation is solved for q̈ and (q, q̇)˙ = (q̇, q̈) is an ordinary
differential equation, whose constraints hold at acceleration level only:

    Adams    variable order and step (CVODES): non-stiff motions; no derivatives of q̈ needed
    BDF      variable order and step (CVODES), Newton: stiff springs, dampers, feedback
    Gauss    collocation at Gauss's points with a fixed step: symplectic, symmetric, order 2 s

In the second the constraints themselves are in the system. With Gear, Gupta and Leimkuhler's (GGL)
second multiplier μ the index is 2 and both levels are kept:

    StabilisedDAE      q̇ = v + Jᵀ μ,  M v̇ = Q̂* + Q + Jᵀ λ,  f(q, t) = 0,  J v + μ_t = 0     (IDAS)
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from math import ceil
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.dynamics.formulation import Formulation, state
from deltaopt.dynamics.linear import solve
from deltaopt.dynamics.mechanism import SX, Mechanism
from deltaopt.errors import IntegrationFailed
from deltaopt.interrupts.requests import requests_held

Array = NDArray[np.float64]

MOST_STEPS = 50_000
"""Integration steps between two reported times before giving up."""
MOST_ITERATIONS = 20
"""Of Newton's method in a step of collocation; three or four are the rule."""
FREE = 1e10
"""Absolute tolerance of multipliers: errors of theirs, which are those of q̇ divided by the step,
stop neither Newton's method nor a step. Any value far beyond the multipliers does the same."""


@dataclass(frozen=True)
class Work:
    """What an integration cost, counted: the same on every machine and under any load.

    ``steps``: accepted steps. ``evaluations``: of the right-hand side (of the residual for a DAE),
    failed steps included. ``factorizations``: of Newton's matrix; 0 without Newton's method.
    """

    steps: int = 0
    evaluations: int = 0
    factorizations: int = 0

    def __add__(self, other: Work) -> Work:
        return Work(
            self.steps + other.steps,
            self.evaluations + other.evaluations,
            self.factorizations + other.factorizations,
        )


@dataclass(frozen=True)
class Equations:
    """What is integrated: a mechanism, a formulation of its dynamics and the controls' law.

    ``law``: (t, q, q̇) -> τ, m, in scalars.
    """

    mechanism: Mechanism
    formulation: Formulation
    law: ca.Function

    @cached_property
    def rate(self) -> ca.Function:
        """(t, (q, q̇), p) -> (q̇, q̈), by the formulation's forward dynamics."""
        t, x, p, dq, ddq, _ = self._dynamics
        return ca.Function("state_rate", [t, x, p], [ca.vertcat(dq, ddq)])

    @cached_property
    def multipliers(self) -> ca.Function:
        """(t, (q, q̇), p) -> λ, γ, by the formulation's forward dynamics."""
        t, x, p, _, _, lam = self._dynamics
        return ca.Function("multipliers", [t, x, p], [lam])

    @property
    def _dynamics(self) -> tuple[ca.MX, ...]:
        """t, (q, q̇), p, q̇, q̈, λ."""
        m = self.mechanism
        t, p = ca.MX.sym("t"), ca.MX.sym("p", m.parameters.numel())
        x = ca.MX.sym("x", 2 * m.q.numel())
        q, dq = ca.vertsplit(x, m.q.numel())
        return t, x, p, dq, *self.formulation.forward_dynamics(m)(t, q, dq, self.law(t, q, dq), p)

    @cached_property
    def stabilised(self) -> ca.Function:
        """(t, (q, v), (λ, μ), p) -> (q̇, v̇), (f, J v + μ_t), Gear, Gupta and Leimkuhler's form.

        The formulation gives λ at the start only: they are unknowns. M must be regular.
        """
        m, h = self.mechanism, self.mechanism.holonomic.numel()
        lam, mu = SX.sym("lam", m.J.shape[0]), SX.sym("mu", h)
        force = ca.substitute(m.Q_gyr + m.Q, m.controls, self.law(*state(m)))
        system = ca.Function(
            "system",
            [*state(m), lam, mu, m.parameters],
            [m.M, force + m.J.T @ lam, m.dq + m.J[:h, :].T @ mu, m.holonomic, m.constraint_rate],
        )
        t, p = ca.MX.sym("t"), ca.MX.sym("p", m.parameters.numel())
        x, z = ca.MX.sym("x", 2 * m.q.numel()), ca.MX.sym("z", lam.numel() + h)
        q, v = ca.vertsplit(x, m.q.numel())
        M, total, rate, f, constraint_rate = system(
            t, q, v, *ca.vertsplit(z, [0, lam.numel(), z.numel()]), p
        )
        ode = ca.vertcat(rate, solve(ca.densify(M), total))
        return ca.Function("stabilised", [t, x, z, p], [ode, ca.vertcat(f, constraint_rate)])


class Flow(Protocol):
    """Advances a state over a stretch of time."""

    def __call__(self, state: Array, start: float, span: float, p: Array) -> tuple[Array, Work]:
        """States (N × 2n) at fractions of the ``span`` after ``start`` (s), and what they cost.

        Raises IntegrationFailed where the motion cannot be followed.
        """
        ...


class Integrator(Protocol):
    """A method of integration; a value."""

    def flow(self, equations: Equations, fractions: list[float], tolerance: float) -> Flow:
        """The method for these equations, reporting at ``fractions`` (0 … 1] of a span.

        ``tolerance``: relative and absolute, of the local error or, with a fixed step, of the rates
        that Newton's method finds.
        """
        ...


@dataclass(frozen=True)
class Adams:
    """The variable-order Adams method of CVODES, solved by fixed-point iteration."""

    def flow(self, equations: Equations, fractions: list[float], tolerance: float) -> Flow:
        return _Cvodes.of("adams", "functional", equations, fractions, tolerance)


@dataclass(frozen=True)
class BDF:
    """The backward differentiation formulas of CVODES, orders 1 to 5, with Newton's method.

    Derivatives of q̈ come from the formulation: not for ``RankRevealing`` or ``LeastNorm``.
    """

    def flow(self, equations: Equations, fractions: list[float], tolerance: float) -> Flow:
        return _Cvodes.of("bdf", "newton", equations, fractions, tolerance)


@dataclass(frozen=True)
class StabilisedDAE:
    """Gear, Gupta and Leimkuhler's differential-algebraic system of index 2, by IDAS' BDF.

    It keeps positions and velocities on the constraints by itself: use it with
    ``NoStabilisation()``. Multipliers are left out of the error test, as index 2 asks for. Below a
    tolerance of some 1e-9 rounding, divided by the step, ends it.
    """

    def flow(self, equations: Equations, fractions: list[float], tolerance: float) -> Flow:
        system = equations.stabilised
        t, x, z, p = (ca.MX.sym("a", *system.size_in(i)) for i in range(4))
        start, span = ca.MX.sym("start"), ca.MX.sym("span")
        ode, alg = system(start + t * span, x, z, p)
        problem = {
            "t": t,
            "x": x,
            "z": z,
            "p": ca.vertcat(start, span, p),
            "ode": span * ode,
            "alg": alg,
        }
        options: dict[str, Any] = {
            "reltol": tolerance,
            "abstolv": [tolerance] * x.numel() + [FREE] * z.numel(),
            "nonlin_conv_coeff": 0.01,  # 0.33 takes nearly twice the steps for Andrews' squeezer
            "max_num_steps": MOST_STEPS,
            "disable_internal_warnings": True,
            "calc_ic": False,  # IDACalcIC is for index 1
            "suppress_algebraic": True,
            "cj_scaling": True,
        }
        return _Idas(equations, problem, fractions, options)


@dataclass(frozen=True)
class Gauss:
    """Collocation at Gauss's points with a fixed step: symplectic and symmetric.

    It keeps every quadratic invariant: in natural coordinates, whose constraints are quadratic,
    J q̇ = 0 holds to Newton's tolerance without any stabilisation, and f = 0 to the method's order.
    ``step``: s, shortened to divide the span; ``stages``: s, for the order 2 s.
    """

    step: float
    stages: int = 3

    def flow(self, equations: Equations, fractions: list[float], tolerance: float) -> Flow:
        return _Collocation(equations.rate, fractions, self, tolerance)


def _explicit(rate: ca.Function) -> dict[str, Any]:
    """The ordinary differential equation over a fraction of a span."""
    x, p = ca.MX.sym("x", rate.size1_in(1)), ca.MX.sym("p", rate.size1_in(2))
    fraction, start, span = ca.MX.sym("fraction"), ca.MX.sym("start"), ca.MX.sym("span")
    return {
        "t": fraction,
        "x": x,
        "p": ca.vertcat(start, span, p),
        "ode": span * rate(start + fraction * span, x, p),
    }


@dataclass(frozen=True)
class _Cvodes:
    """CVODES over a span of time."""

    integrator: ca.Function

    @classmethod
    def of(
        cls, method: str, iteration: str, equations: Equations, span: list[float], tolerance: float
    ) -> _Cvodes:
        """``method``, ``iteration``: linear multistep method and how its equations are solved, in
        the words of CVODES. ``span``: fractions of the time that are reported."""
        options: dict[str, Any] = {
            "linear_multistep_method": method,
            "nonlinear_solver_iteration": iteration,
            "reltol": tolerance,
            "abstol": tolerance,
            "max_num_steps": MOST_STEPS,
            "disable_internal_warnings": True,
        }
        problem = _explicit(equations.rate)
        return cls(ca.integrator("flow", "cvodes", problem, 0.0, span, options))

    def __call__(self, state: Array, start: float, span: float, p: Array) -> tuple[Array, Work]:
        return _run(self.integrator, start, span, p, x0=state)


@dataclass(frozen=True)
class _Idas:
    """IDAS over a span of time: built anew for each, because derivatives at its start are options.

    Without them its first steps fail the error test at tolerances below 1e-6.
    """

    equations: Equations
    problem: dict[str, Any]
    fractions: list[float]
    options: dict[str, Any]

    def __call__(self, state: Array, start: float, span: float, p: Array) -> tuple[Array, Work]:
        lam = np.asarray(self.equations.multipliers(start, state, p)).ravel()
        z = np.concatenate([lam, np.zeros(self.equations.mechanism.holonomic.numel())])
        rate = span * np.asarray(self.equations.stabilised(start, state, z, p)[0]).ravel()
        options = {**self.options, "init_xdot": rate.tolist()}
        flow = ca.integrator("flow", "idas", self.problem, 0.0, self.fractions, options)
        return _run(flow, start, span, p, x0=state, z0=z)


def _run(
    flow: ca.Function, start: float, span: float, p: Array, **initial: Array
) -> tuple[Array, Work]:
    """States and work of an integrator of SUNDIALS."""
    try:
        with requests_held():
            result = flow(p=np.concatenate([[start, span], p]), **initial)
    except RuntimeError as error:
        raise _failure(start, span, str(error)) from None
    told = flow.stats()
    work = Work(told["nsteps"], told["nfevals"], told["nlinsetups"])
    return np.asarray(result["xf"], dtype=float).T, work


@dataclass(frozen=True)
class _Collocation:
    """Collocation at Gauss's points, one implicit system a step."""

    rate: ca.Function
    fractions: list[float]
    method: Gauss
    tolerance: float

    def __call__(self, state: Array, start: float, span: float, p: Array) -> tuple[Array, Work]:
        states, work = [], Work()
        ends = [start + fraction * span for fraction in self.fractions]
        for begin, end in zip([start, *ends[:-1]], ends, strict=True):
            count = ceil((end - begin) / self.method.step * (1 - 1e-9))
            step = (end - begin) / count
            for i in range(count):
                state, spent = self._advance(state, begin + i * step, step, p)
                work += spent
            states.append(state)
        return np.array(states), work

    def _advance(self, state: Array, t: float, step: float, p: Array) -> tuple[Array, Work]:
        """The state after a step, by Newton's method from the rate at its start."""
        s = self.method.stages
        K = np.tile(self.rate(t, state, p).full().ravel(), s)
        for iteration in range(1, MOST_ITERATIONS + 1):
            residual, J = (x.full() for x in self._stages(K, state, t, step, p))
            if not (np.isfinite(residual).all() and np.isfinite(J).all()):
                break
            change = np.linalg.solve(J, residual.ravel())
            K = K - change
            if np.abs(change).max() <= self.tolerance * (1 + np.abs(K).max()):
                after = state + step * self._coefficients[1] @ K.reshape(s, -1)
                return after, Work(1, 1 + iteration * s, iteration)
        raise _failure(t, step, "")

    @cached_property
    def _coefficients(self) -> tuple[Array, Array, Array]:
        """A, b and c of the method: integrals of Lagrange's polynomials."""
        nodes, _ = np.polynomial.legendre.leggauss(self.method.stages)
        c = (nodes + 1) / 2
        A, b = np.empty((c.size, c.size)), np.empty(c.size)
        for j in range(c.size):
            others = np.delete(c, j)
            scale = 1 / np.prod(c[j] - others)
            lagrange = np.polynomial.Polynomial(scale * np.atleast_1d(np.poly(others))[::-1])
            integral = lagrange.integ()
            A[:, j], b[j] = integral(c), integral(1.0)
        return A, b, c

    @cached_property
    def _stages(self) -> ca.Function:
        """(K, state, t, step, p) -> residual and its Jacobian; K: rates at the stages in a row."""
        A, _, c = self._coefficients
        n, s = self.rate.size1_in(1), self.method.stages
        stacked, p = ca.MX.sym("K", n * s), ca.MX.sym("p", self.rate.size1_in(2))
        x, t, step = ca.MX.sym("x", n), ca.MX.sym("t"), ca.MX.sym("step")
        K = ca.reshape(stacked, n, s)
        residual = ca.vertcat(
            *(
                K[:, i] - self.rate(t + c[i] * step, x + step * (K @ ca.DM(A[i])), p)
                for i in range(s)
            )
        )
        jacobian = ca.jacobian(residual, stacked)
        return ca.Function("stages", [stacked, x, t, step, p], [residual, jacobian])


def _failure(start: float, span: float, message: str) -> IntegrationFailed:
    reason = re.search(r"(CV|IDA)_[A-Z_]+", message)
    return IntegrationFailed(
        f"the motion could not be followed between t = {start:g} s and {start + span:g} s"
        f" ({reason.group() if reason else 'the integrator failed'}): a singular configuration"
        " on the way, or a tolerance beyond double precision"
    )
