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
from deltaopt.planning.nlp.program import IpoptSolution
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.planner import Planner
from deltaopt.planning.switching.detection import detect_structure
from deltaopt.problem.of_scene import problem_of
from deltaopt.verify.pontryagin import extremal
from tests.oracles.arcs import ArcProblem
from tests.oracles.certify import certify, hamiltonian

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
    of_order = ByOrder.of(scaling.constraints, by_interval)._replace(position=None)
    structure = detect_structure(np.diff(found.trajectory.knots) / found.duration, of_order)
    off = 1 + 1e-3 * np.random.default_rng(1).uniform(-1, 1, len(structure.lengths))
    structure = replace(structure, lengths=structure.lengths * off)
    model = found.trajectory.model
    equations = point_equations(model.functions, scaling.constraints)
    problem, p = ArcProblem(equations, structure, 8), scaling.parameters(model.parameters)
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


class TestDetection:
    MESH = np.full(10, 0.1)

    def at_points(self, *ramps):
        """One sign or ramp per interval and motor, as rows at three points."""
        return np.array(
            [
                [[m[0], (m[0] + m[1]) / 2, m[1]] for m in motors]
                for motors in zip(*ramps, strict=True)
            ]
        ).transpose(0, 2, 1)

    def rows(self, *control):
        return ByOrder(self.at_points(*control))

    def test_a_blurred_switch_is_where_its_impulse_says(self):
        up, down = (1, 1), (-1, -1)
        blurred = [up] * 4 + [(1, 0)] + [down] * 5  # mean 0.5: three quarters of it up
        short = np.array([0.1] * 4 + [0.02] + [0.116] * 5)
        structure = detect_structure(short, self.rows(blurred, [up] * 10, [down] * 10))
        assert structure.control.tolist() == [[1, 1, -1], [-1, 1, -1]]
        assert structure.lengths == pytest.approx([0.415, 0.585])

    def test_a_long_stretch_without_limit_is_an_arc(self):
        singular = [(1, 1)] * 3 + [(0.2, 0.3)] * 4 + [(-1, -1)] * 3
        structure = detect_structure(self.MESH, self.rows(singular, [(1, 1)] * 10, [(1, 1)] * 10))
        assert structure.control[:, 0].tolist() == [1, 0, -1]
        assert structure.lengths == pytest.approx([0.3, 0.4, 0.3])

    def test_a_motor_at_its_velocity_limit_is_at_no_limit_of_its_control(self):
        tau = [(1, 1)] * 5 + [(0.95, 0.95)] * 5
        speed = [(0, 0.5)] * 5 + [(1, 1)] * 5
        rest = [(0, 0)] * 10
        control = self.at_points(tau, [(1, 1)] * 10, [(1, 1)] * 10)
        rows = ByOrder(control, self.at_points(speed, rest, rest))
        structure = detect_structure(self.MESH, rows)
        assert structure.control[:, 0].tolist() == [1, 0]
        assert structure.velocity[:, 0].tolist() == [0, 1]


def test_a_perturbed_motion_has_no_certificate():
    """Multipliers that do not belong to the motion leave H anything but constant."""
    scene = load_scene("problems/light_and_fast.yaml")
    problem, solution, p = _solved(scene)
    assert certify(problem, solution, p).residual < 1e-6
    assert hamiltonian(problem, solution, p) == pytest.approx(-1, abs=1e-6)
    rng = np.random.default_rng(1)
    z = solution.z * (1 + 1e-2 * rng.standard_normal(len(solution.z)))
    assert certify(problem, replace(solution, z=z), p).hamiltonian_spread > 1e-3


def _solved(scene) -> tuple[ArcProblem, IpoptSolution, np.ndarray]:
    """light_and_fast with the switches that were found for it, to be found again."""
    planner = Planner(scene.robot, scene.payload, scene.limits, tolerance=1e-6)
    found = planner.plan(scene.start, scene.goal)
    motion = found.trajectory.inside_intervals(np.linspace(0, 1, 25))
    rows = ByOrder((motion.tau / np.array(scene.robot.torque_limits)).reshape(-1, 25, 3))
    mesh = np.diff(found.trajectory.knots) / found.duration
    model = found.trajectory.model
    scaling = Scaling(problem_of(scene), 0.15)
    problem = ArcProblem(
        point_equations(model.functions, scaling.constraints), detect_structure(mesh, rows), 6
    )
    p = scaling.parameters(model.parameters)
    guess = problem.pack(found.trajectory, scaling)
    return problem, problem.program.solve(guess, *problem.bounds(scaling), p), p
