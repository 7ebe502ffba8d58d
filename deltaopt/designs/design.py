"""The best design: rows of catalogues by enumeration, numbers between bounds by scipy.

What a second costs and the prices are added up. A choice of rows is passed over where its price and
the proven lower bound on durations together are no less than what is known: then no motion of it is
cheaper. Numbers between bounds are found by SLSQP with the derivatives of plans, or by COBYQA
without: a local optimum, for durations are no convex functions of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.designs.design_file import Design, Row, load_design
from deltaopt.errors import NO_PLAN, Infeasible, SceneError, if_possible, installed
from deltaopt.motion.lower_bound import lower_bound
from deltaopt.planning.cycles.cycle_plan import CyclePlan
from deltaopt.planning.cycles.cycle_planning import plan_cycle
from deltaopt.planning.journal import Progress
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import plan
from deltaopt.scene.cycle import Cycle

TOLERANCE = 1e-5
"""Of the plans: their switches are resolved as a rule, so that durations are smooth functions."""
_DONE = 1e-7
"""Share of the value by which a step of the optimiser may still change it when it ends."""
_NEAR = 1e-4
"""Share of the bounds by which the optimiser without derivatives still moves when it ends."""
_NEVER = 1e6
"""The duration of a design without a plan, s: no optimiser stays there."""


@dataclass(frozen=True)
class Candidate:
    """A design: the rows that were chosen, the ``values`` of what may be changed, in SI units, the
    durations of the scenes, s, and what all of it costs."""

    choice: tuple[Row, ...]
    values: tuple[float, ...]
    durations: tuple[float, ...]
    value: float


@dataclass(frozen=True)
class Designed:
    """The ``best`` design, and the best of each choice of rows. ``evaluations``: how often all
    scenes were planned. ``passed_over``: how many choices were, for they cannot be cheaper."""

    design: Design
    best: Candidate
    candidates: tuple[Candidate, ...]
    evaluations: int
    passed_over: int


def design(
    asked: Design | str | Path,
    *,
    derivatives: bool = True,
    tolerance: float = TOLERANCE,
    progress: Progress | None = None,
) -> Designed:
    """The best design of a file.

    ``derivatives``: whether those of plans are used, or the optimiser does without. ``tolerance``:
    of plans. ``progress``: is called with a line of text for each choice of rows. Raises SceneError
    for a file that cannot be used, Infeasible where no design is found, and MissingPackage.

    Examples:
        >>> best = deltaopt.design("problems/design/gear.yaml").best
        >>> [round(ratio, 1) for ratio in best.values]  # in closed form 26.726
        [26.7]
    """
    given = asked if isinstance(asked, Design) else load_design(asked)
    tell, found = progress or (lambda _: None), list[Candidate]()
    evaluations = passed_over = 0
    for bound, choice in sorted(
        ((_bound(given, each), each) for each in given.choices()), key=lambda pair: pair[0]
    ):
        if found and bound >= min(each.value for each in found):
            passed_over += 1
            continue
        search = _Search(given, choice, tolerance, derivatives=derivatives)
        best = search.best()
        evaluations += search.evaluations
        tell(f"{names_of(choice)}: {'no plan' if best is None else f'{best.value:.6g}'}")
        found += [] if best is None else [best]
    if not found:
        raise Infeasible("no design keeps all limits")
    least = min(found, key=lambda each: each.value)
    return Designed(given, least, tuple(found), evaluations, passed_over)


def names_of(choice: tuple[Row, ...]) -> str:
    """A choice of rows in words."""
    return ", ".join(row.name for row in choice) or "design"


def _bound(asked: Design, choice: tuple[Row, ...]) -> float:
    """What no design with these rows undercuts: its price, and where nothing else is changed the
    proven lower bound on its durations."""
    price = sum(row.price for row in choice)
    changes = asked.asked.change
    price += sum(min(each.price * each.least, each.price * each.most) for each in changes)
    jobs = None if changes else if_possible((SceneError,), asked.jobs, choice, [])
    if jobs is None:
        return price
    shortest = np.array([_shortest(job) for job in jobs])
    return price + asked.asked.per_second * float(_over(asked)(shortest))


def _shortest(job: Any) -> float:
    """A duration that no motion of a scene undercuts, nor the legs of a cycle, s."""
    if isinstance(job, Cycle):
        return sum(map(lower_bound, job.legs)) + sum(job.least_dwells)
    return lower_bound(job)


def _over(asked: Design) -> Callable[[Array], Any]:
    return np.sum if asked.asked.over == "sum" else np.max


@dataclass
class _Search:
    """The search for the best design with some rows, by shares of the bounds of what may be
    changed, (k,); of the worst scene's duration as one unknown more, over that at first."""

    asked: Design
    choice: tuple[Row, ...]
    tolerance: float
    derivatives: bool
    evaluations: int = 0
    _unit: float = 1.0
    _known: dict[bytes, tuple[Array, list[Any]]] = field(default_factory=dict)

    def best(self) -> Candidate | None:
        """The best one; None where none was found."""
        changes, asked = self.asked.asked.change, self.asked.asked
        middle = np.full(len(changes), 0.5)
        first = self._durations(middle)
        if len(changes) and first.max() < _NEVER:
            is_worst, longest = asked.over == "worst", asked.longest or _NEVER
            self._unit = self._candidate(middle, first).value
            optimize = installed("scipy.optimize", "design")
            kept = optimize.NonlinearConstraint(self._room, 0, inf, jac=self._room_slopes)
            optimize.minimize(
                self._value,
                np.append(middle, first.max()) if is_worst else middle,
                jac=self._slopes if self.derivatives else None,
                method="SLSQP" if self.derivatives else "COBYQA",
                bounds=[(0, 1)] * len(changes) + [(0, longest)] * is_worst,
                constraints=[kept] if is_worst or asked.longest else [],
                options={"ftol": _DONE} if self.derivatives else {"final_tr_radius": _NEAR},
            )
        found = [
            self._candidate(np.frombuffer(at), known) for at, (known, _) in self._known.items()
        ]
        longest = (1 + self.tolerance) * (asked.longest or _NEVER / 2)
        possible = [each for each in found if max(each.durations) <= longest]
        return min(possible, key=lambda each: each.value, default=None)

    def _candidate(self, shares: Array, durations: Array) -> Candidate:
        value = self.asked.asked.per_second * float(_over(self.asked)(durations))
        values, seconds = tuple(self._values(shares).tolist()), tuple(durations.tolist())
        return Candidate(self.choice, values, seconds, value + self._price(shares))

    def _values(self, shares: Array) -> Array:
        """What may be changed, in SI units."""
        least, most = self._bounds
        return np.asarray(least + shares * (most - least))

    @property
    def _bounds(self) -> Array:
        changes = self.asked.asked.change
        return np.array([(each.least, each.most) for each in changes]).reshape(-1, 2).T

    def _price(self, shares: Array) -> float:
        prices = [each.price for each in self.asked.asked.change]
        return sum(row.price for row in self.choice) + float(prices @ self._values(shares))

    def _planned(self, shares: Array) -> tuple[Array, list[Any]]:
        """The durations of all scenes, and their plans, none where one has none."""
        at = np.ascontiguousarray(shares).tobytes()
        if at not in self._known:
            self.evaluations += 1
            plans = if_possible((*NO_PLAN, SceneError), self._plans, shares) or []
            seconds = [
                each.period if isinstance(each, CyclePlan) else each.duration for each in plans
            ]
            found = np.array(seconds) if plans else np.full(len(self.asked.contents), _NEVER)
            self._known[at] = found, plans
        return self._known[at]

    def _plans(self, shares: Array) -> list[Plan | CyclePlan]:
        jobs = self.asked.jobs(self.choice, self._values(shares).tolist())
        return [
            plan_cycle(job, tolerance=self.tolerance)
            if isinstance(job, Cycle)
            else plan(job, tolerance=self.tolerance)
            for job in jobs
        ]

    def _durations(self, shares: Array) -> Array:
        return self._planned(shares)[0]

    def _slopes_of_durations(self, shares: Array) -> Array:
        """The derivatives of all durations by the shares, (scenes, k), s."""
        least, most = self._bounds
        keys, found = [each.key for each in self.asked.asked.change], list[list[float]]()
        for each in self._planned(shares)[1]:
            by_key = {one.number.key: one.slope for one in each.sensitivity(keys)}
            found.append([by_key.get(key, 0.0) for key in keys])
        return np.asarray(np.array(found).reshape(-1, len(keys)) * (most - least))

    def _value(self, y: Array) -> float:
        """What is minimised, in units of its first value."""
        shares, rest = self._split(y)
        seconds = rest[0] if len(rest) else self._durations(shares).sum()
        value = self.asked.asked.per_second * seconds + self._price(shares)
        return float(value) / self._unit

    def _slopes(self, y: Array) -> Array:
        """Its derivatives."""
        shares, rest = self._split(y)
        least, most = self._bounds
        prices = np.array([each.price for each in self.asked.asked.change]) * (most - least)
        per_second, seconds = self.asked.asked.per_second, np.ones(len(rest))
        if not len(rest):
            prices = prices + per_second * self._slopes_of_durations(shares).sum(axis=0)
        return np.append(prices, per_second * seconds) / self._unit

    def _room(self, y: Array) -> Array:
        """By how much less each scene takes than the worst, or than is asked for, s."""
        shares, rest = self._split(y)
        allowed = float(rest[0]) if len(rest) else self.asked.asked.longest or _NEVER
        return np.asarray(allowed - self._durations(shares))

    def _room_slopes(self, y: Array) -> Array:
        shares, rest = self._split(y)
        slopes = self._slopes_of_durations(shares)
        return np.hstack([-slopes, np.ones((len(slopes), len(rest)))])

    def _split(self, y: Array) -> tuple[Array, Array]:
        """The shares, and the duration of the worst scene where that is an unknown."""
        k = len(self.asked.asked.change)
        return y[:k], y[k:]
