"""Torques and accelerations on the way into singularities, against fifty digits.

Whatever the state, consistent or not, all formulations mean the same torques and the same
accelerations: those of model L_I's linear system. A state is made in many digits and rounded;
the truth is that system solved in many digits at the *rounded* state. What a method's result
differs from it is the method's error. What the truth itself moves by rounding the state is the
conditioning of the problem, which no method can undo; it is reported beside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.many_digits import ManyDigits, Matrix
from deltaopt.compare.dynamics.models import INVERSE, Computation
from deltaopt.compare.dynamics.samples import rounded
from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.constraint_matrix import ClosedForm, NullSpace
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.mechanism import Mechanism
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.mechanisms.delta.mechanism import MOTOR_ANGLES
from studies.models.families import Family, Maker, Motion


def lapack_lu(A: ca.MX, b: ca.MX) -> ca.MX:
    """Return x with A x = b, by LU with partial pivoting."""
    return ca.solve(A, b, "lapacklu")


@dataclass(frozen=True)
class Method:
    """A formulation with a constraint matrix or a linear solver; ``model`` and ``variant``: what
    the comparison of dynamics calls it."""

    model: str
    variant: str
    formulation: Formulation


METHODS = {
    "eq. (55)": Method("L_E", "closed form", Explicit(ClosedForm())),
    "motor angles": Method("K, virtual work", "partition", VirtualWork(MOTOR_ANGLES)),
    "null space": Method("L_E", "null space", Explicit(NullSpace())),
    "multipliers, QR": Method("L_I", "sparse QR", Multiplier()),
    "multipliers, LU": Method("L_I", "LAPACK LU", Multiplier(lapack_lu)),
}
"""By what they are called here: at most five lines a panel."""


def motions_into(
    family: Family, exact: ManyDigits, number: int, distances: Sequence[float]
) -> list[list[Motion]]:
    """So many random motions of a family at every distance from its singularity."""
    maker, rng = Maker(family, exact), np.random.default_rng(0)
    states = [maker.q(distance) for distance in distances]
    return [[maker.motion(q, rng) for _ in range(number)] for q in states]


def big_system(task: Computation, mechanism: Mechanism) -> ca.Function:
    """Return the function of model L_I's A and b."""
    inputs, A, b = task.big_system(mechanism)
    return ca.Function("system", inputs, [A, b])


@dataclass(frozen=True)
class Truth:
    """Of a computation at states of a family: its rounded ``inputs``, distances × motions, and the
    results there and at the exact states, distances × motions × sought; not a number where the
    linear system has no solution."""

    task: Computation
    family: Family
    inputs: list[list[list[Array]]]
    at_rounded: Array
    at_exact: Array

    @classmethod
    def of(
        cls, task: Computation, family: Family, motions: list[list[Motion]], exact: ManyDigits
    ) -> Truth:
        """In the arithmetic of ``exact``."""
        system, p = big_system(task, family.mechanism), family.parameters

        def solved(inputs: Sequence[Any], sought: int) -> Array:
            A, b = exact.evaluate(system, [0.0], *inputs, p)
            try:
                return rounded(exact.solve(A, b)[:sought])
            except ZeroDivisionError:
                return np.full(sought, np.nan)

        inputs, at_rounded, at_exact = [], [], []
        for alike in motions:
            given = [_inputs(motion, task) for motion in alike]
            inputs.append([[rounded(x) for x in each] for each, _ in given])
            at_exact.append([solved(each, sought) for each, sought in given])
            pairs = zip(inputs[-1], given, strict=True)
            at_rounded.append([solved(each, sought) for each, (_, sought) in pairs])
        return cls(task, family, inputs, np.array(at_rounded), np.array(at_exact))

    def conditioning(self) -> Array:
        """Return the relative error that rounding the state alone makes, by distance."""
        return _median(self.at_rounded, self.at_exact)

    def errors(self, formulation: Formulation) -> Array:
        """Return the relative errors of a formulation, by distance: medians over the motions."""
        function, p = self.task.function(formulation, self.family.mechanism), self.family.parameters
        results = [[_result(function, [0.0, *own, p]) for own in row] for row in self.inputs]
        return _median(np.array(results), self.at_rounded)


def _inputs(motion: Motion, task: Computation) -> tuple[list[Matrix], int]:
    """What the task takes after the time, and how many numbers it seeks."""
    if task is INVERSE:
        return [motion.q, motion.dq, motion.ddq], motion.tau.rows
    return [motion.q, motion.dq, motion.tau], motion.q.rows


def _result(function: ca.Function, arguments: list[Any]) -> Array:
    """The first result; not a number where the linear solver gives up."""
    try:
        found = np.asarray(function.call(arguments)[0].full())
    except RuntimeError:
        return np.full(function.numel_out(0), np.nan)
    return found.ravel()


def _median(value: Array, truth: Array) -> Array:
    """The median over the motions of the largest error over the largest component of the truth, by
    distance; not a number if any of them has no result."""
    error, size = np.abs(value - truth).max(axis=2), np.abs(truth).max(axis=2)
    errors = error / np.where(size > 0, size, 1.0)  # the truth may be nothing at all
    return np.where(np.isfinite(errors).all(axis=1), np.median(errors, axis=1), np.nan)
