"""The best design: rows of catalogues by enumeration, numbers between bounds by scipy.

What a second costs and the prices are added up. A choice of rows is passed over where its price and
the proven lower bound on durations together are no less than what is known: then no motion of it is
cheaper. Numbers between bounds are found by SLSQP with the derivatives of plans, or by COBYQA
without: a local optimum, for durations are no convex functions of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.designs.design_file import Choice, Design, load_design
from deltaopt.errors import NO_PLAN, Infeasible, SceneError, if_possible, installed
from deltaopt.motion.lower_bound import lower_bound
from deltaopt.planning.cycles.cycle_planning import plan_cycle
from deltaopt.planning.journal import Progress
from deltaopt.planning.planner import plan
from deltaopt.scene.cycle import Cycle

TOLERANCE = 1e-5
"""Of the plans: their switches are resolved as a rule, so that durations are smooth functions."""
_DONE = 1e-7
"""Share of the value by which a step of the optimiser may still change it when it ends."""
_RADII = {"initial_tr_radius": 0.1, "final_tr_radius": 1e-4}
"""Shares of the bounds by which the optimiser without derivatives moves at first, and still when it
ends. By its own first radius, from the middle to the bounds, it ran into what keeps no limit."""
_BEGINNINGS = 16
"""Designs of which the first one with a plan begins the search."""
_DISCARDED = (*NO_PLAN, SceneError)
"""What is raised of a design that is discarded, and of one whose derivatives are not known."""
_NEVER = 1e6
"""The duration of a design without a plan, s: no optimiser stays there."""


@dataclass(frozen=True)
class Candidate:
    """A design: the rows that were chosen, the ``values`` of what may be changed, in SI units, the
    durations of the scenes, s, and what all of it costs."""

    choice: Choice
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
    asked: str | Path,
    *,
    derivatives: bool = True,
    tolerance: float = TOLERANCE,
    progress: Progress | None = None,
) -> Designed:
    """The best design of a file.

    ``derivatives``: whether those of plans are used, where they are known, or the optimiser does
    without. ``tolerance``: of plans. ``progress``: is called with a line of text for each choice of
    rows. Raises SceneError for a file that cannot be used, Infeasible where no design is found, and
    MissingPackage.

    Examples:
        >>> best = deltaopt.design("problems/design/gear.yaml").best
        >>> [round(ratio, 1) for ratio in best.values]  # in closed form 26.726
        [26.7]
    """
    given = load_design(asked)
    tell, found = progress or (lambda _: None), list[Candidate]()
    evaluations = passed_over = 0
    bounds = ((_bound(given, each), each) for each in given.choices())
    for bound, choice in sorted(bounds, key=lambda pair: pair[0]):
        if found and bound >= min(each.value for each in found):
            passed_over += 1
            continue
        search = _Search(given, choice, tolerance, derivatives)
        best = search.best()
        evaluations += len(search.known)
        tell(f"{choice.name}: {'no plan' if best is None else f'{best.value:.6g}'}")
        found += [] if best is None else [best]
    if not found:
        raise Infeasible(f"none of {evaluations} designs that were planned keeps all limits")
    least = min(found, key=lambda each: each.value)
    return Designed(given, least, tuple(found), evaluations, passed_over)


def _bound(given: Design, choice: Choice) -> float:
    """What no design with these rows undercuts: its price, and where nothing else is changed the
    proven lower bound on its durations."""
    changes = given.asked.change
    cheapest = [each.least if each.price > 0 else each.most for each in changes]
    seconds = None if changes else if_possible(_DISCARDED, _all_shortest, given, choice)
    return given.worth(choice, cheapest, seconds or [0.0])


def _all_shortest(given: Design, choice: Choice) -> list[float]:
    """What no motion of each scene undercuts with the rows that were chosen, s."""
    return [_shortest(job) for job in given.jobs(choice, [])]


def _shortest(job: Any) -> float:
    """A duration that no motion of a scene undercuts, nor the legs of a cycle, s."""
    if isinstance(job, Cycle):
        return sum(map(lower_bound, job.legs)) + sum(job.least_dwells)
    return lower_bound(job)


def _spread(k: int) -> Iterator[Array]:
    """Shares of the bounds where a search may begin, (k,) each: the middle, and others that are
    spread evenly."""
    yield np.full(k, 0.5)
    if k:
        halton = installed("scipy.stats.qmc", "design").Halton(k, scramble=False)
        yield from halton.random(_BEGINNINGS)[1:]  # the first one is a corner


@dataclass
class _Search:
    """The search for the best design with some rows. ``known``: by the shares of the bounds of what
    may be changed, (k,), what was planned: the design and its plans, none where one has none."""

    given: Design
    choice: Choice
    tolerance: float
    derivatives: bool
    known: dict[bytes, tuple[Candidate, list[Any]]] = field(default_factory=dict)

    def best(self) -> Candidate | None:
        """The best one; None where none was found."""
        asked = self.given.asked
        for shares in _spread(len(asked.change)):
            first = self._at(shares)[0]
            if len(shares) and max(first.durations) < _NEVER:
                by_slopes = self.derivatives and if_possible(
                    _DISCARDED, self._minimise, shares, first, True
                )
                if not by_slopes:
                    self._minimise(shares, first, False)
                break
        longest = asked.longest or _NEVER / 2
        possible = [each for each, _ in self.known.values() if max(each.durations) <= longest]
        return min(possible, key=lambda each: each.value, default=None)

    def _minimise(self, shares: Array, first: Candidate, derivatives: bool) -> bool:
        """Let scipy look for the best one; true when it has.

        Beside the shares its unknowns are the times that scenes may take, one for each or for the
        worst, over the longest at ``first``: the value is linear in all of them, and that no scene
        takes longer is a constraint. Raises SceneError, or what is raised without a plan, where
        derivatives are not known: of a place in the cell, of a factor, of a path.
        """
        asked, k, seconds = self.given.asked, len(shares), np.array(first.durations)
        times = np.ones((len(seconds), 1)) if asked.over == "worst" else np.eye(len(seconds))
        unit = seconds.max()
        most = (asked.longest or _NEVER) / (1 + self.tolerance) / unit  # to which it is known
        prices = np.array([each.price * (each.most - each.least) for each in asked.change])
        costs = np.append(prices, asked.per_second * unit * np.ones(times.shape[1])) / first.value
        optimize = installed("scipy.optimize", "design")
        kept = optimize.NonlinearConstraint(
            lambda y: times @ y[k:] - np.array(self._at(y[:k])[0].durations) / unit,
            0,
            inf,
            jac=lambda y: np.hstack([-self._slopes(y[:k]) / unit, times]),
        )
        optimize.minimize(
            lambda y: costs @ y,
            np.append(shares, (times.T * seconds).max(axis=1) / unit),
            jac=(lambda y: costs) if derivatives else None,
            method="SLSQP" if derivatives else "COBYQA",
            bounds=[(0, 1)] * k + [(0, most)] * times.shape[1],
            constraints=kept,
            options={"ftol": _DONE} if derivatives else _RADII,
        )
        return True

    def _at(self, shares: Array) -> tuple[Candidate, list[Any]]:
        """The design at shares of the bounds, and its plans."""
        at = shares.tobytes()
        if at not in self.known:
            changes = self.given.asked.change
            pairs = zip(changes, shares.tolist(), strict=True)
            values = tuple(each.least + x * (each.most - each.least) for each, x in pairs)
            plans = if_possible(_DISCARDED, self._plans, values) or []
            seconds = [each.trajectory.duration for each in plans]
            durations = tuple(seconds) or (_NEVER,) * len(self.given.contents)
            value = self.given.worth(self.choice, values, durations)
            self.known[at] = Candidate(self.choice, values, durations, value), plans
        return self.known[at]

    def _plans(self, values: tuple[float, ...]) -> list[Any]:
        jobs = self.given.jobs(self.choice, values)
        kinds = (plan_cycle if isinstance(job, Cycle) else plan for job in jobs)
        return [kind(job, tolerance=self.tolerance) for kind, job in zip(kinds, jobs, strict=True)]

    def _slopes(self, shares: Array) -> Array:
        """The derivatives of all durations by the shares, (scenes, k), s."""
        changes = self.given.asked.change
        slopes = np.zeros((len(self.given.contents), len(changes)))
        for row, each in zip(slopes, self._at(shares)[1], strict=False):  # none without plans
            found = each.sensitivity([change.key for change in changes])
            by_key = {one.number.key: one.slope for one in found}
            row[:] = [by_key.get(each.key, 0.0) * (each.most - each.least) for each in changes]
        return slopes
