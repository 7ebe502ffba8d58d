"""Scenes posed as the planner poses them, and the random moves of ``deltaopt bench any``."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import load_robot, load_scene
from deltaopt.bench.random_scenes import random_scenes
from deltaopt.planning.flat.flat_problem import Flat
from deltaopt.planning.multistart import first_motions
from deltaopt.planning.nlp.problem import Guess
from deltaopt.planning.nlp.scaling import Scales
from deltaopt.planning.nlp.transcription import LINEAR
from deltaopt.planning.refinement import Search
from deltaopt.planning.switching.resolution import Settled
from deltaopt.robot.model import delta_model
from deltaopt.scene.feasibility import least_opening
from deltaopt.scene.scene import Scene


def posed(scene: Scene):
    functions = delta_model(scene.robot, scene.payload).functions
    return Flat().of(functions, LINEAR, speed=scene.speed_limits is not None)


def scales_of(scene: Scene) -> Scales:
    return Scales(scene, next(first_motions(scene, 1, 1)).duration, least_opening(scene))


def first(scene: Scene, tolerance: float) -> Guess:
    return Guess(next(first_motions(scene, 1, 1)), near=False, tolerance=tolerance)


def resolved(scene: Scene) -> Settled:
    """To 1e-6, from the planner's own first mesh."""
    model = delta_model(scene.robot, scene.payload)
    search = Search(posed(scene), scales_of(scene), model, 1e-6, True, print)
    found = search.from_guess(first(scene, 1e-4), 16)
    assert found is not None
    return found


def random_move(robot: str, number: int) -> Scene:
    """With 1 kg, from 0 on."""
    *_, scene = random_scenes(load_robot(f"problems/robots/{robot}.yaml"), 1.0, number + 1, seed=1)
    return scene


CROSS = load_scene("problems/industrial_cross.yaml")
machine_code = pytest.mark.skipif(
    posed(CROSS).on(np.full(4, 0.25))._interior_point is None,
    reason="without a compiler meshes end at 300 intervals",
)
