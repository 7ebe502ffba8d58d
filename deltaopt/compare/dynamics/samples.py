"""States of the paper's Delta that fit together to many digits, and errors against them."""

from __future__ import annotations

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.many_digits import ManyDigits, Matrix
from deltaopt.compare.dynamics.models import FORWARD, Computation, StateSamples, written_out
from deltaopt.compare.dynamics.printed import PAPER
from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.formulation import state
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.mechanism import Mechanism

NEAR_HOME = np.array([0.45, 0.0, 0.0, *3 * [-0.232, -2.20, 0.0]])
"""Roughly the q of the platform at (0.45, 0, 0) m, m and rad."""
_STEPS = 6
"""Of Newton's method until a neighbour's q is on the constraints to all digits of doubles."""


def exact_samples(mechanism: Mechanism, count: int, exact: ManyDigits) -> StateSamples:
    """Make random states of the paper's Delta whose q, q̇, q̈, τ fit to ``exact``'s digits.

    A random neighbour of ``NEAR_HOME`` is moved onto the constraints, by Newton's method in
    many digits at last; torques are chosen at random; q̈ follows from L_I's linear system.
    Only then are they rounded.
    """
    m, p = mechanism, np.asarray(ca.DM(PAPER.vector())).ravel()
    results = [m.holonomic, m.constraint_rate, m.J]
    constraints = ca.Function("constraints", [*state(m), m.parameters], results)
    inputs, *results = FORWARD.big_system(m)
    system, n = ca.Function("big_system", inputs, results), m.q.numel()

    def onto_constraints(q: Matrix, dq: Matrix) -> tuple[Matrix, Matrix]:
        """Each step of Newton's method doubles the digits, from those of doubles: 16, 32, 64."""
        for _ in range(2 + exact.digits // 32):
            f, _, J = exact.evaluate(constraints, [0.0], q, dq, p)
            q -= J.T * exact.solve(J * J.T, f)
        _, rate, J = exact.evaluate(constraints, [0.0], q, dq, p)
        return q, dq - J.T * exact.solve(J * J.T, rate)

    rng, rows = np.random.default_rng(0), []
    for _ in range(count):
        guess = NEAR_HOME + rng.uniform(-1, 1, n) * np.repeat([0.12, 0.3], [3, n - 3])
        speeds = rng.uniform(-1, 1, n) * np.repeat([1.0, 5.0], [3, n - 3])
        for _ in range(_STEPS):
            f, _, J = (each.full() for each in constraints(0.0, guess, speeds, p))
            guess -= np.linalg.lstsq(J, f.ravel())[0]
        q, dq = onto_constraints(exact.matrix(guess), exact.matrix(speeds))
        tau = exact.matrix(rng.uniform(-5, 5, m.controls.numel()))
        ddq = exact.solve(*exact.evaluate(system, [0.0], q, dq, tau, p))[:n]
        rows.append([rounded(each) for each in (q, dq, ddq, tau)])
    q, dq, ddq, tau = (np.array(part) for part in zip(*rows, strict=True))
    return StateSamples(q, dq, ddq, tau, p)


def rounding_error(
    mechanism: Mechanism, task: Computation, samples: StateSamples, exact: ManyDigits
) -> Array:
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
    return np.asarray(np.abs(value - truth).max(axis=1) / np.abs(truth).max(axis=1))
