"""Distances to the parallel singularity and to the tilt: measures, sides, motions that keep."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from deltaopt import load_scene, plan, verify
from deltaopt.errors import Infeasible, SceneError
from deltaopt.limits.singularities import PARALLEL_SINGULARITY, TILT_SINGULARITY
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.mechanisms.instant import CoordinateInstant
from deltaopt.robot.model import delta_model
from studies.problems import PROBLEMS
from tests.good_plans import good_plan

SCENE = load_scene(PROBLEMS / "limits/parallel_singularity.yaml")


TILTING = load_scene(PROBLEMS / "limits/tilt_singularity.yaml")


def bars_of(scene, x):
    """Unit vectors along the bars, (N, 3 chains, 3): from elbows and platform, in space."""
    robot, theta = scene.robot, delta_model(scene.robot, None).inverse_kinematics(x)[:, 3::3]
    bars = []
    for k, azimuth in enumerate(AZIMUTHS):
        radial = np.array([0.0, np.cos(azimuth), np.sin(azimuth)])
        out = robot.base_radius - robot.platform_radius
        out = out + robot.upper_arm.length * np.cos(theta[:, k, None])
        elbow = out * radial - robot.upper_arm.length * np.sin(theta[:, k, None]) * np.eye(3)[0]
        bars.append((x - elbow) / robot.forearm.length)
    return np.stack(bars, axis=1)


def volume(scene, x):
    return np.linalg.det(bars_of(scene, x))


def volume_of_normals(scene, x):
    """Of the parallelograms, each spanned by its bars and the axis at its elbow."""
    across = np.array([[0.0, -np.sin(azimuth), np.cos(azimuth)] for azimuth in AZIMUTHS])
    normals = np.cross(bars_of(scene, x), across)
    return np.linalg.det(normals / np.linalg.norm(normals, axis=2, keepdims=True))


def measured(limit, numbers, scene, x):
    """What a limit with these numbers measures with the tool's point at places x, (N, 3)."""
    symbols = [ca.SX.sym(name, 12) for name in ("q", "dq", "ddq")]
    model = delta_model(scene.robot, None)
    tau, p = ca.SX.sym("tau", 3), model.functions.symbols()
    motion = CoordinateInstant(model.functions, *symbols, tau, p, model.functions.explicit_torques)
    measure = ca.Function("measure", [motion.q], [limit.measure(motion, ca.SX(numbers))])
    return np.array(measure.map(len(x))(model.inverse_kinematics(x).T)).ravel()


def test_measure_of_tilt_is_the_volume_of_the_normals():
    ((margin, side),) = TILT_SINGULARITY.items(TILTING)
    assert margin == 0.08
    x = np.array([[0.25, 0.1, 0.35], TILTING.goal, TILTING.start])
    found = measured(TILT_SINGULARITY, [margin, side], TILTING, x)
    np.testing.assert_allclose(np.abs(found), np.abs(volume_of_normals(TILTING, x)), rtol=1e-9)
    assert found[-1] > 0


def test_motions_keep_from_the_tilt():
    """The fastest motion comes nearer, which torques do not show; with the limit it does not."""
    free = plan(TILTING.model_copy(update={"limits": None}))
    x = free.trajectory(np.linspace(0, free.duration, 400)).x
    assert np.abs(volume_of_normals(TILTING, x)).min() < 0.06
    found = good_plan(TILTING)
    x = found.trajectory(np.linspace(0, found.duration, 2001)).x
    assert np.abs(volume_of_normals(TILTING, x)).min() > 0.08 * (1 - 1e-9)
    assert free.duration * (1 - 1e-3) < found.duration < 1.05 * free.duration


def test_measure_is_the_volume_of_the_bars():
    ((margin, side),) = PARALLEL_SINGULARITY.items(SCENE)
    assert margin == 0.2
    x = np.array([[0.85, 0.1, 0.05], [0.6, -0.2, 0.1], SCENE.start])
    found = measured(PARALLEL_SINGULARITY, [margin, side], SCENE, x)
    np.testing.assert_allclose(found, side * volume(SCENE, x), rtol=1e-12)
    assert side * volume(SCENE, x)[-1] > 0


@pytest.mark.parametrize("key", ["parallel_singularity", "tilt_singularity"])
def test_a_distance_that_is_nowhere_is_refused_and_one_that_an_end_has_not_is_told(key):
    """Volumes of unit vectors are 1 at most."""
    with pytest.raises(SceneError, match=rf"^limits.{key} is 1.0; expected .* below 1$"):
        SCENE.model_copy(update={"limits": {key: 1.0}})
    with pytest.raises(Infeasible, match=r"is 0\.\d+, where at least 0.999 is allowed$"):
        plan(SCENE.model_copy(update={"limits": {key: 0.999}}))


def test_motions_keep_it():
    """A margin that the fastest motion does not keep, and the motion that does."""
    free = plan(SCENE.model_copy(update={"limits": None}))
    least = np.abs(volume(SCENE, free.trajectory(np.linspace(0, free.duration, 400)).x)).min()
    ends = np.abs(volume(SCENE, np.array([SCENE.start, SCENE.goal]))).min()
    margin = (least + ends) / 2
    assert least < margin * (1 - 1e-3), "the scene does not need the limit"
    kept = SCENE.model_copy(update={"limits": {"parallel_singularity": margin}})
    found = plan(kept)
    x = found.trajectory(np.linspace(0, found.duration, 2001)).x
    assert np.abs(volume(SCENE, x)).min() > margin * (1 - 1e-9)
    assert found.duration > free.duration * (1 - 1e-3)
    assert verify(kept, found.trajectory).failures() == []
    assert found.duration == pytest.approx(free.duration, rel=0.2)
