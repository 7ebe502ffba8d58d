"""Planning a cycle: its legs apart, at prices under which the motors stay cool together.

With the period P = Σ T + D of legs and dwells and S = ∫ τ² dt of a motor over it, S <= r² P is the
limit on its RMS torque. With the multipliers λ / r² of the motors' limits the Lagrangian

    P + Σ λ (S / r² - P) = (1 - Σ λ) P + Σ λ S / r²

is a sum over legs: each takes the least of (1 - Σ λ) T + Σ λ ∫ τ² dt / r² by itself, whatever else
it is asked for: bodies, belts, via points. Where the period is given and the heat Σ h S the least,
time has a price as well. Where the fastest legs make motors too hot in that period, the cycle of
least period is planned first: its legs and prices are nearer. `prices` finds those at which the
limits are kept and nothing that is paid for is left over. Whatever they are, the sum of the legs'
least costs bounds the cycle's from below, which tells the gap. Legs that would be hotter in less
time and in more are the best at no prices, for what legs cost at any is less elsewhere: those are
given their durations (`_filled_periods`).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import repeat
from math import inf

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import NO_PLAN, Infeasible, SceneError, if_possible
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.cycles.priced_legs import USED_UP, PricedLegs, Round
from deltaopt.planning.cycles.prices import broyden
from deltaopt.planning.first_motions.around_bodies import is_clear
from deltaopt.planning.journal import Progress
from deltaopt.problem.boundary import REST
from deltaopt.scene.cycle import Cycle
from deltaopt.scene.feasibility import require_ride
from deltaopt.scene.objective import Effort, Time
from deltaopt.settings import TOLERANCES, require_positive, require_type

_MOST_ROUNDS = 30
"""How often all legs are planned. Usual are three to ten times."""
_PATIENCE, _LESS = 6, 0.9
"""After how many rounds in which the gap did not fall to this share of what it was no more are
made: where legs are known no better, as with friction."""
_MOST_WEIGHT = 1e5
"""Of squared torques, as shares of their limits, beside time: with more it is hardly known how long
legs take."""
_POOR = 1e-2
"""Gap above which a least period is looked for among cycles whose legs fill it: where the best legs
are hotter in less time and in more, no prices lead to them."""
_ALIKE = 1e-2
"""Relative difference of the shares that legs have of a period, up to which they are the same."""
_NARROWLY, _DEARER, _HOPELESS = 8, 0.03, 20
"""After how many rounds of which none kept all limits prices of what exceeds them only grow, and by
what share of their sum at least, for legs that hardly keep limits may leap to and fro, as with
friction; and after how many, without any that did, there is no cycle."""
_LONGER, _MOST_PERIODS = 1.15, 10
"""By what factor one period is longer than the one before, and how many there are at most."""
_APART = 1e-3
"""How far apart places along a dwell on a belt are at most at which limits are looked at, m."""


def plan_cycle(
    cycle: Cycle, *, tolerance: float = 1e-3, progress: Progress | None = None
) -> CyclePlan:
    """Plan the cycle of least period, or of least heat in a given period.

    ``tolerance``: relative gap to reach, at least 1e-9; in a given period the gap is infinite where
    a leg is on a path without a tube. ``progress``: is called with a line of text after every
    round. Raises what rules a leg out, and Infeasible where neither a speed nor a wait keeps the
    motors cool, a period is too short, or a dwell on a belt leads where the robot cannot be.

    Examples:
        >>> cycle = deltaopt.load_cycle("problems/cycles/there_and_back.yaml")
        >>> round(deltaopt.plan_cycle(cycle).parts_per_minute)
        159
    """
    require_type("cycle", cycle, Cycle, "a Cycle, such as load_cycle returns")
    require_positive("tolerance", tolerance, *TOLERANCES)
    sought, tell = PricedLegs(cycle, tolerance), progress or (lambda _: None)
    fastest = sought.planned(repeat(Time()), None)
    tell(f"legs as fast as possible: {fastest.in_words}")
    return _planned(sought, fastest, tell)


def _planned(sought: PricedLegs, fastest: CyclePlan, tell: Progress) -> CyclePlan:
    """The cycle that is sought, from the legs that are as fast as possible."""
    cycle, tolerance = sought.cycle, sought.tolerance
    rounds, tried = list[Round](), list[CyclePlan]()
    if cycle.period is None and sought.is_kept(fastest):
        _require_rides(fastest)
        least = sought.bound([Round(np.zeros(3), fastest)], [])
        return replace(fastest, gap=_above(fastest.period, least))
    kept = sought.slowed(fastest)
    if kept and cycle.period and any(leg.follows_path for leg in cycle.legs):
        _require_rides(kept)
        return kept  # without prices nothing bounds its heat
    _require_priced(fastest)
    near, best, gaps = kept or fastest, None, list[float]()
    prices, shortest = sought.first(fastest), None
    if cycle.period is not None and not sought.is_kept(fastest):
        free = PricedLegs(cycle.model_copy(update={"period": None}), tolerance)
        begun = replace(fastest, cycle=free.cycle, dwells=cycle.least_dwells)
        shortest = if_possible(NO_PLAN, _planned, free, begun, tell)
    if shortest is not None:
        _require_long_enough(cycle, shortest, shortest.gap)
        sought, prices = sought.near_least(fastest, shortest)
        near = sought.with_waits(replace(shortest, cycle=cycle))
        best = sought.slowed(near)
        tried += [best] if best else []
    slopes = np.eye(len(prices))
    afresh, last_kept = True, 1
    for number in range(2, _MOST_ROUNDS + 1):
        rounds.append(
            Round(prices, sought.planned(repeat(sought.objective(prices)), near, afresh=afresh))
        )
        found = rounds[-1].found
        kept = sought.slowed(found)
        tried += [found] if kept is None else [found, kept]
        near = kept or found
        possible = [each for each in (best, kept) if each is not None]
        if possible:
            best = sought.exchanged(min(possible, key=sought.value), tried)
        bound = sought.bound(rounds, tried)
        gap = _above(sought.value(best), bound) if best else inf
        tell(f"round {number}: {found.in_words}" + ("" if kept is None else f"; {kept.in_words}"))
        is_elsewhere = afresh and (not gaps or gap > gaps[-1] / _LESS)
        if is_elsewhere:
            gaps = [gap]
        elif kept is not None or cycle.period is not None:
            gaps.append(gap)  # legs that end moving leap about their limits, which tells nothing
        waits = cycle.period is None and best is not None and best.dwells != cycle.least_dwells
        patience = 2 * _PATIENCE if waits else _PATIENCE
        done = gap <= tolerance or (len(gaps) > patience and gap > _LESS * gaps[-1 - patience])
        dearest = float((sought.motors(prices) * sought.limits).max())
        too_dear = dearest > _MOST_WEIGHT * sought.time(prices)
        is_hopeless = too_dear or (best is None and number > _HOPELESS)
        if (done and afresh) or is_hopeless:
            break
        afresh = done or waits  # legs that linger where they are cool are near no others
        last_kept = last_kept if kept is None else number
        excess = sought.excess(found)
        if is_elsewhere:
            slopes = sought.slopes(rounds[-1])
        else:
            before = rounds[-2]
            change = excess - sought.excess(before.found)
            slopes = broyden(slopes, prices - before.prices, change)
        if not done:
            dearer = prices + _DEARER * prices.sum() * (excess > 0)
            falls = number - last_kept <= _NARROWLY
            prices = sought.next(prices, excess, slopes, 0 * prices if falls else dearer)
    if best is None:
        if shortest is not None:
            _require_long_enough(cycle, shortest, 0.0)
        raise _too_hot(found, sought.limits)
    periods = fastest.period, best.period
    shares = [each.durations / each.durations.sum() for each in (best, fastest)]
    for of_legs in shares[:1] if np.allclose(shares[0], shares[1], _ALIKE) else shares:
        if gap <= (_POOR if cycle.period is None else tolerance):
            break
        tried += _filled_periods(sought, of_legs, *periods)
        kept_ones = filter(sought.is_kept, [best, *tried])
        best = sought.exchanged(min(kept_ones, key=sought.value), tried)
        bound = sought.bound(rounds, tried)
        gap = _above(sought.value(best), bound)
        tell(f"legs that fill the period: {best.in_words}")
    _require_rides(best)
    if gap <= _POOR:  # else prices do not tell what more torque would save
        best = replace(best, prices=sought.gained(rounds[-1].prices, best))
    return replace(best, gap=max(0.0, gap), rounds=number)


def _above(cost: float, bound: float) -> float:
    """By what share a cost is above a bound; infinite where the bound tells nothing."""
    return cost / bound - 1 if bound > 0 else inf


def _filled_periods(
    sought: PricedLegs, shares: Array, shortest: float, longest: float
) -> list[CyclePlan]:
    """Cycles that wait no longer than they have to, whose legs have these ``shares`` of what is
    left, (legs,): in the given period, or in longer and longer ones between two, s, until motors
    stay cool. None where legs end moving."""
    cycle, found = sought.cycle, list[CyclePlan]()
    if any(leg.moves_at_ends for leg in cycle.legs):
        return found
    longer = (shortest * _LONGER**k for k in range(1, _MOST_PERIODS + 1))
    periods = [cycle.period] if cycle.period else [p for p in longer if p < longest]
    for period in periods:
        durations = (period - sought.dwelt) * (1 - USED_UP) * shares
        objectives = [Effort(duration=float(each)) for each in durations]
        filled = if_possible(NO_PLAN, sought.planned, objectives, None)
        if filled is not None:
            found.append(filled)
            if sought.is_kept(filled):
                break
    return found


def _require_priced(fastest: CyclePlan) -> None:
    """Raise where the fastest legs take longer than a given period, or nothing but their speed
    could be changed."""
    period = fastest.cycle.period
    if period is not None and fastest.at_work > period:
        raise Infeasible(
            f"period is {period:g} s, but the fastest legs that were found and the dwells take "
            f"{fastest.at_work:.6g} s"
        )
    for index, scene in enumerate(fastest.cycle.legs):
        if scene.follows_path and scene.path is not None:
            expected = "a tube beside it, for motors would run too hot at full speed"
            raise SceneError(None, f"cycle[{index}].path", scene.path.description, expected)


def _require_long_enough(cycle: Cycle, shortest: CyclePlan, gap: float) -> None:
    """Raise where a cycle's given period is below that of the ``shortest`` that was found by more
    than a relative ``gap``."""
    if cycle.period is not None and shortest.period > cycle.period * (1 + gap):
        raise Infeasible(
            f"period is {cycle.period:.9g} s, but the least that was found with which motors keep "
            f"their limits of RMS torque is {shortest.period:.9g} s"
        )


def _require_rides(found: CyclePlan) -> None:
    """Raise what rules it out that the robot moves along with belts while it dwells."""
    for index, (leg, wait) in enumerate(zip(found.legs, found.waits, strict=True)):
        velocity = found.cycle.velocity_after(index)
        if wait is not None and velocity != REST:
            name, way = f"the dwell after leg {index + 1}", np.linalg.norm(velocity)
            instants = np.linspace(0.0, wait.duration, 2 + int(way * wait.duration / _APART))
            require_ride(leg.scene, name, wait.position.at(instants), velocity)
            if not is_clear(leg.scene, wait):
                raise Infeasible(f"{name}: the tool is not clear of all bodies at all instants")


def _too_hot(found: CyclePlan, limits: Array) -> Infeasible:
    """Why no cycle was found that keeps all limits of motors' mean square torques, (3,), N²m²,
    from the last that was tried."""
    allowed = ", ".join(f"{each:.4g}" for each in np.sqrt(limits))
    return Infeasible(
        "no speed and no wait were found with which motors keep their limits of RMS torque, "
        f"{allowed} N·m: the last that was tried took {found.in_words}; arms at rest are held "
        "by torques too"
    )
