"""From a scene to the problem that it states: the one place that knows both."""

from __future__ import annotations

from functools import lru_cache

from deltaopt.problem.problem import Problem
from deltaopt.robot.model import model_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene


@lru_cache(maxsize=256)
def problem_of(scene: Scene) -> Problem:
    """The problem that a scene states.

    Raises SceneError for a payload that varies where a limit is not known to hold between both ends
    of its range.
    """
    objective, task = scene.objective, scene.task
    return Problem(
        model=model_of(scene.robot, scene.payload),
        limits=limits_of(scene).with_cost(objective.rate),
        boundaries=(task.start, *task.gates, task.goal),
        objective=objective.functional,
        least_duration=scene.least_duration,
    )
