"""Switch resolution: structures that are detected, optima that are certified."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deltaopt import load_scene, plan, verify
from deltaopt.motion.loads import loads_inside
from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.flat.equations import point_equations
from deltaopt.planning.mesh.error_estimate import FRACTIONS
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.switching.detection import detect_structure
from deltaopt.problem.of_scene import problem_of
from deltaopt.verify.pontryagin import extremal
from studies.bench.hard_moves import move
from tests.oracles.arcs import ArcProblem

# Durations in s, each by `deltaopt plan problems/NAME.yaml --tolerance 1e-8`; the digits given
# agree between polynomials of degrees 8 and 11 on the arcs.
REFERENCE = {
    "pick_and_place": 0.14087009,
    "light_and_fast": 0.10698816,
    "long_diagonal": 0.24566039,
    "industrial_cross": 0.14004872,
}


@pytest.fixture(scope="module", params=REFERENCE)
def resolved(request):
    scene = load_scene(f"problems/{request.param}.yaml")
    return request.param, scene, plan(scene, tolerance=1e-8)


def test_reference_durations(resolved):
    name, _, found = resolved
    assert found.duration == pytest.approx(REFERENCE[name], abs=2e-8)
    assert found.gap <= 1e-8


def test_certificate(resolved):
    _, _, found = resolved
    assert found.certificate is not None
    assert found.certificate.hamiltonian_spread <= 1e-6
    assert found.certificate.sign_violation <= 1e-6


def test_costates_fitted_to_the_motion_agree(resolved):
    """Not from the multipliers of the program: nothing but the motion is looked at."""
    _, scene, found = resolved
    assert extremal(scene, found.trajectory).residual <= 1e-6


def test_verified(resolved):
    _, scene, found = resolved
    assert verify(scene, found.trajectory).ok


def test_ipopt_finds_the_same_duration(resolved):
    """By the same arcs as a nonlinear program, its torques variables: nothing of Newton's method
    on the conditions of optimality; and from lengths that are a little off."""
    _, scene, found = resolved
    scaling = Scaling(problem_of(scene), found.duration)
    rows = loads_inside(problem_of(scene), found.trajectory, FRACTIONS).rows
    by_interval = rows.reshape(-1, len(FRACTIONS), rows.shape[1])
    of_order = ByOrder.of(scaling.constraints, by_interval)
    of_order = of_order._replace(states=(None, of_order.states[1]))
    structure = detect_structure(np.diff(found.trajectory.knots) / found.duration, of_order)
    off = 1 + 1e-3 * np.random.default_rng(1).uniform(-1, 1, len(structure.lengths))
    structure = replace(structure, lengths=structure.lengths * off)
    model = found.trajectory.model
    equations = point_equations(model.functions, scaling.constraints)
    problem, p = ArcProblem(equations, structure, 8), scaling.parameters
    guess = problem.pack(found.trajectory, scaling)
    solution = problem.program.solve(guess, *problem.bounds(scaling), p)
    duration = float(problem.lengths(solution.z).sum()) * scaling.time
    assert found.duration == pytest.approx(duration, rel=1e-8)


def test_mesh_plans_are_never_faster(resolved):
    """The certificate is local; a mesh solution below it would prove it wrong."""
    _, scene, found = resolved
    assert plan(scene, tolerance=1e-3).duration > found.duration


def test_two_motors_by_symmetry_switch_together():
    """Motors 2 and 3 mirror each other in the plane z = 0 of pick_and_place."""
    found = plan(load_scene("problems/pick_and_place.yaml"), tolerance=1e-6)
    tau = found.trajectory(np.linspace(0, found.duration, 400)).tau
    np.testing.assert_allclose(tau[:, 1], tau[:, 2], atol=1e-6)


def test_multipliers_of_least_squares_do_not_move_a_motion():
    """A random robot, where the step that makes multipliers symmetric once led 1e-8 m away."""
    scene = move(1, 138).scene
    found = plan(scene, tolerance=1e-6)
    assert found.gap < 1e-6
    assert verify(scene, found.trajectory).ok
