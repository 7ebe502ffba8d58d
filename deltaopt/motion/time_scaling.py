"""How far a motion is from its limits, and how slow it must be to keep them.

All of it from the motion itself, by the model and the limits of the scene (never the model that a
trajectory carries), and between samples too.

A motion k times as slow has constraint rows r₀ + (r - r₀) / kⁿ, r₀ being those at rest at the
same place and n a property of the limit: 1 of speeds, 2 of torques and accelerations without
friction. So each row asks of k² in closed form at each instant.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import inf, sqrt
from typing import NoReturn

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.errors import Unreachable
from deltaopt.limits.constraints import Constraints
from deltaopt.mechanisms.delta.functions import delta_functions
from deltaopt.mechanisms.delta.instant import PlatformInstant
from deltaopt.mechanisms.delta.mechanism import DeltaTerms
from deltaopt.motion.extrema import (
    Index,
    Peaks,
    everywhere,
    narrow_valleys,
    peaks,
    sample_fractions,
)
from deltaopt.motion.trajectory import Array, PiecewisePolynomial, Trajectory
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.scene.scene import Scene, limits_of

_NOTHING = 1e-60
"""Stands for 0 as a divisor, so that what is asked of k² stays a number."""
_TOO_MUCH = 1e50
"""Of k²: no k does."""


@dataclass(frozen=True)
class Loads:
    """Constraint rows of a motion at N instants, and what they ask of a slowed motion.

    ``rows``: (N, rows), normalised: lower bounds at -1, upper bounds at 1. ``demands``: (N, …); the
    first ``slower`` of them, one for each row that slowing changes, are what k² must be at least;
    the rest, one for each row that is not zero at rest, what 1/k² must be at least: positive only
    where a limit is exceeded at rest, so that it needs the motion's help. ``alignment``:
    sin² (q_{k,1} - q_{k,2}) of the chains, (N, 3).
    """

    rows: Array
    demands: Array
    alignment: Array
    slower: int

    def highest_demands(self, samples: int) -> Array:
        """The largest demands in each interval, of so many samples in each: (K, …)."""
        width = self.demands.shape[1]
        return np.asarray(self.demands.reshape(-1, samples, width).max(axis=1))

    def slowing(self, highest: Array) -> Array:
        """By what factor each interval alone asks the motion to be slowed, from its highest
        demands, (K, …) -> (K,)."""
        return np.asarray(np.sqrt(highest[:, : self.slower].max(axis=1)))


def safe_factor(
    scene: Scene, trajectory: Trajectory, at_least: float = 1.0, sampled: Loads | None = None
) -> float:
    """The smallest factor k ≥ ``at_least`` by which slowing the motion keeps its limits.

    Infinite where no k does, such as where gravity alone exceeds a torque limit. ``sampled``:
    ``loads_inside`` of ``sample_fractions``, where these are known already.
    """
    intervals = len(trajectory.knots) - 1
    along, fractions = _loads_along(scene, trajectory), sample_fractions(intervals)
    known = sampled or along(*everywhere(intervals, fractions))
    highest = _highest(along, lambda loads: loads.demands, fractions, known).values
    return _factor(highest, known.slower, at_least)


def sampled_factor(demands: Array, slower: int, at_least: float = 1.0) -> float:
    """The same from demands of samples only, (N, …): a little less where they miss a peak."""
    return _factor(demands.max(axis=0), slower, at_least)


def _factor(highest: Array, slower: int, at_least: float) -> float:
    """From the largest demands."""
    squared = np.maximum(at_least**2, highest[:slower].max())  # not a number if one is none
    held = highest[slower:].max(initial=0.0) * squared <= 1
    return sqrt(squared) if squared < _TOO_MUCH and held else inf


def highest_rows(scene: Scene, trajectory: Trajectory) -> Peaks:
    """How near each constraint row comes to its bounds, 1 at a bound, between samples too."""
    intervals, size = len(trajectory.knots) - 1, limits_of(scene).constraints.size
    along, fractions = _loads_along(scene, trajectory), sample_fractions(intervals)
    sampled = along(*everywhere(intervals, fractions))
    return _highest(along, lambda loads: size(loads.rows), fractions, sampled)


def _highest(
    along: Callable[[Index, Array], Loads],
    part: Callable[[Loads], Array],
    fractions: Array,
    sampled: Loads,
) -> Peaks:
    """Where a part of the loads is largest, between samples too: about the places where a chain
    comes so near to its serial singularity that torques peak between samples, closer than these."""
    highest = peaks(lambda *where: part(along(*where)), fractions, part(sampled))
    valleys = narrow_valleys(lambda *where: along(*where).alignment, fractions, sampled.alignment)
    valleys.let_see(highest, lambda *where: part(along(*where)))
    return highest


def loads_inside(scene: Scene, trajectory: Trajectory, fractions: Array) -> Loads:
    """Loads at these fractions, (n,), of every interval, 0 and 1 from inside of it: N = K · n.

    Raises Unreachable or Singular where the motion has none.
    """
    along = _loads_along(scene, trajectory)
    return along(*everywhere(len(trajectory.knots) - 1, fractions))


def rough_factor(scene: Scene, trajectory: Trajectory) -> float:
    """``safe_factor`` by samples, of any size; infinite too where the motion has no torques."""
    intervals = len(trajectory.knots) - 1
    evaluate = _Evaluation.of(scene, trajectory)
    loads = evaluate(*everywhere(intervals, sample_fractions(intervals)))
    return sampled_factor(loads.demands, loads.slower, at_least=0.0)


@dataclass(frozen=True)
class _Evaluation:
    """Loads at (interval (N,), fraction of it (N,)); not a number where there are none."""

    model: DeltaModel
    coefficients: Array
    lengths: Array
    function: RowFunction
    parameters: Array
    slower: int

    @classmethod
    def of(cls, scene: Scene, trajectory: Trajectory) -> _Evaluation:
        model, limits = delta_model(scene.robot, scene.payload), limits_of(scene)
        coefficients = _padded(trajectory.position.coefficients)
        powers = coefficients.shape[1] // 3
        function = _loads_function(model.functions.terms, limits.constraints, powers)
        parameters = np.concatenate([limits.numbers, model.parameters])
        slower = int(np.count_nonzero(limits.constraints.slowing_exponents))
        lengths = np.diff(trajectory.knots)
        return cls(model, coefficients, lengths, function, parameters, slower)

    def __call__(self, intervals: Index, fractions: Array) -> Loads:
        since = (self.lengths[intervals] * fractions)[:, None]
        coefficients = self.coefficients[intervals]
        rows, demands, alignment = self.function(coefficients, since, parameters=self.parameters)
        return Loads(rows, demands, alignment, self.slower)


def _loads_along(scene: Scene, trajectory: Trajectory) -> Callable[[Index, Array], Loads]:
    """The loads at (interval (N,), fraction of it (N,)), or an error that says why not."""
    evaluate = _Evaluation.of(scene, trajectory)

    def along(intervals: Index, fractions: Array) -> Loads:
        loads = evaluate(intervals, fractions)
        if not np.isfinite(loads.rows).all():
            since = evaluate.lengths[intervals] * fractions
            _explain(evaluate.model, trajectory.position, intervals, since)
        return loads

    return along


def _padded(coefficients: Array) -> Array:
    """(K, powers, 3) as (K, 3 · powers), powers a multiple of 6: few functions serve all."""
    powers = -(-coefficients.shape[1] // 6) * 6
    padded = np.zeros((len(coefficients), powers, 3))
    padded[:, : coefficients.shape[1]] = coefficients
    return padded.reshape(len(coefficients), -1)


def _explain(
    model: DeltaModel, position: PiecewisePolynomial, intervals: Index, since: Array
) -> NoReturn:
    """Raise what is the matter with a motion that has no torques."""
    velocity = position.derivative()
    polynomials = (position, velocity, velocity.derivative())
    model.inverse_dynamics(*(q.inside(intervals, since) for q in polynomials))
    raise Unreachable("the motion passes a singular position")


@lru_cache(maxsize=32)
def _loads_function(terms: DeltaTerms, constraints: Constraints, powers: int) -> RowFunction:
    """(coefficients 3 · powers, time since the interval began, numbers of the limits and p) ->
    ``Loads`` but for the number ``slower``."""
    coefficients, t = ca.SX.sym("coefficients", 3 * powers), ca.SX.sym("t")
    x, v, a = (ca.SX.zeros(3) for _ in range(3))
    for c in reversed(ca.vertsplit(coefficients, 3)):  # Horner, differentiated twice
        a = a * t + 2 * v
        v = v * t + x
        x = x * t + c
    functions, rest = delta_functions(terms, Explicit()), ca.SX.zeros(3)
    numbers, p = constraints.numbers(), ca.SX.sym("p", len(terms.names))
    motion = PlatformInstant(functions, x, v, a, p)
    rows = constraints.rows(motion, numbers)
    at_rest = constraints.rows(PlatformInstant(functions, x, rest, rest, p), numbers)
    inputs = [coefficients, t, ca.vertcat(numbers, p)]
    results = [rows, _demands(constraints, at_rest, rows), motion.alignment]
    return RowFunction(ca.Function("loads", inputs, results, {"cse": True}))


def _demands(constraints: Constraints, at_rest: ca.SX, rows: ca.SX) -> ca.SX:
    """What rows ask of k² and then of 1/k², as in ``Loads``; ``at_rest``: the rows at rest."""
    slower, faster = [], []
    for i in np.flatnonzero(constraints.slowing_exponents).tolist():
        lower, upper = constraints.sides[i]
        static, moving = at_rest[i], rows[i] - at_rest[i]
        room = 1 - ca.sign(moving) * static  # for what motion adds, on the side that it goes to
        wanted = ca.fabs(moving) if lower and upper else ca.fmax(moving if upper else -moving, 0)
        share = wanted / ca.fmax(room, _NOTHING)
        slower.append(_power(share, int(constraints.slowing_exponents[i])))
        beyond = ca.fabs(static) if lower and upper else static if upper else -static
        if not static.is_zero():
            faster.append(ca.fmax(beyond - 1, 0) / ca.fmax(ca.fabs(moving), _NOTHING))
    return ca.vertcat(*slower, *faster)


def _power(share: ca.SX, exponent: int) -> ca.SX:
    """kⁿ at least a share, as what k² must be at least."""
    return {1: share**2, 2: share, 4: ca.sqrt(share)}[exponent]
