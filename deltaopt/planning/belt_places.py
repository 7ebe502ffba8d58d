"""A belt that first motions do not meet: planned to as to places on its way.

From rest a belt can be met at a place if the fastest motion that passes the place at the belt's
velocity takes no longer than the belt: what is left is waited for. The first such place is where
the fastest motion meets the belt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from deltaopt.errors import RULED_OUT, DeltaOptError, Infeasible, if_possible
from deltaopt.motion.motion_sequence import waiting
from deltaopt.planning.first_motions.belt import Meetings, not_found
from deltaopt.planning.plan import Plan, plan_as_it_is
from deltaopt.problem.boundary import REST
from deltaopt.scene.moving_ends import State
from deltaopt.scene.scene import Scene

_PLACES = 8
"""Places that are planned to, from the first to the last at which positions and speeds allow to
meet the belt: each takes as long as a plan. Between more of them shorter meetings are found."""
_HALVINGS = 4
"""How often the time between the last place that is reached too late and the first that is not is
halved: the first motion then waits for a few per cent of its duration at most. And how often the
belt is planned to again from a start that cannot wait."""
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

    ``planned``: plans a scene, or returns the error that prevents it. ``nearest``: of the places
    that are reached too late, by how many times so: the least, and when the belt is there, s.
    ``early``: when the belt is, s, at a place to which a start that moves, and cannot wait, leads
    sooner.
    """

    scene: Scene
    planned: Callable[[Scene], Plan | DeltaOptError]
    nearest: tuple[float, float] | None = None
    early: float | None = None

    def plan(self) -> Plan | None:
        """The plan that waits and then meets the belt as soon as possible, or without waiting when
        a given duration is over, if there is one."""
        given = self.scene.objective.given_duration
        if given is not None:  # the belt is at a known place then
            found = self._plan_to(given)
            return replace(found, scene=self.scene) if found else None
        times = Meetings(self.scene).durations
        if not len(times):
            return None
        late, found = 0.0, None
        for i in np.linspace(0, len(times) - 1, min(_PLACES, len(times))).round().astype(int):
            found = self._plan(float(times[i]))
            if found is not None or self.early:
                break
            late = float(times[i])
        if found is None:
            return None
        for _ in range(_HALVINGS):
            middle = (late + found.duration) / 2
            sooner = self._plan(middle)
            if sooner is None:
                late = middle
            else:
                found = sooner
        return found

    def without_waiting(self, time: float) -> Plan | None:
        """The plan to about where the belt is when it ends, from a start that cannot wait: to where
        the belt is at a ``time``, s, then to where it is when that plan ends, and so on. None where
        these plans do not end alike after a few."""
        for _ in range(_HALVINGS):
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

    def _plan(self, time: float) -> Plan | None:
        """The plan that waits and meets the belt at a time, s; None if none is found."""
        plan = self._plan_to(time)
        if plan is None:
            return None
        wait = time - plan.duration
        if wait < _LEAST_WAIT * plan.duration:
            late = plan.duration / time, time
            self.nearest = min(late, self.nearest or late)
            return None
        if self.scene.task.start.velocity != REST:
            self.early = time
            return None
        still = waiting(plan.trajectory.model, self.scene.task.start.position, REST, wait)
        motion = still.then(plan.trajectory)
        return plan_as_it_is(self.scene, motion, plan.tolerance, plan.formulation)

    def _plan_to(self, time: float) -> Plan | None:
        """The plan to where the belt is at a time, s, whenever it gets there."""
        goal = self.scene.task.goal
        at = goal.at(time, goal.position)
        state = State(at=at.position, velocity=at.velocity)
        there = self.scene.model_copy(update={"goal": state})
        plan = if_possible(RULED_OUT, self.planned, there)  # such as beyond a singularity
        return plan if isinstance(plan, Plan) else None
