"""The Jacobian and the mass matrix of a model, against differences and forward dynamics."""

from __future__ import annotations

import numpy as np
import pytest

import deltaopt
from studies.problems import PROBLEMS

ROBOTS = PROBLEMS / "robots"
POINTS = np.array([[0.85, -0.15, 0.02], [0.8, 0.1, 0.1], [0.9, 0.0, -0.2]])


@pytest.fixture(params=["industrial", "industrial_drive"])
def model(request):
    return deltaopt.DeltaModel(deltaopt.load_robot(ROBOTS / f"{request.param}.yaml"), payload=1.0)


def test_the_jacobian_is_the_slope_of_the_angles(model):
    step, motors = 1e-6, model.functions.motors
    slopes = [
        (model.inverse_kinematics(POINTS + way) - model.inverse_kinematics(POINTS - way))[:, motors]
        for way in step * np.eye(3)
    ]
    found = model.jacobian(POINTS)
    np.testing.assert_allclose(found, np.stack(slopes, axis=-1) / (2 * step), rtol=1e-7, atol=1e-8)
    np.testing.assert_array_equal(model.jacobian(POINTS[0]), found[0])


def test_the_mass_matrix_is_that_of_forward_dynamics(model):
    """Also as the curvature of the kinetic energy should be: symmetric and positive."""
    found, rest = model.mass_matrix(POINTS), np.zeros((3, 3))
    tau = np.random.default_rng(5).normal(size=(3, 3))
    gained = model.forward_dynamics(POINTS, rest, tau) - model.forward_dynamics(POINTS, rest, rest)
    forces = np.einsum("nij,ni->nj", model.jacobian(POINTS), tau)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", found, gained), forces, atol=1e-10)
    np.testing.assert_allclose(found, np.swapaxes(found, 1, 2), atol=1e-12)
    assert (np.linalg.eigvalsh(found) > 1.0).all()  # more than the payload
    np.testing.assert_array_equal(model.mass_matrix(POINTS[0]), found[0])
