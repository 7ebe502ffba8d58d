"""States of the paper's Delta that fit together to many digits, and errors against them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.many_digits import ManyDigits, Matrix
from deltaopt.compare.dynamics.models import written_out
from deltaopt.compare.dynamics.tasks import FORWARD, Samples, Task
from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.consistency import Projector
from deltaopt.dynamics.formulation import state
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.mechanism import Mechanism
from deltaopt.mechanisms.delta.mechanism import DeltaParameters

PAPER = DeltaParameters(
    a1=0.20,
    a2=0.10,
    a3=0.25,
    a4=0.10,
    m1=0.30,
    m2=1.00,
    m3=0.40,
    m4=0.25,
    I33=0.40 * 0.10**2 / 3,
    I41=0.25 * 0.25**2 / 3,
    I43=0.25 * 0.25**2 / 3,
    g=9.81,
)
"""Section 5.3; slender bars."""

NEAR_HOME = np.array([0.45, 0.0, 0.0, *3 * [-0.232, -2.20, 0.0]])
"""Roughly the q of the platform at (0.45, 0, 0) m, m and rad."""


def exact_samples(mechanism: Mechanism, count: int, exact: ManyDigits) -> Samples:
    """Make random states of the paper's Delta whose q, q̇, q̈, τ fit to ``exact``'s digits.

    A random neighbour of ``NEAR_HOME`` is moved onto the constraints, by Newton's method in
    many digits at last; torques are chosen at random; q̈ follows from L_I's linear system.
    Only then are they rounded.
    """
    rng, p = np.random.default_rng(0), np.asarray(ca.DM(PAPER.vector())).ravel()
    maker = _Maker(mechanism, p, exact)
    rows = [maker.row(rng) for _ in range(count)]
    q, dq, ddq, tau = (np.array(part) for part in zip(*rows, strict=True))
    return Samples(q, dq, ddq, tau, p)


@dataclass(frozen=True)
class _Maker:
    """Makes states of ``mechanism`` in the arithmetic of ``exact``."""

    mechanism: Mechanism
    parameters: Array
    exact: ManyDigits

    def row(self, rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
        """Make q, q̇, q̈, τ, each rounded once."""
        n, m = self.mechanism.q.numel(), self.mechanism.controls.numel()
        guess = NEAR_HOME + rng.uniform(-1, 1, n) * np.repeat([0.12, 0.3], [3, n - 3])
        speeds = rng.uniform(-1, 1, n) * np.repeat([1.0, 5.0], [3, n - 3])
        q, dq = self.consistent(*self.projector(0.0, guess, speeds, self.parameters))
        tau = self.exact.matrix(rng.uniform(-5, 5, m))
        A, b = self.exact.evaluate(self.big_system, [0.0], q, dq, tau, self.parameters)
        ddq = self.exact.solve(A, b)[:n]
        return rounded(q), rounded(dq), rounded(ddq), rounded(tau)

    def consistent(self, q0: Array, dq0: Array) -> tuple[Matrix, Matrix]:
        """Return the state on the constraints near one that is on them in double precision.

        Every step of Newton's method doubles the digits: 16, 32, 64.
        """
        q, dq = self.exact.matrix(q0), self.exact.matrix(dq0)
        for _ in range(2 + self.exact.digits // 32):
            f, _, J = self.exact.evaluate(self.constraints, [0.0], q, dq, self.parameters)
            q -= J.T * self.exact.solve(J * J.T, f)
        _, rate, J = self.exact.evaluate(self.constraints, [0.0], q, dq, self.parameters)
        return q, dq - J.T * self.exact.solve(J * J.T, rate)

    @cached_property
    def projector(self) -> Projector:
        return Projector(self.mechanism)

    @cached_property
    def constraints(self) -> ca.Function:
        """(t, q, q̇, p) -> f, J q̇ + μ, J."""
        m = self.mechanism
        results = [m.holonomic, m.constraint_rate, m.J]
        return ca.Function("constraints", [*state(m), m.parameters], results)

    @cached_property
    def big_system(self) -> ca.Function:
        """(t, q, q̇, τ, p) -> A, b of L_I's forward dynamics."""
        inputs, A, b = FORWARD.big_system(self.mechanism)
        return ca.Function("big_system", inputs, [A, b])


def rounding_error(mechanism: Mechanism, task: Task, samples: Samples, exact: ManyDigits) -> Array:
    """Return the relative error (N,) of L_E evaluated exactly at the rounded values.

    No computation that starts from doubles can be expected to do better.
    """
    function, inputs = written_out(Explicit())(mechanism, task), task.inputs(samples)
    results = [
        rounded(exact.evaluate(function, *row, samples.parameters)[0])
        for row in zip(*inputs, strict=True)
    ]
    return relative_error(np.array(results), task.truth(samples))


def rounded(column: Matrix) -> Array:
    """Return the doubles nearest to the entries of a column."""
    return np.array([float(x) for x in column])


def relative_error(value: Array, truth: Array) -> Array:
    """Return the largest component of the error over the largest of the truth, (N,)."""
    error: Array = np.abs(value - truth).max(axis=1) / np.abs(truth).max(axis=1)
    return error
