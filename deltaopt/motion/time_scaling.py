"""How far a motion is from its limits, and how slow it must be to keep them, between samples too.

Most rows ask of the speed in closed form at each instant (`loads`). Other rows mix several powers
(τ + μ θ̇, ‖ẍ - g‖²) or are no powers (torques with friction). In scenes with such rows the instants
at which the motion exceeds its limits most are collected, the largest speed is found at which all
limits hold there, the motion is looked at again at that speed, and so on until it exceeds none.
That takes nothing but the rows of slowed motions.

Rows of positions stay what they are at any speed: no slowing cures their excess.
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial, inf, isfinite

import numpy as np

from deltaopt.curves.piecewise import Array, Index, Truths
from deltaopt.limits.constraints import MIXED
from deltaopt.motion.approach_excess import approach_excess
from deltaopt.motion.extrema import (
    Peaks,
    everywhere,
    narrow_valleys,
    peaks,
    ridges,
    sample_fractions,
)
from deltaopt.motion.loads import (
    Loads,
    LoadsOfMotion,
    NeededSlowing,
    exponents,
    has_layers,
)
from deltaopt.motion.safe_speeds import largest_safe_speed
from deltaopt.motion.sure_bounds import sure_excess
from deltaopt.motion.trajectory import Trajectory
from deltaopt.problem.problem import Problem

_SAFE = 1e-12
"""Excess of a row of mixed powers that counts as none: rounding at its bound."""
_LITTLE = 1e-3
"""Share of the speed below which a motion is slowed by its square more, a millionth at most: that
costs less than another look at the motion would."""
_EXCHANGES = 30
"""Rounds of collecting instants; it takes three as a rule."""
_ROUGH, _ROUGH_ROUNDS, _MOST_CHANGE = 0.02, 8, 4.0
"""How well a rough factor is to be known, in how many rounds at most, each of which changes it at
most so many times. It is for a first guess, for which a few per cent are nothing."""


def safe_factor(problem: Problem, trajectory: Trajectory, at_least: float = 1.0) -> float:
    """The smallest factor k ≥ ``at_least`` by which slowing the motion keeps its limits.

    Infinite where no k does, such as where gravity alone exceeds a torque limit or a limit of
    position is exceeded.
    """
    needed = needed_slowing(problem, trajectory, at_least)
    return needed.factor if needed.keeps_places else inf


def needed_slowing(
    problem: Problem, trajectory: Trajectory, at_least: float = 1.0, sampled: Loads | None = None
) -> NeededSlowing:
    """By what factor k ≥ ``at_least`` the motion has to be slowed, at all instants.

    ``sampled``: ``loads_inside`` of ``fractions_of`` the motion, where these are known already.
    """
    motion, constraints = _Sampled(problem, trajectory, sampled), problem.limits.constraints
    over_ridges = motion.ridges().values.max(initial=0.0) - 1
    places = max(surely_misplaced(problem, trajectory), float(over_ridges))
    if not _mixed(problem).any():
        highest = motion.highest(lambda loads: loads.demands).values
        return motion.loads.needed(highest, at_least).beside(places)

    def looked_at(speed: float, closely: bool) -> Peaks:
        slowed = motion if speed == 1 else _Sampled(problem, trajectory.slowed(1 / speed))
        if closely:
            return slowed.highest(slowed.size)
        highest = Peaks(constraints.number)
        highest.see(*slowed.where, slowed.size(slowed.loads))
        return highest

    factor, last = _factor_by_exchange(problem, trajectory, at_least, looked_at)
    placed = last.values[constraints.sampled_places]
    needed_at_samples = NeededSlowing(factor, float(placed.max(initial=0.0)) - 1)
    return needed_at_samples.beside(places)


def fractions_of(trajectory: Trajectory) -> Array:
    """Where to sample each interval of a motion, as ``sample_fractions`` of its polynomials."""
    degree = trajectory.position.coefficients.shape[1] - 1
    return sample_fractions(len(trajectory.knots) - 1, degree)


class _Sampled:
    """A motion's ``loads`` at ``fractions`` of its intervals, and between them."""

    def __init__(
        self, problem: Problem, trajectory: Trajectory, loads: Loads | None = None
    ) -> None:
        """``loads``: where these are known already."""
        self.constraints, self.fractions = problem.limits.constraints, fractions_of(trajectory)
        self.along = LoadsOfMotion(problem, trajectory).along
        self.where = everywhere(len(trajectory.knots) - 1, self.fractions)
        self.loads = loads or self.along(*self.where)

    def size(self, loads: Loads) -> Array:
        """How near rows are to their bounds, 1 at a bound."""
        return self.constraints.size(loads.rows)

    def ridges(self) -> Peaks:
        """The highest sizes of rows at kinks, of those that have any and are known."""
        found, ridged = Peaks(self.constraints.number), self.constraints.ridged
        if not ridged.any() or not np.isfinite(self.loads.rows).all():
            return found
        sizes = self.size(self.loads)[:, ridged]
        tops = ridges(lambda *at: self.size(self.along(*at))[:, ridged], self.fractions, sizes)
        found.values[ridged], found.intervals[ridged] = tops.values, tops.intervals
        found.fractions[ridged] = tops.fractions
        return found

    def highest(self, part: Callable[[Loads], Array]) -> Peaks:
        """Where a part of the loads is largest, between samples too: about the places where a chain
        comes so near to its serial singularity, or an arm turns back under friction so quickly,
        that torques peak between samples, closer than these."""
        found = peaks(lambda *at: part(self.along(*at)), self.fractions, part(self.loads))
        valleys = narrow_valleys(
            lambda *at: self.along(*at).narrow, self.fractions, self.loads.narrow
        )
        valleys.let_see(found, lambda *at: part(self.along(*at)))
        return found


def surely_misplaced(problem: Problem, trajectory: Trajectory) -> float:
    """By how much a motion exceeds limits of its position that are known to be convex, at most, or
    those of its approach, as ``NeededSlowing.misplaced``; -1 without such limits."""
    approach = approach_excess(problem, trajectory)
    if not problem.limits.constraints.has_convex:
        return approach
    return max(approach, float(sure_excess(problem, trajectory.position).max()))


Look = Callable[[float, bool], Peaks]
"""(speed, whether to look between samples too) -> the highest sizes of all rows of the motion at
this speed, and where they are."""


def _factor_by_exchange(
    problem: Problem, trajectory: Trajectory, at_least: float, looked_at: Look
) -> tuple[float, Peaks]:
    """The smallest safe factor where rows have mixed powers, and the last look.

    Samples come first: what lies between them changes the speed little. Where arms turn back under
    friction it changes it more, so that this is looked at from the beginning.
    """
    changes = problem.limits.constraints.slowing_exponents != 0
    layered = has_layers(problem)
    closely = layered and at_least > 0
    speed, highest = _where_to_begin(at_least, looked_at, changes, closely)
    instants = _Instants(problem, trajectory, changes)
    for _ in range(_EXCHANGES):
        beyond = changes & ~(highest.values <= 1 + _SAFE)
        if closely and not beyond.any():
            return 1 / speed, highest
        if not np.isfinite(highest.values).all():
            return inf, highest
        if beyond.any():
            instants.add(highest.intervals[beyond], highest.fractions[beyond])
            slower = largest_safe_speed(instants.excesses, speed)
            if slower is None:
                return inf, looked_at(speed, True)
            speed = slower * (1 - _moved(1 - slower / speed)) if layered else slower
        closely = True
        highest = looked_at(speed, closely)
    return inf, highest


def _moved(slower: float) -> float:
    """By what share a speed is reduced once more when it is reduced by a small share: peaks move
    meanwhile, so that rows differ by the square of it from those at the instants before."""
    return slower**2 if slower < _LITTLE else 0.0


def _where_to_begin(
    at_least: float, looked_at: Look, changes: Truths, closely: bool
) -> tuple[float, Peaks]:
    """The largest speed that is allowed, or one that is too fast, and a look at it: at samples, or
    ``closely``."""
    speed = 1 / at_least if at_least else 1.0
    highest = looked_at(speed, closely)
    while not at_least and (highest.values[changes] <= 1).all():
        speed *= 2
        highest = looked_at(speed, False)
    return speed, highest


class _Instants:
    """Instants of a motion at which it is slowed, none to begin with."""

    def __init__(self, problem: Problem, trajectory: Trajectory, changes: Truths) -> None:
        """``changes``: which rows slowing changes, (rows,)."""
        constraints = problem.limits.constraints
        self._evaluate = LoadsOfMotion(problem, trajectory)
        self._sides = (constraints.sides & changes[:, None]).T  # bounds that are looked at
        self._taylor = np.zeros((0, 3 * (constraints.order + 1)))  # of the position there

    def add(self, intervals: Index, fractions: Array) -> None:
        """Add those at fractions of intervals, (n,) each."""
        since = self._evaluate.lengths[intervals] * fractions
        added = [
            self._evaluate.position.inside(intervals, since, order) / factorial(order)
            for order in range(self._taylor.shape[1] // 3)
        ]
        self._taylor = np.concatenate([self._taylor, np.hstack(added)])

    def excesses(self, speeds: Array) -> Array:
        """By how much rows that slowing changes exceed their bounds at these speeds, (S,): (S, …)
        for all instants and sides."""
        width = self._taylor.shape[1]
        powers = np.repeat(np.vander(speeds, width // 3, increasing=True), 3, axis=1)
        slowed = (powers[:, None] * self._taylor).reshape(-1, width)
        rows = self._evaluate.rows_of_polynomials(slowed)
        lower, upper = self._sides
        both = np.hstack([rows[:, upper] - 1, -1 - rows[:, lower]])
        return np.asarray(both.reshape(len(speeds), -1))


def highest_rows(problem: Problem, trajectory: Trajectory) -> Peaks:
    """How near each constraint row comes to its bounds, 1 at a bound, between samples too."""
    motion = _Sampled(problem, trajectory)
    found, at_kinks = motion.highest(motion.size), motion.ridges()
    found.see_each(at_kinks.intervals, at_kinks.fractions, at_kinks.values)
    return found


def rough_factor(problem: Problem, trajectory: Trajectory) -> float:
    """The smallest safe factor of any size by samples, limits of position left out; infinite too
    where the motion has no torques."""
    where = everywhere(len(trajectory.knots) - 1, fractions_of(trajectory))
    if not _mixed(problem).any():
        loads = LoadsOfMotion(problem, trajectory)(*where)
        return loads.needed(loads.demands.max(axis=0), at_least=0.0).factor
    factor = 1.0
    for _ in range(_ROUGH_ROUNDS):  # what mixed powers ask for is right close to the limits alone
        loads = LoadsOfMotion(problem, trajectory.slowed(factor))(*where)
        change = loads.needed(loads.demands.max(axis=0), at_least=0.0).factor
        factor *= min(max(change, 1 / _MOST_CHANGE), _MOST_CHANGE)
        if abs(change - 1) < _ROUGH:
            break
    return factor if isfinite(change) else inf


def _mixed(problem: Problem) -> Truths:
    """Which rows of a scene mix powers of the speed, (rows,)."""
    powers = exponents(problem.model.functions, problem.limits.constraints)
    return np.asarray(powers == MIXED)
