"""A belt that first motions do not meet: planned to as to places on its way.

From rest a belt can be met at a place if the fastest motion that passes the place at the belt's
velocity takes no longer than the belt: what is left is waited for. The first such place is where
the fastest motion meets the belt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

from deltaopt.errors import RULED_OUT, DeltaOptError, Infeasible, if_possible
from deltaopt.motion.motion_sequence import waiting
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.bands import without_bodies
from deltaopt.planning.first_motions.belt import meetings_of, not_found
from deltaopt.planning.plan import Plan, plan_as_it_is
from deltaopt.problem.boundary import REST
from deltaopt.scene.moving_ends import State
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene

_PLACES = 8
"""Places that are planned to, from the first to the last at which positions and speeds allow to
meet the belt, beside those soon after that begins to be possible: each takes as long as a plan."""
_HALVINGS, _RESOLVED = 16, 0.25
"""How often at most the time is halved between a place that is reached in time and one before it
that is not, and until which share of the tolerance."""
_AGAIN = 4
"""How often the belt is planned to again from a start that cannot wait."""
_SAME_TIME = 0.02
"""Of the time at which a belt is met: a motion that ends so much earlier or later is near it."""
_TOO_LATE = 1.05
"""Where each of the fastest motions to all places takes more than this many times as long as the
belt takes to get there, the belt is not met, with bodies in the way or without."""
_LEAST_WAIT = 1e-3
"""Of the motion that follows: a shorter wait would be an interval of hardly any length."""


class TooLate(Infeasible):
    """No motion to a place on a belt's way is found that is there in time."""


@dataclass
class PlacesOnBelt:
    """Plans to places on the way of a scene's belt, and what came of them.

    ``planned``: plans a scene, or returns the error that prevents it. ``nearby``: plans it from the
    motion of a neighbouring one, if that leads to a plan. ``nearest``: of the places that are
    reached too late, by how many times so: the least, and when the belt is there, s. ``early``:
    when the belt is, s, at a place to which a start that moves, and cannot wait, leads sooner.
    """

    scene: Scene
    planned: Callable[[Scene], Plan | DeltaOptError]
    nearby: Callable[[Scene, Trajectory], Plan | None]
    nearest: tuple[float, float] | None = None
    early: float | None = None

    @cached_property
    def is_awaited(self) -> bool:
        """Whether a robot at rest waits for a belt that it is not possible to meet at once."""
        return self._may_wait and not meetings_of(self.scene).is_possible_at_once

    def is_met_again(self, before: float) -> bool:
        """Whether a belt that it is possible to meet at once cannot be met for a while, but then
        again ``before`` some instant, s."""
        if not self._may_wait or self.is_awaited:
            return False
        return bool((meetings_of(self.scene).begins < before).any())

    @property
    def _may_wait(self) -> bool:
        task, is_time = self.scene.task, isinstance(self.scene.objective, Time)
        return is_time and task.goal.moves and task.start.velocity == REST

    def plan(self, most: float = inf) -> Plan | None:
        """The plan that waits and then meets the belt as soon as possible, before ``most``, s, or
        without waiting when a given duration is over, if there is one.

        A known place is planned to first, then places nearer and nearer to where it begins to be
        possible to meet the belt, or to where the fastest motion is too late: what is between that
        and the plan is its gap.
        """
        given = self.scene.objective.given_duration
        if given is not None:  # the belt is at a known place then
            plan = self._plan_to(given)
            return replace(plan, scene=self.scene) if plan else None
        meetings, late, plan = meetings_of(self.scene), 0.0, None
        for time in meetings.looked_at(_PLACES):
            if time >= most or self.early:
                return None
            reached = self._sooner_known(time)
            plan = self._in_time(reached, time)
            if plan is not None:
                break
            late = time if reached else late
        if plan is None:
            return None
        late = known = max([late, *meetings.begins[meetings.begins < time].tolist()])
        for _ in range(_HALVINGS):
            if time - late <= _RESOLVED * plan.tolerance * time:
                break
            middle = (late + time) / 2
            nearby = self.nearby(self._scene_at(middle), plan.trajectory)
            sooner = self._in_time(nearby, middle)
            if sooner is not None:
                time, plan = middle, sooner
            else:
                late, known = middle, middle if nearby else known
        motion, start = plan.trajectory, self.scene.task.start.position
        motion = waiting(motion.model, start, REST, time - plan.duration).then(motion)
        found = plan_as_it_is(self.scene, motion, plan.tolerance, plan.formulation)
        is_known = known > 0 and isinstance(self.scene.objective, Time)
        return replace(found, gap=time / known - 1 if is_known else inf, ways=plan.ways)

    def without_waiting(self, time: float) -> Plan | None:
        """The plan to about where the belt is when it ends, from a start that cannot wait: to where
        the belt is at a ``time``, s, then to where it is when that plan ends, and so on. None where
        these plans do not end alike after a few."""
        for _ in range(_AGAIN):
            found = self._plan_to(time)
            if found is None or abs(found.duration - time) < _SAME_TIME * time:
                return found
            time = found.duration
        return None

    def told(self, tried: int, error: DeltaOptError) -> DeltaOptError:
        """The error of attempts, so many ``tried`` in vain, or one that says how nearly the belt is
        met at a place."""
        if self.nearest is None or self.early:
            return error
        times, when = self.nearest
        told = (
            f"{not_found(self.scene, tried)}; the fastest motions found to places on its way take "
            f"{times:.3g} times as long as the belt, or more, {times * when:.3g} instead of "
            f"{when:.3g} s"
        )
        found = TooLate(told) if times > _TOO_LATE else Infeasible(told)
        found.__cause__ = error
        return found

    def _in_time(self, plan: Plan | None, time: float) -> Plan | None:
        """A plan to where the belt is at a time, s, if it is there before, with time to wait; None
        if it is not."""
        if plan is None:
            return None
        if time - plan.duration < _LEAST_WAIT * plan.duration:
            late = plan.duration / time, time
            self.nearest = min(late, self.nearest or late)
            return None
        if self.scene.task.start.velocity != REST:
            self.early = time
            return None
        return plan

    def _sooner_known(self, time: float) -> Plan | None:
        """As of ``_plan_to``; as if there were no bodies, which is sooner known, where even that is
        too late."""
        free = without_bodies(self._scene_at(time))
        alone = if_possible(RULED_OUT, self.planned, free) if self.scene.keep_out else None
        if isinstance(alone, Plan) and alone.duration > (1 + alone.gap) * time:
            return alone
        return self._plan_to(time)

    def _plan_to(self, time: float) -> Plan | None:
        """The plan to where the belt is at a time, s, whenever it gets there."""
        there = self._scene_at(time)
        plan = if_possible(RULED_OUT, self.planned, there)  # such as beyond a singularity
        return plan if isinstance(plan, Plan) else None

    def _scene_at(self, time: float) -> Scene:
        """The scene whose goal is the state in which the belt is at a time, s."""
        goal = self.scene.task.goal
        at = goal.at(time, goal.position)
        return self.scene.model_copy(update={"goal": State(at=at.position, velocity=at.velocity)})
