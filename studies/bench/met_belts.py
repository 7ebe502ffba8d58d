"""Whether a belt can be met from rest, apart from how goals on belts are planned.

Where and when the platform may be on the belt, by kinematics of its own. Then the fastest motions
to places there, each a state that is passed, by Ipopt: if each takes longer than the belt until the
next place, the belt cannot be met; if one takes no longer than the belt, it can, for the motion may
begin later.
"""

from __future__ import annotations

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import NO_PLAN
from deltaopt.planning.nlp.problem import Ipopt
from deltaopt.planning.planner import plan
from deltaopt.robot.robot import as_delta
from deltaopt.scene.moving_ends import Belt, State
from deltaopt.scene.scene import Scene
from studies.bench.possible import Possibility
from studies.bench.statics import Statics

_SAMPLES = 2000
"""Of the belt's way within reach: of three metres one each 1.5 mm."""
_PLACES = 6
"""Places that are planned to; Ipopt takes some seconds for each. Of more the duration is known
between less far apart."""
_STEP = 1e-6
"""Of the upper arm's length: half the difference that the speeds of motors are taken over."""


def of_belt(scene: Scene) -> Possibility:
    """Whether a goal on a belt can be met; nothing is known where the start moves too."""
    goal = scene.goal
    if not isinstance(goal, Belt) or isinstance(scene.start, State):
        return Possibility(False)
    times = _times(scene, goal)
    if not len(times):
        return Possibility(
            False,
            f"at none of {_SAMPLES} places of the belt do the chains close on the start's side of "
            "singularities and motors keep their speed",
        )
    places = times[np.linspace(0, len(times) - 1, _PLACES).round().astype(int)]
    least = np.inf
    for time, until in zip(places, np.append(places[1:], times[-1]), strict=True):
        at = np.array(goal.at) + time * np.array(goal.belt)
        state = State(at=tuple(at.tolist()), velocity=goal.belt)
        try:
            found = plan(scene.model_copy(update={"goal": state}), solver=Ipopt())
        except NO_PLAN:
            least = 0.0  # whether it can be reached in time is not known
            continue
        if found.duration <= time:
            return Possibility(True)
        least = min(least, (1 - found.gap) * found.duration / until)
    if least <= 1:
        return Possibility(False)
    return Possibility(
        False,
        f"the platform may be on the belt until {times[-1]:.3g} s after the start; motions to "
        f"{_PLACES} places there take {least:.3g} times as long as the belt, or more",
    )


def _times(scene: Scene, goal: Belt) -> Array:
    """When the platform may be on the belt as far as kinematics tells, s, of ``_SAMPLES``."""
    robot = as_delta(scene.robot)
    statics, at, velocity = Statics(robot, 0.0), np.array(goal.at), np.array(goal.belt)
    reach = (
        robot.base_radius
        + robot.upper_arm.length
        + robot.forearm.length
        + robot.platform_radius
        + float(np.linalg.norm(robot.tool_offset))
    )
    speed = float(np.linalg.norm(velocity))
    times = np.linspace(0.0, (np.linalg.norm(at) + reach) / speed, _SAMPLES + 1)[1:]
    points = at + times[:, None] * velocity
    here, start = statics.at(points), statics.at(np.array(scene.given_points[:1]))
    step = _STEP * robot.upper_arm.length
    before, after = (statics.at(points + sign * step / speed * velocity) for sign in (-1, 1))
    rates = np.abs(after.angles - before.angles) / (2 * step) * speed
    limit = np.full(3, np.inf) if robot.speed_limits is None else np.array(robot.speed_limits)
    given = scene.given("speed")
    limit = limit if given is None else np.minimum(limit, given)
    with np.errstate(invalid="ignore"):
        may_be = (rates <= limit).all(axis=1) & (here.volumes * start.volumes[0] > 0)
    return np.asarray(times[may_be])
