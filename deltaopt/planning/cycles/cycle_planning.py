"""Planning a cycle: its legs apart, at prices under which the motors stay cool together.

With the period P = Σ T + D of legs and dwells and S = ∫ τ² dt of a motor over it, S <= r² P is the
limit on its RMS torque. With the multipliers λ / r² of the motors' limits the Lagrangian

    P + Σ λ (S / r² - P) = (1 - Σ λ) P + Σ λ S / r²

is a sum over legs: each takes the least of (1 - Σ λ) T + Σ λ ∫ τ² dt / r² by itself, whatever else
it is asked for: bodies, belts, via points. Where the period is given and the heat Σ h S the least,
time has a price as well. `prices` finds those at which the limits are kept and nothing that is paid
for is left over. Whatever they are, the sum of the legs' least costs bounds the cycle's from below,
which tells the gap.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import Infeasible, SceneError
from deltaopt.motion.running_cost import squared_torques
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.cycles.prices import broyden, next_prices
from deltaopt.planning.journal import Progress
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import Planner
from deltaopt.scene.cycle import Cycle
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.objective import Objective, Time, TimeAndEfforts
from deltaopt.settings import LEAST_TOLERANCE, require_positive, require_type

_LEGS_SHARE = 0.5
"""Of the tolerance: the gap of each leg. The rest is for what motors are left cooler than they may
be."""
_AIMED_BELOW = 1 / 8
"""Of the tolerance: by how much below its limit a sum is aimed at, so that one that is missed by so
much still keeps it."""
_MOST_ROUNDS = 40
"""How often all legs are planned. Usual are five to ten times."""
_LEAST_SHARE = 0.05
"""Of the sum of all prices: what a motor's price is taken for where it is less, for the first guess
of how its excess changes with it."""
_LEAST_TIME = 1e-3
"""Least price of time in a given period over the first guess of it: beyond it slower motions save
nothing any more, and the rest of the period is waited."""
_LEAST_USED = 1e-3
"""Of what is allowed: what is taken to be used at least."""
_LEFT = 1 / 4
"""Least part of the price of time that a round leaves of that in the round before."""


def plan_cycle(
    cycle: Cycle, *, tolerance: float = 1e-3, progress: Progress | None = None
) -> CyclePlan:
    """Plan the cycle of least period, or of least heat in a given period.

    ``tolerance``: relative gap to reach, at least 1e-9. ``progress``: is called with a line of text
    after every round. Raises what rules a leg out, and Infeasible where no speed keeps the limits
    of RMS torque, or a period is too short.
    """
    require_type("cycle", cycle, Cycle, "a Cycle, such as load_cycle returns")
    require_positive("tolerance", tolerance, LEAST_TOLERANCE)
    sought, tell = _Sought(cycle, tolerance), progress or (lambda _: None)
    prices, found = sought.least, sought.planned(Time(), None)
    tell(f"legs as fast as possible: {found.in_words}")
    if cycle.period is None and sought.is_kept(found):
        return replace(found, gap=found.period / sought.bound(prices, found) - 1)
    sought.require_priced(found)
    prices, slopes = sought.first(found)
    best, bound, before = found if sought.is_kept(found) else None, 0.0, None
    for number in range(2, _MOST_ROUNDS + 1):
        found = sought.planned(sought.objective(prices), found)
        bound = max(bound, sought.bound(prices, found))
        tell(f"round {number}: {found.in_words}")
        if sought.is_kept(found) and (best is None or sought.value(found) < sought.value(best)):
            best = replace(found, prices=sought.gained(prices))
        if best is not None and sought.value(best) <= (1 + tolerance) * bound:
            break
        excess = sought.excess(found)
        if before is not None:
            slopes = broyden(slopes, prices - before[0], excess - before[1])
        before = prices, excess
        prices = sought.next(prices, excess, slopes)
    if best is None:
        raise Infeasible(sought.why_not(found))
    gap = max(0.0, sought.value(best) / bound - 1) if bound > 0 else inf
    return replace(best, gap=gap, rounds=number)


@dataclass(frozen=True)
class _Sought:
    """What is sought: the least period, or the least heat in a given one.

    Prices are those of the motors, λ (3,), and before them that of time in a given period, heat a
    second: (4,).
    """

    cycle: Cycle
    tolerance: float

    @cached_property
    def limits(self) -> Array:
        """Of each motor's mean square torque, (3,), N²m²; infinite without a limit."""
        found = self.cycle.rms_limits
        return np.full(3, np.inf) if found is None else np.square(found)

    @cached_property
    def heat(self) -> Array:
        """Of each motor's squared torque in what is the least, (3,), 1/(N²m²): over the square of
        what limits its RMS, or else of the largest torque; 0 where the period is the least."""
        if self.cycle.period is None:
            return np.zeros(3)
        if np.isfinite(self.limits).all():
            return np.asarray(1 / self.limits)
        largest = limits_of(self.cycle.legs[0]).upper("torque")
        assert largest is not None
        return np.asarray(1 / np.square(largest))

    @property
    def least(self) -> Array:
        """The least that each price may be."""
        return np.zeros(3 if self.cycle.period is None else 4)

    def time(self, prices: Array) -> float:
        """The price of time."""
        return float(1 - prices.sum() if self.cycle.period is None else prices[0])

    def motors(self, prices: Array) -> Array:
        """The prices of each motor's squared torque, (3,), 1/(N²m²)."""
        return self.heat + prices[-3:] / self.limits

    def objective(self, prices: Array) -> Objective:
        """That of each leg."""
        a, b, c = (self.motors(prices) / self.time(prices)).tolist()
        return TimeAndEfforts(effort=(a, b, c))

    def planned(self, objective: Objective, before: CyclePlan | None) -> CyclePlan:
        """All legs, each for an objective, from the motions of another round."""
        cycle, begins, start = self.cycle, 0.0, self.cycle.legs[0].start
        tolerance, legs, dwells = _LEGS_SHARE * self.tolerance, list[Plan](), list(cycle.dwells)
        for index, dwell in enumerate(cycle.dwells):
            scene = cycle.leg(index, begins, start).model_copy(update={"objective": objective})
            planner = Planner(scene.robot, tolerance=tolerance)
            near = before.legs[index].trajectory if before else None
            legs.append(planner.plan_scene(scene, near=near))
            begins += legs[-1].duration + dwell
            start = cycle.after(index, legs[-1].reached)
        if cycle.period is not None:
            dwells[-1] += max(0.0, cycle.period - begins)
        return CyclePlan(cycle, tuple(legs), tuple(dwells), tolerance=self.tolerance)

    def excess(self, found: CyclePlan) -> Array:
        """How far what has a price is above what is aimed at, in the order of the prices: in the
        powers that fall in proportion to prices where slower motions have the same shape."""
        used = (found.squares / (self.limits * found.period)) ** (4 / 3)
        if self.cycle.period is not None:
            dwelt = sum(self.cycle.dwells)
            allowed = self.cycle.period - dwelt
            used = np.append(((found.at_work - dwelt) / allowed) ** 4, used)
        aimed = 1 + _AIMED_BELOW * self.tolerance
        return np.asarray(1 - 1 / np.maximum(aimed * used, _LEAST_USED))

    def is_kept(self, found: CyclePlan) -> bool:
        """Whether the motors stay cool, and the legs take no longer than a given period."""
        in_time = self.cycle.period is None or found.at_work <= self.cycle.period
        return in_time and bool((found.squares <= self.limits * found.period).all())

    def value(self, found: CyclePlan) -> float:
        """What is the least: the period, s, or the heat in a given one."""
        return found.period if self.cycle.period is None else float(self.heat @ found.squares)

    def bound(self, prices: Array, found: CyclePlan) -> float:
        """What no such cycle undercuts, as far as the legs' gaps are right; ``found`` at prices."""
        time, motors, dwelt = self.time(prices), self.motors(prices), sum(self.cycle.dwells)
        costs = sum(plan.cost / (1 + plan.gap) for plan in found.legs)
        waits = (squared_torques(each) for each in found.waits if each is not None)
        in_dwells = np.sum([*waits, np.zeros(3)], axis=0)
        total = time * (costs + dwelt) + float(motors @ in_dwells)
        if self.cycle.period is None:
            return total
        return total - float(prices.sum()) * self.cycle.period

    def first(self, fastest: CyclePlan) -> tuple[Array, Array]:
        """First prices, and derivatives of what is in excess by them, from the fastest legs, as if
        slower motions had the same shape, and torques that fall with the square of the speed."""
        at_work, dwelt = fastest.at_work - sum(self.cycle.dwells), sum(self.cycle.dwells)
        period = self.cycle.period
        if period is None:
            above = np.maximum(self.excess(fastest), 0.0)
            total = at_work / (at_work + 3 * fastest.period)
            prices = total * above / above.sum()
            return prices, np.diag(-1 / np.maximum(prices, _LEAST_SHARE * total))
        slower = (period - dwelt) / at_work
        time = 3 * float(self.heat @ fastest.squares) / (at_work * slower**4)
        slopes = np.diag([-1 / time, *-1 / (self.heat * self.limits)])
        return np.array([time, 0.0, 0.0, 0.0]), np.where(np.isfinite(slopes), slopes, -1.0)

    def next(self, prices: Array, excess: Array, slopes: Array) -> Array:
        """The prices of the next round."""
        found = next_prices(prices, excess, slopes, self.least)
        left = self.time(found) / self.time(prices)
        if left >= _LEFT:
            return found
        return prices + (found - prices) * ((1 - _LEFT) / (1 - left))

    def gained(self, prices: Array) -> tuple[float, float, float]:
        """By what share the period falls for each of a motor's RMS torque more; of the heat in a
        given period."""
        a, b, c = (2 * prices[-3:]).tolist()
        return a, b, c

    def require_priced(self, fastest: CyclePlan) -> None:
        """Raise where the fastest legs take longer than a given period, or nothing but their speed
        could be changed."""
        period = self.cycle.period
        if period is not None and fastest.at_work > period:
            raise Infeasible(
                f"period is {period:g} s, but the fastest legs that were found and the dwells take "
                f"{fastest.at_work:.6g} s"
            )
        for index, scene in enumerate(self.cycle.legs):
            if scene.follows_path:
                expected = "a tube beside it, for motors would run too hot at full speed"
                raise SceneError(None, f"cycle[{index}].path", str(scene.path), expected)

    def why_not(self, found: CyclePlan) -> str:
        """Why no cycle was found that keeps all limits, from the last round."""
        allowed = ", ".join(f"{each:.4g}" for each in np.sqrt(self.limits))
        return (
            f"no speed was found at which motors keep their limits of RMS torque, {allowed} N·m: "
            f"the last that was tried took {found.in_words}; arms at rest are held by torques too"
        )
