"""Friction as soft as a mesh resolves it, and safe."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from deltaopt import Effort, plan
from deltaopt.planning.effort_planning import fastest
from deltaopt.planning.flat.equations import point_equations
from deltaopt.planning.nlp.softening import Softening
from deltaopt.planning.planner import Planner
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.verification import verify
from studies.problems import PROBLEMS

DRIVE = load_scene(PROBLEMS / "industrial_drive.yaml")


@pytest.mark.parametrize("ratio", [1.0, 1.3, 2.0, 5.0, 40.0])
@pytest.mark.parametrize("share", [0.02, 0.15])
def test_what_is_hidden_is_covered(ratio, share):
    """A torque at its softened limit is within 2e-3 of it, friction being as it is, on either side
    of rest: |tanh (r u) - tanh u| is held against the cover's formula, whatever its sign."""
    u = np.linspace(-6.0, 6.0, 4001)
    room = 1 - share * (1 - ratio**-2) * (1 - np.tanh(u) ** 2)
    hidden = share * np.abs(np.tanh(ratio * u) - np.tanh(u))
    assert (room + hidden).max() <= 1 + 2e-3


def test_a_plan_is_of_the_friction_that_was_asked_for():
    """Meshes have softer friction, the motion has not: verification knows the scene alone. And its
    duration is that of plans on finer meshes, whose friction is sharper, within both gaps."""
    plan = Planner(DRIVE.robot, tolerance=1e-3).plan_scene(DRIVE)
    finer = Planner(DRIVE.robot, tolerance=2e-4, intervals=40).plan_scene(DRIVE)
    assert plan.within_tolerance
    assert verify(DRIVE, plan.trajectory).ok
    assert abs(plan.duration / finer.duration - 1) < plan.gap + finer.gap + 1e-3


def test_the_gap_of_least_effort_knows_what_meshes_do_not_see():
    """The torques that count have friction as it is."""
    scene = DRIVE.model_copy(update={"objective": Effort(duration=0.24)})
    roughly, nearly = plan(scene, tolerance=1e-2), plan(scene, tolerance=1e-4)
    assert roughly.within_tolerance
    assert roughly.cost <= nearly.cost * (1 + roughly.gap)


def test_softer_on_longer_intervals_and_never_below_the_least():
    motion = Planner(DRIVE.robot, tolerance=1e-2).plan_scene(DRIVE).trajectory
    softening = Softening.of(problem_of(DRIVE), motion, 1e-3)
    assert softening is not None
    mesh = np.array([0.5, 0.4, 0.0999, 0.0001])
    widths = softening.widths(motion, mesh)
    assert widths.min() == softening.least
    assert (widths[0] > widths[2]).all()
    harder = softening.after(problem_of(DRIVE), 1e-2, 1e-3)
    assert harder.least < softening.least


def test_a_move_needs_no_search():
    """One attempt does. With friction as it is on all meshes reversals are caught between their
    points, and the first attempt misses its tolerance."""
    plan = Planner(DRIVE.robot, payload=0.75).plan(
        (0.763650, -0.271184, 0.043577), (0.935621, 0.352646, 0.045631)
    )
    assert plan.within_tolerance
    assert len(plan.journal) == 1


def test_kinematics_are_evaluated_once():
    """Friction asks for speeds of arms, and so do limits: square roots of the chains are taken
    once, as without friction."""
    without = DRIVE.robot.drive.model_copy(update={"friction": None})
    scenes = (DRIVE, DRIVE.model_copy(update={"robot": _with(without)}))
    roots = []
    for scene in scenes:
        problem = problem_of(scene)
        equations = point_equations(problem.model.functions, problem.limits.constraints)
        values = equations.point_problem(fastest(problem)).functions.values
        operations = [values.instruction_id(k) for k in range(values.n_instructions())]
        roots.append(operations.count(ca.OP_SQRT))
    assert roots[0] == roots[1]


def _with(drive):
    return DRIVE.robot.model_copy(update={"drive": drive})
