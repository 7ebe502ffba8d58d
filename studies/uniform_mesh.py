"""One solution on a uniform mesh, which the planner itself would refine."""

from __future__ import annotations

import numpy as np

from deltaopt import PiecewiseAcceleration, Scene, Trajectory, flat
from deltaopt.planning.nlp.problem import Guess, Solved
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import delta_model


def solved_on(scene: Scene, intervals: int, start: Guess) -> Solved:
    """Solve the default formulation of a scene on so many equal intervals."""
    functions = delta_model(scene.robot, scene.payload).functions
    linear = PiecewiseAcceleration()
    scaling = Scaling(problem_of(scene), start.trajectory.duration)
    equations = flat.of(functions, linear, scaling.constraints)
    problem = equations.on(np.full(intervals, 1 / intervals))
    return problem.solve(start, scaling, start.trajectory.model.parameters)


def motion_of(solved: Solved, start: Guess) -> Trajectory:
    """Return the motion that was found from ``start``."""
    return Trajectory(solved.position, start.trajectory.model)
