"""Piecewise polynomials: exact for what they can hold, and inverse to their variables."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import Polynomial

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.formulations.choice import Flat
from deltaopt.planning.formulations.delta import boundary_values
from deltaopt.planning.nlp.problem import Ipopt
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.scene_file import load_scene
from studies.problems import PROBLEMS

SCENE = load_scene(PROBLEMS / "pick_and_place.yaml")
MESH = np.array([0.3, 0.05, 0.25, 0.4])
BEGIN = np.concatenate([[0.0], np.cumsum(MESH)[:-1]])
DEGREES = [1, 2, 3, 5]


def polynomial(degree: int, seed: int = 0) -> Polynomial:
    """Position over the whole duration whose acceleration is of a degree."""
    return Polynomial(np.random.default_rng(seed).normal(size=degree + 3))


def mesh_variables(transcription: PiecewiseAcceleration, x: Polynomial):
    """X (N, 1), V (N, 1), A (N, degree + 1, 1) of a motion on the mesh."""
    at_nodes = BEGIN[:, None] + MESH[:, None] * transcription.nodes
    return x(BEGIN)[:, None], x.deriv()(BEGIN)[:, None], x.deriv(2)(at_nodes)[..., None]


@pytest.mark.parametrize("degree", DEGREES)
def test_weights_reproduce_polynomials(degree):
    transcription, x = PiecewiseAcceleration(degree), polynomial(degree)
    X, V, A = mesh_variables(transcription, x)
    variables = np.concatenate([X, V, A[..., 0]], axis=1)
    for c in (0.0, 0.2, 0.5, 1.0):
        weights = transcription.weights(c, MESH)
        for order, part in enumerate(weights):
            exact = x.deriv(order)(BEGIN + c * MESH)
            np.testing.assert_allclose((part * variables).sum(axis=1), exact, atol=1e-12)


@pytest.mark.parametrize("degree", DEGREES)
def test_coefficients_reproduce_polynomials(degree):
    transcription, x = PiecewiseAcceleration(degree), polynomial(degree)
    coefficients = transcription.coefficients(*mesh_variables(transcription, x), MESH)
    pieces = PiecewisePolynomial(np.append(BEGIN, 1.0), coefficients)
    t = np.linspace(0, 1, 101)
    np.testing.assert_allclose(pieces.at(t)[:, 0], x(t), atol=1e-12)


@pytest.mark.parametrize("degree", DEGREES)
def test_weights_integrate_exactly(degree):
    """Velocity is the integral of acceleration and position that of velocity, by Gauss's rule."""
    transcription, eta = PiecewiseAcceleration(degree), 0.37
    nodes, weights = np.polynomial.legendre.leggauss(8)
    for end in (0.4, 1.0):
        inside = transcription.weights(end * (nodes + 1) / 2, eta)
        at_end, at_begin = transcription.weights(end, eta), transcription.weights(0.0, eta)
        for order in (0, 1):
            integral = eta * end / 2 * weights @ inside[order + 1]
            np.testing.assert_allclose(at_end[order] - at_begin[order], integral, atol=1e-14)


def cubic(model: DeltaModel, duration: float) -> Trajectory:
    """3 u² - 2 u³ of the way: acceleration linear in time, so that any mesh can hold it."""
    way = np.subtract(SCENE.goal, SCENE.start)
    coefficients = np.outer([0, 0, 3, -2], way)
    coefficients[0] = SCENE.start
    return Trajectory(PiecewisePolynomial(np.array([0.0, 1.0]), coefficients[None]), model).slowed(
        duration
    )


def flat(model: DeltaModel, degree: int):
    """The flat problem for Ipopt, whose torques are variables, on the mesh."""
    transcription, constraints = PiecewiseAcceleration(degree), limits_of(SCENE).constraints
    of = Flat().of(model.functions, transcription, constraints, solver=Ipopt())
    return of(MESH).collocation


@pytest.mark.parametrize("degree", [1, 3])
def test_pack_and_unpack_are_inverse(degree):
    model = DeltaModel(SCENE.robot, SCENE.payload)
    problem, scaling = flat(model, degree), Scaling(problem_of(SCENE), 0.2)
    ends, motion = boundary_values(scaling), cubic(model, 0.4)
    z = problem.pack(motion.position, ends)
    back = Trajectory(problem.unpack(z, ends), model)
    t = np.linspace(0, 0.4, 50)
    np.testing.assert_allclose(back.knots, 0.4 * np.append(BEGIN, 1.0), atol=1e-15)
    np.testing.assert_allclose(back(t).x, motion(t).x, atol=1e-14)
    # A sample 1e-9 of an interval inside of it is what tells z and its copy apart.
    np.testing.assert_allclose(problem.pack(back.position, ends), z, atol=1e-7)
