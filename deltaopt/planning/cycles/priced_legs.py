"""The legs of a cycle at prices of time and of squared torques, and the bound that they give."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import (
    NO_PLAN,
    RULED_OUT,
    Infeasible,
    NotConverged,
    if_possible,
    inside,
)
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.motion.running_cost import squared_torques
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.cycles.prices import next_prices
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import Planner
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.cycle import Cycle
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.objective import Objective, TimeAndEfforts

_LEGS_SHARE, _LEGS_NEAR_LEAST = 0.5, 0.05
"""Of the tolerance: the gap of each leg. The rest is for prices that are not quite right. Near the
least period a leg's gap is one of the period, for which much heat is paid."""
_STEEPER = 10.0
"""How many times as much heat a second of the period is taken to save near the least one as where
slower motions have the same shape."""
_SPARED = 0.2
"""Of the tolerance: by what share less is aimed at, about, of squared torques where legs that end
moving cannot be slowed until the limits are kept, and of a given period, which legs that take
longer do not keep, however little it is."""
_EXCHANGED = 0.05
"""Of the tolerance: by what share a cycle is to become better for a leg to be exchanged."""
_LEAST_SHARE = 0.05
"""Of the sum of all prices: what a motor's price is taken for where it is less, for the first guess
of how its excess changes with it."""
_LEAST_USED = 1e-3
"""Of what is allowed: what is taken to be used at least."""
_REPLACED = 0.7
"""By what power of its price, about, a motor's squared torque falls, while the others' grow."""
_LEFT = 1 / 4
"""Least part of the price of time that a round leaves of that in the round before."""
_DIGITS = 12
"""Of seconds: what is less is rounding."""
_WAITS = 9
"""How many factors are tried by which legs are slowed: what is left of a given period is waited,
and in a free one until the motors are cool."""
_SLOWEST, USED_UP, _TRIALS = 20.0, 1e-7, 40
"""Most by which legs are slowed so that motors stay cool; how much they are left cooler than that,
or a given period is left; and how many factors are tried."""
_NOTHING = 1e-9
"""N²m²: by how much motors cool at least in a second, so that waits in which they do not, which are
no answer, are numbers."""


@dataclass(frozen=True)
class Round:
    """What was ``found`` for the legs at some ``prices``."""

    prices: Array
    found: CyclePlan


@dataclass(frozen=True)
class PricedLegs:
    """What is sought: the least period, or the least heat in a given one.

    Prices are those of the motors, λ (3,), and before them that of time in a given period, heat a
    second: (4,). Near the least period all of these grow beyond bounds. There the period has the
    price 1 instead, and before the motors' prices is that of heat, with which the fourth power of
    the duration grows about linearly from its least.
    """

    cycle: Cycle
    tolerance: float
    is_near_least: bool = False

    @cached_property
    def limits(self) -> Array:
        """Of each motor's mean square torque, (3,), N²m²: without a limit that of its peak, which
        none exceeds."""
        peak = limits_of(self.cycle.legs[0]).upper("torque")
        assert peak is not None
        return np.square(peak if self.cycle.rms_limits is None else self.cycle.rms_limits)

    @cached_property
    def heat(self) -> Array:
        """Of each motor's squared torque in what is the least, (3,), 1/(N²m²): over its limit; 0
        where the period is the least."""
        return np.zeros(3) if self.cycle.period is None else 1 / self.limits

    @cached_property
    def dwelt(self) -> float:
        """How long the robot waits at least in a period, s."""
        return sum(self.cycle.least_dwells)

    @property
    def is_time_priced(self) -> bool:
        """Whether time has a price of its own, and not the period the price 1."""
        return self.cycle.period is not None and not self.is_near_least

    def time(self, prices: Array) -> float:
        """The price of time."""
        return float(prices[0] if self.is_time_priced else 1 - prices[-3:].sum())

    def of_heat(self, prices: Array) -> float:
        """The price of heat."""
        return float(prices[0]) if self.is_near_least else 1.0

    def motors(self, prices: Array) -> Array:
        """The prices of each motor's squared torque, (3,), 1/(N²m²)."""
        return self.of_heat(prices) * self.heat + prices[-3:] / self.limits

    def objective(self, prices: Array) -> Objective:
        """That of each leg."""
        return TimeAndEfforts(effort=vector3(self.motors(prices) / self.time(prices)))

    def planned(
        self, objectives: Iterable[Objective], before: CyclePlan | None, *, afresh: bool = False
    ) -> CyclePlan:
        """All legs, for one of the objectives each, from the motions of another round, and
        ``afresh`` from first motions of their own too, for those may be near a better optimum."""
        cycle, begins, start = self.cycle, 0.0, self.cycle.legs[0].start
        share = _LEGS_NEAR_LEAST if self.is_near_least else _LEGS_SHARE
        tolerance, legs, dwells = share * self.tolerance, list[Plan](), cycle.least_dwells
        for index, (dwell, objective) in enumerate(zip(dwells, objectives, strict=False)):
            scene = cycle.leg(index, begins, start).model_copy(update={"objective": objective})
            planner = Planner(scene.robot, tolerance=tolerance)
            near = None
            if before is not None:
                known = before.legs[index].trajectory
                near = if_possible(NO_PLAN, planner.plan_near, scene, known)
            if near is None:
                with _named(index):
                    leg = planner.plan_scene(scene)
            else:
                other = if_possible(NO_PLAN, planner.plan_scene, scene) if afresh else None
                leg = min((near, other or near), key=lambda plan: plan.cost)
            legs.append(leg)
            begins += leg.duration + dwell
            start = cycle.after(index, leg.reached)
        found = CyclePlan(cycle, tuple(legs), dwells, tolerance=self.tolerance)
        return found if cycle.period is None else self.with_waits(found)

    def excess(self, found: CyclePlan) -> Array:
        """How far what has a price is above what is aimed at, in the order of the prices: in the
        powers that fall in proportion to prices where slower motions have the same shape."""
        larger = 1 + _SPARED * self.tolerance
        used = (found.squares / (self.limits * found.period)) ** (4 / 3)
        if any(leg.moves_at_ends for leg in self.cycle.legs):
            used = used * larger
        if self.cycle.period is not None:
            allowed = self.cycle.period - self.dwelt
            taken = ((found.at_work - self.dwelt) / allowed) ** 4 * larger
            used = np.append(1 / taken if self.is_near_least else taken, used)
        return np.asarray(1 - 1 / np.maximum(used, _LEAST_USED))

    def is_kept(self, found: CyclePlan) -> bool:
        """Whether the motors stay cool, and the legs take no longer than a given period."""
        in_time = self.cycle.period is None or found.at_work <= self.cycle.period
        return in_time and bool((found.squares <= self.limits * found.period).all())

    def slowed(self, found: CyclePlan) -> CyclePlan | None:
        """The cycle with all legs slowed alike and a wait, so that motors stay cool or a given
        period is over; None where that does not help, or legs end moving.

        Near the best prices that costs less than little: slowing changes what the legs cost then by
        the square of the factor alone, as far as it changes what they cost for nothing.
        """
        if any(not problem_of(leg.scene).is_at_rest for leg in found.legs):
            found = found if self.cycle.period is None else self.with_waits(found)
            return found if self.is_kept(found) else None
        found = replace(found, dwells=self.cycle.least_dwells)
        if self.cycle.period is not None:
            slowest = (self.cycle.period - self.dwelt) / (found.at_work - self.dwelt)
        else:
            slowest = self._cool(found)
        factors = dict.fromkeys(np.geomspace(1.0, max(1.0, slowest), _WAITS).tolist())
        slowed = [(each, self.with_waits(_slower(each, found))) for each in factors]
        for factor, slower in sorted(slowed, key=lambda pair: self.value(pair[1])):
            if self.is_kept(slower) and _may_be_slowed(factor, found):
                return slower
        return None

    def _cool(self, found: CyclePlan) -> float:
        """The factor by which all legs are slowed until motors stay cool without a longer wait, or
        the largest that is tried."""
        factor, last = 1.0, (0.0, 0.0)
        for _ in range(_TRIALS):
            slower = _slower(factor, found)
            over = float(np.log(slower.squares / (self.limits * slower.period)).max()) + USED_UP
            if -USED_UP < over < 0.9 * USED_UP or (over < 0 and factor == 1):
                return factor
            slope = (over - last[1]) / (np.log(factor) - last[0]) if last[1] else -4.0
            last = np.log(factor), over
            factor = max(1.0, factor * float(np.exp(np.clip(-over / min(slope, -0.1), -1, 1))))
            if factor > _SLOWEST:
                break
        return _SLOWEST

    def exchanged(self, best: CyclePlan, tried: list[CyclePlan]) -> CyclePlan:
        """A cycle that is better than the ``best`` by legs of others that were tried: where the
        same prices lead to faster and to cooler motions, as with friction, some of each do. With
        belts a leg is for when it begins, and is not exchanged."""
        while not self.cycle.on_belts:
            pairs = [(k, each.legs[k]) for each in tried for k in range(len(best.legs))]
            durations = np.array([each.durations for each in tried]) - best.durations
            squares = np.array([each.squares_of_legs for each in tried]) - best.squares_of_legs
            about = self._about(best, durations.ravel(), squares.reshape(-1, 3))
            index, leg = pairs[int(about.argmin())]
            if about.min() >= (1 - self.tolerance * _EXCHANGED) * self.value(best):
                return best
            changed = self.slowed(
                replace(best, legs=(*best.legs[:index], leg, *best.legs[index + 1 :]))
            )
            if changed is None or self.value(changed) >= self.value(best):
                return best
            best = changed
        return best

    def _about(self, best: CyclePlan, longer: Array, more: Array) -> Array:
        """About the values of cycles with legs that are ``longer`` by so much in all, (n,), s, and
        whose motors' ∫ τ² dt are larger, (n, 3), when these are slowed as far as they have to be.
        """
        at_work = best.durations.sum() + longer
        squares = best.squares_of_legs.sum(axis=0) + more
        if self.cycle.period is not None:
            slower = (self.cycle.period - self.dwelt) / at_work
            return np.where(slower < 1, np.inf, squares @ self.heat / np.maximum(slower, 1) ** 3)
        dwelt = sum(best.dwells)  # with what the motors cool in
        period = at_work + dwelt
        resting = best.squares - best.squares_of_legs.sum(axis=0)
        over = np.log((squares + resting) / (self.limits * period[:, None])).max(axis=1)
        slower = np.exp(np.maximum(over, 0.0) / (3 + at_work / period))
        return np.asarray(slower * at_work + dwelt)

    def with_waits(self, found: CyclePlan) -> CyclePlan:
        """A cycle that waits where that costs the least heat for what is left of a given period, or
        in a free one until its motors are cool, if they become so."""
        dwells = list(self.cycle.least_dwells)
        free = self.cycle.free_dwells
        held = {k: found.squares_with(k, found.wait_after(k, 1.0)) for k in free}
        if self.cycle.period is not None:
            left = max(0.0, round(self.cycle.period - found.at_work, _DIGITS))
            dwells[min(held, key=lambda k: float(held[k] @ self.heat))] += left
        else:
            over = np.maximum(found.squares - self.limits * found.period, 0)
            cooled = {k: np.maximum(self.limits - each, _NOTHING) for k, each in held.items()}
            waits = {k: float((over / each).max()) for k, each in cooled.items()}
            least = min(waits, key=waits.__getitem__)
            dwells[least] += waits[least] * (1 + USED_UP)
        return replace(found, dwells=tuple(dwells))

    def value(self, found: CyclePlan) -> float:
        """What is the least: the period, s, or the heat in a given one."""
        return found.period if self.cycle.period is None else float(self.heat @ found.squares)

    def bound(self, rounds: list[Round], tried: list[CyclePlan]) -> float:
        """What no such cycle undercuts, as far as the legs' gaps are right.

        ``tried``: cycles that are known: where one of them has a leg that costs less at the prices
        of a round than what was found at these, that was not the least.
        """
        return max(self._bound(each, tried) for each in rounds)

    def _bound(self, at: Round, tried: list[CyclePlan]) -> float:
        time, motors = self.time(at.prices), self.motors(at.prices)
        costs = [
            [time * leg.duration + motors @ squared_torques(leg.trajectory) for leg in each.legs]
            for each in (at.found, *tried)
        ]  # with the largest payload, whose torques have the prices: any other only adds to heat
        gaps = np.array([leg.gap for leg in at.found.legs])
        least = float((np.min(costs, axis=0) / (1 + gaps)).sum())
        waits = replace(at.found, dwells=self.cycle.least_dwells).waits
        in_dwells = sum(float(motors @ squared_torques(each)) for each in waits if each)
        total = least + time * self.dwelt + in_dwells
        if self.cycle.period is None:
            return total
        of_period = float(at.prices.sum()) if self.is_time_priced else 1.0
        return (total - of_period * self.cycle.period) / self.of_heat(at.prices)

    def first(self, fastest: CyclePlan) -> Array:
        """First prices, and derivatives of what is in excess by them, from the fastest legs, as if
        slower motions had the same shape, and torques that fall with the square of the speed."""
        at_work = fastest.at_work - self.dwelt
        period = self.cycle.period
        if period is None:
            above = np.maximum(self.excess(fastest), 0.0)
            total = at_work / (at_work + 3 * fastest.period)
            return np.asarray(total * above.max() * above / above.sum())
        slower = (period - self.dwelt) / at_work
        time = 3 * float(self.heat @ fastest.squares) / (at_work * slower**4)
        return np.array([time, 0.0, 0.0, 0.0])

    def near_least(self, fastest: CyclePlan, least: CyclePlan) -> tuple[PricedLegs, Array]:
        """What is sought near the least period, and first prices, those of the least period."""
        heat = 1 / (_STEEPER * self.first(fastest)[0])
        return replace(self, is_near_least=True), np.append(heat, np.array(least.prices) / 2)

    def slopes(self, at: Round) -> Array:
        """A first guess of how the excess changes with the prices, from a round: where prices
        change the speed of all legs alike, and the shape of torques as far as motors replace each
        other."""
        given, found, prices = self.cycle.period is not None, at.found, at.prices
        rated = self.motors(prices) * self.limits
        own = np.maximum(rated, _LEAST_SHARE * rated.sum())
        paid = rated * found.squares_of_legs.sum(axis=0) / self.limits
        slower = paid / paid.sum() / own  # four times the derivatives of ln T
        replaced = _REPLACED * (np.diag(1 / own) - slower)
        used = np.maximum(found.squares / (self.limits * found.period), _LEAST_USED)
        longer = 0.0 if given else float(found.durations.sum()) / found.period
        # Derivatives of the motors' prices, and of the logarithm of that of time.
        dearer, of_time = np.eye(3), np.full(3, -1 / self.time(prices))
        if given:
            dearer = np.insert(dearer, 0, float(self.is_near_least), axis=1)
            of_time = np.insert(of_time, 0, 0.0)
        if self.is_time_priced:
            of_time = np.array([1 / prices[0], 0.0, 0.0, 0.0])
        slower = (slower @ dearer - of_time) / 4
        powers = 4 / 3 * used[:, None] ** (-4 / 3) * (-(3 + longer) * slower - replaced @ dearer)
        if not given:
            return np.asarray(powers)
        sign = -1.0 if self.is_near_least else 1.0
        return np.vstack([4 * sign * (1 - self.excess(found)[0]) * slower, powers])

    def next(self, prices: Array, excess: Array, slopes: Array, least: Array) -> Array:
        """The prices of the next round, each the ``least`` or more."""
        found = np.maximum(next_prices(prices, excess, slopes), least)
        left = self.time(found) / self.time(prices)
        if left >= _LEFT:
            return found
        return np.asarray(prices + (found - prices) * ((1 - _LEFT) / (1 - left)))

    def gained(self, prices: Array, found: CyclePlan) -> Vector3:
        """By what share the period falls for each of a motor's RMS torque more; or the heat in a
        given period, over limits as they are."""
        shares = prices[-3:] / self.of_heat(prices)
        return vector3(2 * shares * (found.period / self.value(found)))


@contextmanager
def _named(index: int) -> Iterator[None]:
    """What is wrong with a leg is raised with its number."""
    try:
        with inside(key=f"cycle[{index}]"):
            yield
    except RULED_OUT as error:
        raise Infeasible(f"leg {index + 1}: {error}") from error
    except NotConverged as error:
        raise NotConverged(f"leg {index + 1}: {error}", error.status, error.iterate) from error


def _may_be_slowed(factor: float, found: CyclePlan) -> bool:
    """Whether no leg exceeds a limit where all are slowed by a factor; 1 changes nothing."""
    problems = ((problem_of(leg.scene), leg.trajectory) for leg in found.legs)
    return factor == 1 or all(
        safe_factor(problem, motion, at_least=factor) <= factor for problem, motion in problems
    )


def _slower(factor: float, found: CyclePlan) -> CyclePlan:
    """A cycle with legs slowed by a factor, whatever limits say."""
    if factor == 1:
        return found
    slowed = ((leg, leg.trajectory.slowed(factor)) for leg in found.legs)
    return replace(found, legs=tuple(_along(leg, slower) for leg, slower in slowed))


def _along(leg: Plan, motion: Trajectory) -> Plan:
    """A leg with another motion, whose duration is the given one where its scene gives one."""
    scene, objective = leg.scene, leg.scene.objective
    if objective.given_duration is not None:
        scene = scene.model_copy(update={"objective": objective.alone(motion.duration)})
    return replace(leg, scene=scene, trajectory=motion)
