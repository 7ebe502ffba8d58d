"""Scenes as the planner sees them, and the random moves of ``python -m studies bench any``."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import load_robot, load_scene
from deltaopt.planning.first_motions.multistart import first_motions
from deltaopt.planning.flat.flat_problem import FlatProblem
from deltaopt.planning.formulations.choice import Flat
from deltaopt.planning.nlp.problem import Formulated, Guess
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import LINEAR
from deltaopt.planning.refinement import Refinement
from deltaopt.planning.switching.resolution import ResolvedMotion
from deltaopt.planning.switching.resolver import SwitchResolver
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import delta_model
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene import Scene
from studies.bench.random_scenes import random_scenes


def flat_equations(scene: Scene) -> Formulated:
    """The default problem of a scene, to be put on a mesh."""
    functions = delta_model(scene.robot, scene.payload).functions
    return Flat().of(functions, LINEAR, limits_of(scene).constraints)


def scaling_of(scene: Scene) -> Scaling:
    """In units of its first motion."""
    return Scaling(problem_of(scene), next(first_motions(scene, 1, 1)).duration)


def first_guess(scene: Scene, tolerance: float) -> Guess:
    """What the planner begins with."""
    return Guess(next(first_motions(scene, 1, 1)), near=False, tolerance=tolerance)


def resolved(scene: Scene) -> ResolvedMotion:
    """To 1e-6, from the planner's own first mesh."""
    scaling, problem = scaling_of(scene), flat_equations(scene)
    with_switches = SwitchResolver(scaling, 1e-6, print)
    refinement = Refinement(problem, scaling, 1e-6, with_switches, print)
    found = refinement.from_guess(first_guess(scene, 1e-4), np.full(16, 1 / 16))
    assert found is not None
    return found


def random_move(robot: str, number: int) -> Scene:
    """With 1 kg, from 0 on."""
    *_, scene = random_scenes(load_robot(f"problems/robots/{robot}.yaml"), 1.0, number + 1, seed=1)
    return scene


CROSS = load_scene("problems/industrial_cross.yaml")
machine_code = pytest.mark.skipif(
    not isinstance(flat_equations(CROSS)(np.full(2, 0.5)), FlatProblem),
    reason="without a compiler meshes end at 300 intervals",
)
