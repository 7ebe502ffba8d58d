"""Torques and accelerations on the way into singularities, against fifty digits.

Whatever the state, consistent or not, all formulations mean the same torques and the same
accelerations: those of model L_I's linear system. A state is made in many digits and rounded;
the truth is that system solved in many digits at the *rounded* state. What a method's result
differs from it is the method's error. What the truth itself moves by rounding the state is the
conditioning of the problem, which no method can undo; it is reported beside.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.many_digits import ManyDigits, Matrix
from deltaopt.compare.dynamics.models import FORWARD, INVERSE, Computation
from deltaopt.compare.dynamics.samples import rounded
from deltaopt.curves.piecewise import Array
from deltaopt.dynamics.constraint_matrix import ClosedForm, NullSpace, Partition
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.mechanism import Mechanism
from deltaopt.dynamics.virtual_work import VirtualWork
from studies.models.families import Family, Maker, Motion

DISTANCES = (*(10.0**-k for k in range(1, 15)), 0.0)
"""ε, at last the singularity itself."""


@dataclass(frozen=True)
class Problem:
    """A computation, and whether the mechanism moves."""

    name: str
    title: str
    task: Computation
    moving: bool


PROBLEMS = (
    Problem("rest", "torques at rest", INVERSE, False),
    Problem("inverse", "torques in motion", INVERSE, True),
    Problem("forward", "accelerations", FORWARD, True),
)


@dataclass(frozen=True)
class Method:
    """A formulation with a constraint matrix or a linear solver; ``of`` chooses it from the
    Jacobians at a regular state and at the state itself."""

    model: str
    variant: str
    of: Callable[[Array, Array], Formulation]


METHODS = (
    Method("L_E", "closed form", lambda J0, J: Explicit(ClosedForm())),
    Method("K, virtual work", "partition", lambda J0, J: VirtualWork(Partition.pivoted(J0))),
    Method("L_E", "null space", lambda J0, J: Explicit(NullSpace())),
    Method("L_I", "sparse QR", lambda J0, J: Multiplier()),
    Method("L_I", "LAPACK LU", lambda J0, J: Multiplier(lapack_lu)),
)


def lapack_lu(A: ca.MX, b: ca.MX) -> ca.MX:
    """Return x with A x = b, by LU with partial pivoting."""
    return ca.solve(A, b, "lapacklu")


class Functions:
    """The functions of a mechanism, each built once."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._built: dict[tuple[Computation, Formulation], ca.Function] = {}

    @cached_property
    def jacobian(self) -> ca.Function:
        """Return the function (t, q, p) -> J, dense."""
        m = self.mechanism
        return ca.Function("J", [m.time, m.q, m.parameters], [ca.densify(m.J)])

    def system(self, task: Computation) -> ca.Function:
        """Return the function of model L_I's A and b."""
        inputs, A, b = task.big_system(self.mechanism)
        return ca.Function("system", inputs, [A, b])

    def function(self, task: Computation, formulation: Formulation) -> ca.Function:
        key = (task, formulation)
        if key not in self._built:
            self._built[key] = task.function(formulation, self.mechanism)
        return self._built[key]


@dataclass(frozen=True)
class States:
    """Motions of a family at every distance: distances × motions, exact."""

    family: Family
    functions: Functions
    at_rest: list[list[Motion]]
    in_motion: list[list[Motion]]

    @classmethod
    def make(
        cls,
        family: Family,
        functions: Functions,
        exact: ManyDigits,
        number: int,
        distances: tuple[float, ...] = DISTANCES,
    ) -> States:
        """Make so many random motions at every distance."""
        maker, rng = Maker(family, exact), np.random.default_rng(0)
        q = [maker.q(distance) for distance in distances]
        at_rest, in_motion = (
            [[maker.motion(x, rng, moving=moving) for _ in range(number)] for x in q]
            for moving in (False, True)
        )
        return cls(family, functions, at_rest, in_motion)

    def of(self, problem: Problem) -> list[list[Motion]]:
        return self.in_motion if problem.moving else self.at_rest

    @property
    def q(self) -> Array:
        """Return the rounded states, distances × n."""
        return np.array([rounded(motions[0].q) for motions in self.at_rest])


@dataclass(frozen=True)
class Truth:
    """Results at the rounded states and at the exact ones, distances × motions × sought;
    not a number where the linear system has no solution."""

    at_rounded: Array
    at_exact: Array

    @classmethod
    def of(cls, states: States, problem: Problem, exact: ManyDigits) -> Truth:
        system = states.functions.system(problem.task)
        p = states.family.parameters

        def solved(inputs: list[Matrix], sought: int) -> Array:
            A, b = exact.evaluate(system, [0.0], *inputs, p)
            try:
                return rounded(exact.solve(A, b)[:sought])
            except ZeroDivisionError:
                return np.full(sought, np.nan)

        at_rounded, at_exact = [], []
        for motions in states.of(problem):
            for motion in motions:
                inputs, sought = _inputs(motion, problem.task)
                at_exact.append(solved(inputs, sought))
                at_rounded.append(solved([rounded(x) for x in inputs], sought))
        shape = (len(states.in_motion), len(states.in_motion[0]), -1)
        return cls(np.reshape(at_rounded, shape), np.reshape(at_exact, shape))

    def conditioning(self) -> Array:
        """Return the relative error that rounding the state alone makes, by distance."""
        return _median(_errors(self.at_rounded, self.at_exact))

    def errors(self, states: States, problem: Problem, method: Method) -> Array:
        """Return the relative errors of a method, by distance: medians over the motions."""
        return _median(self.each(states, problem, method))

    def each(self, states: States, problem: Problem, method: Method) -> Array:
        """Return the relative errors of a method, distances × motions; NaN without a result."""
        f, p = states.functions, states.family.parameters
        J0 = f.jacobian(0.0, states.family.regular, p).full()
        results = []
        for q, motions in zip(states.q, states.of(problem), strict=True):
            formulation = method.of(J0, f.jacobian(0.0, q, p).full())
            function = f.function(problem.task, formulation)
            for motion in motions:
                inputs, _ = _inputs(motion, problem.task)
                results.append(_result(function, [0.0, *(rounded(x) for x in inputs), p]))
        return _errors(np.reshape(results, self.at_rounded.shape), self.at_rounded)


def _result(function: ca.Function, arguments: list[Any]) -> Array:
    """The first result; not a number where the linear solver gives up."""
    try:
        found = np.asarray(function.call(arguments)[0].full())
    except RuntimeError:
        return np.full(function.numel_out(0), np.nan)
    return found.ravel()


def _errors(value: Array, truth: Array) -> Array:
    """Largest error over the largest component of the truth, distances × motions."""
    error, size = np.abs(value - truth).max(axis=2), np.abs(truth).max(axis=2)
    return np.asarray(error / np.where(size > 0, size, 1.0))  # the truth may be nothing at all


def _median(errors: Array) -> Array:
    """Median over the motions, by distance; nan if any of them has no result."""
    return np.where(np.isfinite(errors).all(axis=1), np.median(errors, axis=1), np.nan)


def _inputs(motion: Motion, task: Computation) -> tuple[list[Matrix], int]:
    """What the task takes after the time, and how many numbers it seeks."""
    if task is INVERSE:
        return [motion.q, motion.dq, motion.ddq], motion.tau.rows
    return [motion.q, motion.dq, motion.tau], motion.q.rows
