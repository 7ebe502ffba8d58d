"""Meshes at the reversals of arms under Coulomb friction, and softer friction on the first ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.mesh.reversals import softer_problems, with_reversals
from deltaopt.planning.planner import Planner
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.verification import verify

PROBLEMS = Path(__file__).parents[3] / "problems"
DRIVE = load_scene(PROBLEMS / "industrial_drive.yaml")
FRICTION = DRIVE.robot.drive.friction
assert FRICTION is not None


def changed(**friction: float | None) -> Scene:
    """The scene with other numbers of its friction."""
    assert FRICTION is not None
    drive = DRIVE.robot.drive.model_copy(update={"friction": FRICTION.model_copy(update=friction)})
    return DRIVE.model_copy(update={"robot": DRIVE.robot.model_copy(update={"drive": drive})})


@pytest.fixture(scope="module")
def motion() -> Trajectory:
    return Planner(DRIVE.robot, tolerance=1e-2).plan_scene(DRIVE).trajectory


def test_knots_lie_on_both_sides_of_every_reversal(motion):
    """Within 3 w of rest are two knots before and two after: rest is found by bisection."""
    mesh = with_reversals(np.full(16, 1 / 16), motion, problem_of(DRIVE))
    assert mesh.sum() == pytest.approx(1.0, abs=1e-14)
    assert mesh.min() >= 1e-4 - 1e-15
    knots = np.cumsum(mesh)[:-1] * motion.duration

    def speed(t: float, arm: int) -> float:
        return float(motion(t).dtheta[arm])

    times = np.linspace(0.0, motion.duration, 2000)[1:-1]
    reversals = 0
    for arm in range(3):
        signs = np.sign(motion(times).dtheta[:, arm])
        for i in np.flatnonzero(signs[1:] * signs[:-1] < 0):
            low, high = float(times[i]), float(times[i + 1])
            while high - low > 1e-12:
                middle = (low + high) / 2
                same = np.sign(speed(middle, arm)) == signs[i]
                low, high = (middle, high) if same else (low, middle)
            rest = low
            near = knots[np.abs(motion(knots).dtheta[:, arm]) < 3 * FRICTION.speed]
            near = near[np.abs(near - rest) < 0.02 * motion.duration]
            assert (near < rest).sum() >= 2
            assert (near > rest).sum() >= 2
            reversals += 1
    assert reversals >= 2


def test_friction_is_softer_on_the_first_meshes(motion):
    """By equal factors from an eighth of the largest speed; not if it is as soft already."""
    times = np.linspace(0.0, motion.duration, 5000)
    fastest = float(np.abs(motion(times).dtheta).max())
    speeds = [
        each.model.robot.drive.friction.speed for each in softer_problems(problem_of(DRIVE), motion)
    ]
    assert speeds[0] == pytest.approx(fastest / 8, rel=1e-2)
    assert speeds[1] == pytest.approx(np.sqrt(speeds[0] * FRICTION.speed), rel=1e-12)
    assert softer_problems(problem_of(changed(speed=fastest)), motion) == ()


def test_a_plan_is_of_the_friction_that_was_asked_for():
    """Two meshes have softer friction, the motion has not: verification knows the scene alone."""
    plan = Planner(DRIVE.robot, tolerance=1e-3).plan_scene(DRIVE)
    assert len(plan.meshes) >= 3
    assert plan.within_tolerance
    assert verify(DRIVE, plan.trajectory).ok
    assert plan.trajectory.duration == pytest.approx(
        min(mesh.safe_duration for mesh in plan.meshes), rel=1e-6
    )
