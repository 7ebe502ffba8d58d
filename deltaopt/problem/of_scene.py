"""From a scene to the problem that it states: the one place that knows both."""

from __future__ import annotations

from functools import lru_cache

from deltaopt.problem.boundary import REST, Boundary
from deltaopt.problem.problem import Objective, Problem
from deltaopt.robot.model import model_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.task import EndState, Goal, MovingPoint, Task


@lru_cache(maxsize=256)
def problem_of(scene: Scene) -> Problem:
    """The problem that a scene states.

    Raises SceneError for a payload that varies where a limit is not known to hold between both ends
    of its range.
    """
    objective = scene.objective
    return Problem(
        model=model_of(scene.robot, scene.payload),
        limits=limits_of(scene).with_cost(objective.rate),
        boundaries=boundaries_of(scene.task),
        objective=Objective(
            *objective.weights, objective.rate, objective.given_duration, objective.motors
        ),
        least_duration=scene.least_duration,
    )


def boundaries_of(task: Task) -> tuple[Boundary, ...]:
    """What a task asks for at its start, where its phases meet, and at its goal."""
    start, goal = task.start, task.goal
    gates = (Boundary.passed(gate.place, gate.within) for gate in task.gates)
    begin = Boundary(start.position, start.velocity, start.acceleration)
    return begin, *gates, _boundary(goal)


def _boundary(goal: Goal) -> Boundary:
    if isinstance(goal, MovingPoint):
        return Boundary(goal.position, goal.velocity, belt=goal.velocity)
    if isinstance(goal, EndState):
        return Boundary(goal.position, goal.velocity, goal.acceleration)
    return Boundary(REST, free=(True, True, True))
