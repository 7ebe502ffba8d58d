"""What constraint rows of a motion ask of its speed, instant by instant.

All of it from the motion itself, by the model and the limits of the problem, never the model that
a trajectory carries. A motion k times as slow has constraint rows r₀ + (r - r₀) / kⁿ, r₀ being
those at rest at the same place and n a property of the limit: 1 of speeds, 2 of torques and
accelerations without friction. So each row asks of k² in closed form at each instant; what a row of
several powers asks is estimated from its slope.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf, sqrt

import casadi as ca
import numpy as np

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import Array, Index, PiecewisePolynomial
from deltaopt.errors import Unreachable
from deltaopt.limits.constraints import MIXED, Constraints
from deltaopt.mechanisms.functions import Functions
from deltaopt.mechanisms.instant import PlatformInstant
from deltaopt.motion.extrema import everywhere
from deltaopt.motion.trajectory import Trajectory
from deltaopt.problem.problem import Problem

_NOTHING = 1e-60
"""Stands for 0 as a divisor, so that what is asked of k² stays a number."""
_TOO_MUCH = 1e50
"""Of k²: no k does."""
_WITHIN = 1e-10
"""Excess of a row of positions that counts as none: a tenth of what verification allows."""
_LEAST_SLOPE = 0.05
"""By how much a row of mixed powers is taken to fall with the speed at least, in the rough answer.
A lesser one would ask for wild factors where slowing hardly helps."""
_AT_ONCE = 4000
"""Instants at which loads are computed in one call: the polynomials of all would be a gigabyte."""


@dataclass(frozen=True)
class Loads:
    """Constraint rows of a motion at N instants, and what they ask of a slowed motion.

    ``rows``: (N, rows), normalised: lower bounds at -1, upper bounds at 1. ``demands``: (N, …); the
    first ``slower`` of them, one for each row that slowing changes, are what k² must be at least,
    for rows of mixed powers roughly; the next ``placed``, one for each row of positions that a
    motion must keep, are its size, 1 at a bound; the rest, one for each row that is not zero at
    rest, what 1/k² must be at least: positive only where a limit is exceeded at rest, so that it
    needs the motion's help. ``narrow``: curves that are not negative, in whose narrow valleys rows
    may peak between samples: sin² (q_{k,1} - q_{k,2}) of the chains, and with Coulomb friction 1 +
    (θ̇/w)² of the arms, for it changes sign within ±w; (N, 3) or (N, 6).
    """

    rows: Array
    demands: Array
    narrow: Array
    slower: int
    placed: int

    def highest_demands(self, samples: int) -> Array:
        """The largest demands in each interval, of so many samples in each: (K, …)."""
        width = self.demands.shape[1]
        return np.asarray(self.demands.reshape(-1, samples, width).max(axis=1))

    def slowing(self, highest: Array) -> Array:
        """By what factor each interval alone asks the motion to be slowed, from its highest
        demands, (K, …) -> (K,)."""
        return np.asarray(np.sqrt(highest[:, : self.slower].max(axis=1)))

    def needed(self, highest: Array, at_least: float = 1.0) -> NeededSlowing:
        """What the largest demands, (…), ask for: of samples a little less than of all instants."""
        slower, placed, faster = np.split(highest, [self.slower, self.slower + self.placed])
        squared = np.maximum(at_least**2, slower.max())  # NaN if one is
        held = faster.max(initial=0.0) * squared <= 1
        factor = sqrt(squared) if squared < _TOO_MUCH and held else inf
        return NeededSlowing(factor, float(placed.max(initial=0.0)) - 1)


@dataclass(frozen=True)
class NeededSlowing:
    """The smallest ``factor`` by which slowing a motion keeps its limits of speed, acceleration and
    torque; infinite where none does. ``misplaced``: by how much it exceeds a limit of position,
    which no slowing changes, as a share of the bound; negative within it."""

    factor: float
    misplaced: float

    def beside(self, misplaced: float) -> NeededSlowing:
        """What is needed where other limits of position are exceeded by so much."""
        return replace(self, misplaced=max(self.misplaced, misplaced))

    @property
    def keeps_places(self) -> bool:
        """Whether all limits of position are kept."""
        return self.misplaced <= _WITHIN


def loads_inside(problem: Problem, trajectory: Trajectory, fractions: Array) -> Loads:
    """Loads at these fractions, (n,), of every interval, 0 and 1 from inside of it: N = K · n.

    Raises Unreachable or Singular where the motion has none.
    """
    where = everywhere(len(trajectory.knots) - 1, fractions)
    return LoadsOfMotion(problem, trajectory).along(*where)


def sizes_at(problem: Problem, coefficients: Array, lengths: Array, fractions: Array) -> Array:
    """How near rows are to the nearer of their bounds, 1 at a bound, of polynomials at fractions of
    their lengths in s: (n, fractions, rows); not a number out of reach.

    ``coefficients``: ascending powers of the time, m, (n, powers, 3).
    """
    knots = np.append(0.0, np.cumsum(lengths))
    pieces = PiecewisePolynomial(knots, coefficients)
    evaluate = LoadsOfMotion(problem, Trajectory(pieces, problem.model))
    loads = evaluate(*everywhere(len(lengths), fractions))
    sizes = problem.limits.constraints.size(loads.rows)
    return sizes.reshape(len(lengths), len(fractions), -1)


class LoadsOfMotion:
    """The loads of a motion, called with intervals, (N,), and fractions of them, (N,); not a number
    where the motion has none."""

    def __init__(self, problem: Problem, trajectory: Trajectory) -> None:
        """Those of a problem's limits along a motion."""
        functions, constraints = problem.model.functions, problem.limits.constraints
        self.position, self.lengths = trajectory.position, np.diff(trajectory.knots)
        self._model, self._coefficients = problem.model, _padded(self.position.coefficients)
        self._function = _loads_function(functions, constraints, self._coefficients.shape[1] // 3)
        self._parameters = np.concatenate([problem.limits.numbers, problem.model.parameters])
        self._slower = int(np.count_nonzero(constraints.slowing_exponents))
        self._placed = int(np.count_nonzero(constraints.sampled_places))

    def __call__(self, intervals: Index, fractions: Array) -> Loads:
        since, own = (self.lengths[intervals] * fractions)[:, None], self._coefficients
        starts = range(0, max(len(since), 1), _AT_ONCE)
        parts = [
            self._function(own.take(intervals[k], axis=0), since[k], parameters=self._parameters)
            for k in (slice(first, first + _AT_ONCE) for first in starts)
        ]
        rows, demands, narrow = map(np.concatenate, zip(*parts, strict=True))
        return Loads(rows, demands, narrow, self._slower, self._placed)

    def along(self, intervals: Index, fractions: Array) -> Loads:
        """The same loads, or an error that says why there are none."""
        loads = self(intervals, fractions)
        if not np.isfinite(loads.rows).all():
            since = self.lengths[intervals] * fractions
            where = self.position.with_derivatives(intervals, since)
            self._model.inverse_dynamics(*where)  # which says what is the matter, as a rule
            raise Unreachable("the motion passes a singular position")
        return loads

    def rows_of_polynomials(self, coefficients: Array) -> Array:
        """Rows of polynomials with these ascending coefficients, (N, 3 · powers), at time 0."""
        filled = np.zeros((len(coefficients), self._coefficients.shape[1]))
        filled[:, : coefficients.shape[1]] = coefficients
        return self._function(filled, np.zeros((len(filled), 1)), parameters=self._parameters)[0]


def exponents(functions: Functions, constraints: Constraints) -> Index:
    """How rows change when a motion is slowed, (rows,): ``Constraints.slowing_exponents``, but
    ``MIXED`` for rows of torques where what motion adds to those at rest does not grow with the
    square of the speed: where other things than motors, such as friction, depend on it."""
    found = constraints.slowing_exponents
    return np.where(constraints.of_torque, MIXED, found) if _degree(functions) else found


def has_layers(problem: Problem) -> bool:
    """Whether torques may change within moments where arms turn back, as by Coulomb friction;
    otherwise all rows are polynomials of the speed."""
    degree = _degree(problem.model.functions)
    return degree > _SQUARE or not problem.limits.constraints.are_polynomials


_SQUARE = 2


@lru_cache(maxsize=32)
def _degree(functions: Functions) -> float:
    """The degree of what acts beside motors as a polynomial of the speed: 0; 2 if it is not more;
    infinite otherwise, and where it is none."""
    mechanism = functions.mechanism
    others = ca.SX.zeros(mechanism.controls.numel())
    values = ca.vertcat(*(effort.value for effort in mechanism.efforts))
    values = ca.substitute(values, mechanism.controls, others)
    if not ca.depends_on(values, mechanism.dq):
        return 0
    bends = (ca.hessian(value, mechanism.dq)[0] for value in ca.vertsplit(values))
    return inf if any(ca.depends_on(bend, mechanism.dq) for bend in bends) else _SQUARE


def _padded(coefficients: Array) -> Array:
    """(K, powers, 3) as (K, 3 · powers), powers a multiple of 6: few functions serve all."""
    powers = -(-coefficients.shape[1] // 6) * 6
    padded = np.zeros((len(coefficients), powers, 3))
    padded[:, : coefficients.shape[1]] = coefficients
    return padded.reshape(len(coefficients), -1)


@lru_cache(maxsize=128)
def _loads_function(functions: Functions, constraints: Constraints, powers: int) -> RowFunction:
    """(coefficients 3 · powers, time since the interval began, numbers of the limits and p) ->
    the arrays of ``Loads``."""
    coefficients, t = ca.SX.sym("coefficients", 3 * powers), ca.SX.sym("t")
    x, v, a = (ca.SX.zeros(3) for _ in range(3))
    j = ca.SX.zeros(3)
    for c in reversed(ca.vertsplit(coefficients, 3)):  # Horner, differentiated
        j = j * t + 3 * a
        a = a * t + 2 * v
        v = v * t + x
        x = x * t + c
    rest = ca.SX.zeros(3)
    numbers, p = constraints.numbers(), functions.symbols()
    motion = PlatformInstant(functions, x, v, a, p, jerk=j)
    rows = constraints.rows(motion, numbers)
    at_rest = constraints.rows(PlatformInstant(functions, x, rest, rest, p, jerk=rest), numbers)
    n = exponents(functions, constraints)
    slope = _slope(functions, constraints, numbers, p)(x, v, a, j) if (n == MIXED).any() else None
    demands = _demands(constraints, n, at_rest, rows, slope)
    inputs = [coefficients, t, ca.vertcat(numbers, p)]
    turning = [1 + (motion.dtheta / speed) ** 2 for speed, _ in functions.layers(p)]
    return RowFunction.of("loads", inputs, [rows, demands, ca.vertcat(motion.alignment, *turning)])


def _slope(
    functions: Functions, constraints: Constraints, numbers: ca.SX, p: ca.SX
) -> Callable[[ca.SX, ca.SX, ca.SX, ca.SX], ca.SX]:
    """(x, v, a, j) -> the derivatives of all rows by the speed of the motion, at its own speed."""
    x, v, a, j = (ca.SX.sym(name, 3) for name in "xvaj")
    rows = constraints.rows(PlatformInstant(functions, x, v, a, p, jerk=j), numbers)
    slope = ca.jtimes(rows, ca.vertcat(v, a, j), ca.vertcat(v, 2 * a, 3 * j))
    f = ca.Function("slope", [x, v, a, j, numbers, p], [slope])
    return lambda *motion: f(*motion, numbers, p)


def _demands(
    constraints: Constraints, exponents: Index, at_rest: ca.SX, rows: ca.SX, slope: ca.SX | None
) -> ca.SX:
    """What rows ask of k² and then of 1/k², as in ``Loads``; ``at_rest``: the rows at rest.
    ``slope``: their derivatives by the speed, needed where they mix powers of it."""
    slower, faster = [], []
    for i in np.flatnonzero(exponents).tolist():
        lower, upper = constraints.sides[i]
        if exponents[i] == MIXED:
            assert slope is not None
            slower.append(_by_slope(rows[i], slope[i], lower, upper))
            continue
        static, moving = at_rest[i], rows[i] - at_rest[i]
        room = 1 - ca.sign(moving) * static  # for what motion adds, on the side that it goes to
        wanted = ca.fabs(moving) if lower and upper else ca.fmax(moving if upper else -moving, 0)
        share = wanted / ca.fmax(room, _NOTHING)
        slower.append(_power(share, int(exponents[i])))
        beyond = _size(static, lower, upper)
        if not static.is_zero():
            faster.append(ca.fmax(beyond - 1, 0) / ca.fmax(ca.fabs(moving), _NOTHING))
    sampled = np.flatnonzero(constraints.sampled_places).tolist()
    placed = [_size(rows[i], *constraints.sides[i]) for i in sampled]
    return ca.vertcat(*slower, *placed, *faster)


def _by_slope(row: ca.SX, slope: ca.SX, lower: bool, upper: bool) -> ca.SX:
    """What a row of mixed powers asks of k², by its derivative by the speed."""
    side = ca.sign(row) if lower and upper else 1 if upper else -1
    falls = ca.fmax(side * slope, _LEAST_SLOPE)
    return ca.fmax(1 + (_size(row, lower, upper) - 1) / falls, 0) ** 2


def _size(row: ca.SX, lower: bool, upper: bool) -> ca.SX:
    """How near a row is to the nearer of its bounds: 1 at a bound."""
    return ca.fabs(row) if lower and upper else row if upper else -row


def _power(share: ca.SX, exponent: int) -> ca.SX:
    """kⁿ at least a share, as what k² must be at least."""
    if exponent in (3, 6):
        return share ** (2 / exponent)
    return {1: share**2, 2: share, 4: ca.sqrt(share)}[exponent]
