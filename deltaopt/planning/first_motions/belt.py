"""When a goal on a belt can be met: where the platform can be there at the belt's velocity."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from deltaopt.curves.piecewise import Array, Truths
from deltaopt.errors import Infeasible, in_words
from deltaopt.motion.loads import sizes_at
from deltaopt.motion.lower_bound import soonest
from deltaopt.problem.boundary import REST, Boundary
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.feasibility import exceeded, require_links_clear
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.links import rooms_at
from deltaopt.scene.scene import Scene

_PLACES = 240
"""Places of a belt's way that are looked at: of a way of three metres one each 12 mm."""
_SECTIONS, _PARTS = 5, np.arange(1, 64) / 64
"""How often the time between two of the places is divided, and where, until it is known when a
limit begins or ceases to be kept: to 2⁻³⁰ of it."""
_SOON = 2
"""How many places after the one where it begins to be possible to meet a belt a motion is planned
to: to the very first none may lead, as right beside a wall."""
_TRIED = 24
"""Durations of first motions among those at which the belt can be met."""


class Meetings:
    """The way of a belt near the robot, looked at in ``_PLACES`` places, and where limits begin and
    cease to be kept between these.

    ``times``: when the goal is there, s after the motion's start, increasing; none if it never
    comes near. ``near``: how near the base's centre that is, m. ``sizes``: of the limits of
    position and speed with the platform there at the belt's velocity, and of links that are to keep
    clear of bodies, 1 at a limit, (N, rows), 0 of others; not a number out of reach.
    """

    def __init__(self, scene: Scene) -> None:
        """Where a scene's goal is from the motion's start on and while it is near the robot."""
        self.scene, self.goal, self.near = scene, scene.task.goal, scene.robot.farthest
        self.times, self.sizes = _times_within(self.goal, self.near), np.zeros((0, 1))
        if len(self.times):
            self.sizes = self._sizes_at(self.times)
            self.times = np.union1d(self.times, self._where_limits_begin())
            self.sizes = self._sizes_at(self.times)

    def _sizes_at(self, times: Array) -> Array:
        """Of the limits of position and speed at times, (n, rows)."""
        since, last = times - self.times[0], self.times[-1:] - self.times[0]
        first = self.goal.at(self.times[0], self.goal.position)
        line = np.array([[first.position, first.velocity]])
        sizes = sizes_at(problem_of(self.scene), line, last, since / last)[0]
        constraints = limits_of(self.scene).constraints
        counted = constraints.promised & (constraints.orders < 2)
        sizes = sizes * counted  # out of reach is out of reach
        if self.scene.keeps_links_clear:
            places = line[0, 0] + since[:, None] * line[0, 1]
            room = rooms_at(self.scene, places).min(axis=(1, 2))
            sizes = np.column_stack([sizes, 1 - room / self.near])
        return np.asarray(sizes)

    def _where_limits_begin(self) -> Array:
        """Instants at which it begins or ceases to be possible to meet the belt, s, each just where
        it is possible. Between two places where it is not, also those at which each limit begins or
        ceases to be kept: a window between two bodies may be narrower than places are apart."""
        kept = np.column_stack([self.possible, self.sizes <= 1])
        changes = kept[1:] != kept[:-1]
        doubtful = np.isfinite(self.sizes).all(axis=1) & ~kept[:, 0]
        changes[:, 1:] &= (doubtful[1:] & doubtful[:-1])[:, None]
        k, row = np.nonzero(changes)
        if not len(k):
            return np.zeros(0)
        begin, end = np.where(kept[k, row], [k, k + 1], [k + 1, k])
        inside, outside = self.times[begin], self.times[end]
        for _ in range(_SECTIONS):
            between = inside + (outside - inside) * _PARTS[:, None]
            sizes = self._sizes_at(between.ravel()) <= 1
            each = np.column_stack([sizes.all(axis=1), sizes]).reshape(*between.shape, -1)
            still = np.logical_and.accumulate(each[:, np.arange(len(k)), row]).sum(axis=0)
            step = (outside - inside) / (len(_PARTS) + 1)
            inside, outside = inside + still * step, inside + (still + 1) * step
        return np.asarray(inside)

    @property
    def possible(self) -> Truths:
        """At which of the times the belt can be met as far as positions and speeds go, (N,)."""
        return np.asarray((self.sizes <= 1).all(axis=1))  # False where not a number

    @property
    def begins(self) -> Array:
        """When it begins to be possible to meet it after the motion's start, increasing, s."""
        begins = self.possible & ~np.append(False, self.possible[:-1]) & (self.times > 0)
        return np.asarray(self.times[begins])

    @property
    def durations(self) -> Array:
        """Some of the times at which it can be met, increasing, s: of motions that meet it."""
        return self._spread(_TRIED)

    def looked_at(self, number: int) -> list[float]:
        """So many times at which the belt can be met, increasing, s, and one soon after each
        instant at which that begins to be possible: to which a motion is planned."""
        begins, step = self.begins, float(np.diff(self.times).max(initial=0.0))
        ends = self.times[self.possible & ~np.append(self.possible[1:], False)][-len(begins) :]
        soon = np.minimum(begins + _SOON * step, (begins + ends) / 2) if len(begins) else begins
        found: list[float] = np.union1d(np.setdiff1d(self._spread(number), begins), soon).tolist()
        return found

    def _spread(self, number: int) -> Array:
        found = self.times[self.possible & (self.times > 0)]
        chosen = np.linspace(0, len(found) - 1, min(number, len(found))).round()
        return np.asarray(found[chosen.astype(int)])

    @property
    def is_possible_at_once(self) -> bool:
        """Whether it can be met where the motion starts, as far as the places tell."""
        return bool(self.possible[self.times == 0].any())

    def within(self, durations: Array) -> Array:
        """Those of some durations, s, increasing, after which it can be met as far as the places
        tell."""
        first, last = np.searchsorted(durations, self.times[[0, -1]])
        inside = durations[first:last]
        nearest = np.abs(self.times - inside[:, None]).argmin(axis=1)
        return np.asarray(inside[self.possible[nearest]])

    def require_any(self) -> Meetings:
        """These themselves; raises Infeasible where the belt cannot be met, or not as soon as it is
        gone, with what was looked at."""
        if not len(self.times):
            raise Infeasible(
                f"goal: the point at {self.goal.description} is never within {self.near:.3g} m of "
                "the base's centre, farther than the chains reach"
            )
        if self.possible.any():
            return self._require_in_time()
        begin, end = self.times[[0, -1]]
        raise Infeasible(
            f"goal: the platform can nowhere meet {self.goal.description}: at none of "
            f"{len(self.times)} places of its way within {self.near:.3g} m of the base's centre, "
            f"which it passes {begin:.3g} to {end:.3g} s after the start, {self._least_excess}"
        )

    def _require_in_time(self) -> Meetings:
        """These themselves; raises Infeasible where no motion from rest gets to the belt before it
        can no longer be met, nor between two of the places that are looked at."""
        if self.scene.task.start.velocity != REST:
            return self
        step, allowed = float(np.diff(self.times).max()), self.times[self.possible]
        least = list[float]()
        for time in allowed[::-1].tolist():
            least.append(soonest(self.scene, self.goal.at(time, self.goal.position).position))
            if least[-1] <= time + step:
                return self
        raise Infeasible(
            f"goal: the platform gets to {self.goal.description} too late: positions and speeds "
            f"allow to meet it {self.in_words}, but from rest no motion to any of these places "
            f"takes less than {min(least):.3g} s"
        )

    @property
    def _least_excess(self) -> str:
        """What is in the way where least is."""
        most = self.sizes.max(axis=1)
        if not np.isfinite(most).any():
            return "do the chains reach it"
        best = int(np.nanargmin(most))
        place = self.goal.at(float(self.times[best]), self.goal.position)
        if self.scene.keeps_links_clear:
            try:
                require_links_clear(self.scene, "nearest to that", place.position)
            except Infeasible as error:
                return f"are position, speed and links within the limits; {error}"
        for phrase in exceeded(self.scene, place):
            return (
                "are position and speed within the limits; nearest to them at "
                f"{in_words(place.position)} m the {phrase}"
            )
        return "are position and speed within the limits"

    @property
    def in_words(self) -> str:
        """When and where it can be met: from the first place to the last, gaps left out."""
        first, last = self.times[self.possible][[0, -1]].tolist()
        places = (in_words(self.goal.at(t, self.goal.position).position) for t in (first, last))
        return f"from {first:.3g} to {last:.3g} s after the start, {' to '.join(places)} m"


@lru_cache(maxsize=8)
def meetings_of(scene: Scene) -> Meetings:
    """The meetings with the belt of a scene, which are found once and then kept."""
    return Meetings(scene)


def not_found(scene: Scene, tried: int) -> str:
    """That no motion was found by attempts, so many ``tried`` in vain: in words of the goal, if
    that moves or is passed, and of the duration, if one is given."""
    goal, sought = scene.task.goal, ""
    given = scene.objective.given_duration
    in_time = "" if given is None else f" of {given:.6g} s"
    if goal.moves:
        allowed = meetings_of(scene).in_words
        sought = f" that meets {goal.description}, which positions and speeds allow {allowed}"
    elif not goal.is_anywhere and goal.velocity != REST:
        sought = f" that passes {goal.description}, a point that stands still"
    attempts = "one attempt was made" if tried == 1 else f"{tried} attempts were made"
    none = f"no motion{in_time} was found{sought}"
    return f"{none}; {attempts}, and none led to one that keeps all limits"


def _times_within(goal: Boundary, radius: float) -> Array:
    """Instants from 0 on at which a goal on a belt is within a radius (m) of the base's centre,
    (N,), s."""
    x, v = np.array(goal.position), np.array(goal.velocity)
    square, along = float((v * v).sum()), float((x * v).sum())
    left = along**2 - square * (float((x * x).sum()) - radius**2)
    if left <= 0 or -along + left**0.5 <= 0:
        return np.zeros(0)
    begin, end = max((-along - left**0.5) / square, 0.0), (-along + left**0.5) / square
    return np.linspace(begin, end, _PLACES)
