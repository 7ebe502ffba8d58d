"""Eq. (39) without angles against the general derivation, on random states of both robots."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

from deltaopt.codegen.vectorised import evaluate_rows
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import load_robot
from studies.bench.random_scenes import random_scenes
from studies.problems import PROBLEMS

ROBOTS = PROBLEMS / "robots"
ORSINO, INDUSTRIAL = (load_robot(ROBOTS / f"{name}.yaml") for name in ("orsino", "industrial"))
MODELS = {
    "orsino": DeltaModel(ORSINO, 1.0),
    "industrial": DeltaModel(INDUSTRIAL, 1.0),
    "empty": DeltaModel(ORSINO),
    "weightless": DeltaModel(ORSINO.model_copy(update={"gravity": 0.0}), 0.5),
}


SIZES = {"q": 12, "dq": 12, "ddq": 12, "torque": 3}


def states(model: DeltaModel):
    """x, v, a, τ, (20, 3) each, as in fast motions."""
    rng = np.random.default_rng(5)
    scenes = random_scenes(model.robot, model.payload, 10, seed=5)
    x = np.array([point for scene in scenes for point in (scene.start, scene.goal)])
    v, a, tau = (size * rng.normal(size=x.shape) for size in (2.0, 100.0, 10.0))
    return x, v, a, tau


def by_angles(model: DeltaModel, x, v, a, tau):
    """Cᵀ (Q* + Q) of the general derivation, the motors' speeds and accelerations."""
    residual = Explicit().residual(model.functions.mechanism)
    q, dq, ddq, torque = (ca.MX.sym(name, size) for name, size in SIZES.items())
    p = ca.MX.sym("p", len(model.parameters))
    function = ca.Function(
        "residual", [q, dq, ddq, torque, p], [residual(0, q, dq, ddq, torque, p)]
    )
    motion = model.motion(x, v, a)
    (force,) = evaluate_rows(function, *motion, tau, parameters=model.parameters)
    return force, motion[1][:, 3::3], motion[2][:, 3::3]


@pytest.mark.parametrize("name", MODELS)
def test_force_and_speeds(name):
    model = MODELS[name]
    x, v, a, tau = states(model)
    force, _, *motors = evaluate_rows(
        model.functions.explicit_equations, x, v, a, tau, parameters=model.parameters
    )
    for found, expected in zip((force, *motors), by_angles(model, x, v, a, tau), strict=True):
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("name", MODELS)
def test_alignments(name):
    """The margin that a planner keeps is sin² (q_{k,1} - q_{k,2})."""
    model = MODELS[name]
    x, v, a, tau = states(model)
    _, alignment, *_ = evaluate_rows(
        model.functions.explicit_equations, x, v, a, tau, parameters=model.parameters
    )
    q = model.inverse_kinematics(x)
    np.testing.assert_allclose(alignment, model.alignments(x), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(alignment, np.sin(q[:, 3::3] - q[:, 4::3]) ** 2, rtol=1e-9)


def test_force_vanishes_for_torques_of_inverse_dynamics():
    model = MODELS["orsino"]
    x, v, a, _ = states(model)
    tau = model.inverse_dynamics(x, v, a)
    force, *_ = evaluate_rows(
        model.functions.explicit_equations, x, v, a, tau, parameters=model.parameters
    )
    assert np.abs(force).max() < 1e-11 * np.abs(model.robot.platform.mass * a).max()


def test_bars_that_are_not_slender_are_served_too():
    forearm = ORSINO.forearm.model_copy(update={"inertia": (6e-3, 2e-3, 5e-3)})
    model = DeltaModel(ORSINO.model_copy(update={"forearm": forearm}), 1.0)
    x, v, a, tau = states(model)
    force, alignment, *motors = evaluate_rows(
        model.functions.explicit_equations, x, v, a, tau, parameters=model.parameters
    )
    for found, expected in zip((force, *motors), by_angles(model, x, v, a, tau), strict=True):
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
    np.testing.assert_allclose(alignment, model.alignments(x), rtol=1e-12)
