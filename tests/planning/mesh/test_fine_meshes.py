"""Meshes alone to a gap of 1e-6: tightened limits, and Pontryagin's condition on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deltaopt import load_scene, verify
from deltaopt.motion.certificate import MET
from deltaopt.planning.formulations.choice import Flat
from deltaopt.planning.formulations.delta import DeltaProblem
from deltaopt.planning.mesh.mesh_costates import certify_mesh, hamiltonian_on_mesh
from deltaopt.planning.mesh.mesh_solution import solve_on_mesh
from deltaopt.planning.mesh.next_scaling import next_scaling
from deltaopt.planning.nlp.problem import Guess, Ipopt
from deltaopt.planning.nlp.scaling import Scaling
from deltaopt.planning.nlp.transcription import LINEAR
from deltaopt.planning.plan import quicker
from deltaopt.planning.planner import Planner
from deltaopt.planning.refinement import Refinement
from deltaopt.planning.switching.resolver import SwitchResolver
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.model import delta_model
from deltaopt.scene.known_limits import Limits, limits_of
from deltaopt.scene.scene import Scene
from tests.planned_scenes import (
    CROSS,
    first_guess,
    flat_equations,
    machine_code,
    random_move,
    scaling_of,
)
from tests.planning.switching.test_resolution import REFERENCE


@machine_code
def test_a_mesh_alone_comes_to_the_reference():
    """Known by switch resolution, a quite different method."""
    scene = load_scene("problems/pick_and_place.yaml")
    planner = Planner(scene.robot, scene.payload, scene.limits, tolerance=1e-6, resolved_below=0.0)
    found = planner.plan(scene.start, scene.goal)
    assert found.within_tolerance
    assert -2e-7 < found.duration / REFERENCE["pick_and_place"] - 1 < 1.2e-6
    assert verify(scene, found.trajectory).ok


def limited(scene: Scene, share: float) -> Scene:
    """With a share of all limits."""
    torque = tuple(share * limit for limit in scene.robot.torque_limits)
    speed = tuple(share * limit for limit in scene.robot.speed_limits)
    return scene.model_copy(update={"limits": Limits(torque=torque, speed=speed)})


@machine_code
def test_a_share_of_the_limits_is_that_of_weaker_motors():
    """The same program, scaled otherwise; the multipliers are those of the whole limits."""
    mesh, scaling = np.full(12, 1 / 12), scaling_of(CROSS)
    problem, guess = flat_equations(CROSS)(mesh), first_guess(CROSS, 1e-9)
    dynamic = scaling.constraints.orders > 0
    shared = replace(scaling, share=np.where(dynamic, 0.8, 1.0)[None].repeat(12, axis=0))
    weaker = Scaling(problem_of(limited(CROSS, 0.8)), scaling.time)
    one, other = (problem.solve(guess, s) for s in (shared, weaker))
    assert one.position.knots[-1] == pytest.approx(other.position.knots[-1], rel=1e-8)
    ours, theirs = one.multipliers[..., dynamic], other.multipliers[..., dynamic]
    np.testing.assert_allclose(0.8 * ours, theirs, atol=1e-5)


@machine_code
def test_shares_by_interval_and_motor_are_those_of_ipopt():
    """Whose torques have bounds of their own in every interval."""
    rng, mesh = np.random.default_rng(5), np.full(12, 1 / 12)
    scene = load_scene("problems/pick_and_place.yaml")
    model, guess = delta_model(scene.robot, scene.payload), first_guess(scene, 1e-9)
    scaling = scaling_of(scene)
    share = np.ones((12, scaling.constraints.number))
    share[:, scaling.constraints.is_control] = rng.uniform(0.7, 1.0, (12, 3))
    scaling = replace(scaling, share=share)
    ours = flat_equations(scene)(mesh).solve(guess, scaling)
    constraints, by_ipopt = limits_of(scene).constraints, Ipopt()
    other = Flat().of(model.functions, LINEAR, constraints, solver=by_ipopt)(mesh)
    exact = replace(other.collocation, regularisation=0.0)
    ipopts = DeltaProblem(exact).solve(guess, scaling)
    assert ours.status == "Solve_Succeeded"
    assert ours.position.knots[-1] == pytest.approx(ipopts.position.knots[-1], rel=1e-6)
    np.testing.assert_allclose(ours.multipliers, ipopts.multipliers, atol=2e-3)


# Tightened limits


ROWS = limits_of(CROSS).constraints.number


@machine_code
def test_tightening_cures_what_slowing_pays_for():
    """On one mesh: the excess falls tenfold, and the duration hardly rises."""
    scaling, mesh = scaling_of(CROSS), np.full(400, 1 / 400)
    problem = flat_equations(CROSS)(mesh)
    plain = solve_on_mesh(problem, scaling, first_guess(CROSS, 1e-7))
    tighter = plain
    for _ in range(3):
        guess = Guess(tighter.trajectory, near=True, tolerance=1e-7)
        tighter = solve_on_mesh(problem, next_scaling(tighter, mesh), guess)
    assert plain.safe_factor > 1 + 1e-5
    assert tighter.safe_factor - 1 < 0.1 * (plain.safe_factor - 1)
    assert (
        0
        < tighter.trajectory.duration / plain.trajectory.duration - 1
        < 0.1 * (plain.safe_factor - 1)
    )


# What a mesh says of Pontryagin's condition


def searched_for(scene: Scene, tolerance: float) -> Refinement:
    """On meshes alone, from a coarse one to a fine one."""
    scaling = scaling_of(scene)
    switches = SwitchResolver(scaling, tolerance, print)
    found = Refinement(flat_equations(scene), scaling, tolerance, switches, print)
    found._coarse_left = found._fine_left = 0
    found.from_guess(first_guess(scene, 1e-4), np.full(16, 1 / 16))
    return found


@pytest.fixture(scope="module")
def searched():
    return searched_for(CROSS, 1e-6)


@machine_code
def test_the_hamiltonian_is_what_theory_says(searched):
    """-1, from multipliers that know nothing of it; not so on a coarse mesh."""
    rows = searched.resolver.rows
    coarse, fine = (hamiltonian_on_mesh(rows, searched.meshes[i]) for i in (0, -1))
    np.testing.assert_allclose(fine, -1, atol=MET)
    assert np.abs(coarse + 1).max() > 10 * MET
    assert searched.certificate(searched.meshes[-1]).residual <= MET
    assert searched.certificate(searched.meshes[0]) is None


@machine_code
def test_costates_of_neighbouring_knots_agree():
    """A move with two motors at their speed limits, on intervals of 1e-4: the limits of every one
    tell the costates, though their Jacobian by its knots is as large as its length is small."""
    found = searched_for(random_move("industrial", 9), 3e-6)
    fine, rows = found.meshes[-1], found.resolver.rows
    assert fine.mesh.min() < 2e-4
    assert np.abs(hamiltonian_on_mesh(rows, fine) + 1).max() < MET


@machine_code
def test_wrong_multipliers_do_not_satisfy_it(searched):
    """Those of one motor a tenth too high."""
    fine = searched.meshes[-1]
    wrong = fine.solution.multipliers * np.where(np.arange(ROWS) == 0, 1.1, 1.0)
    disturbed = replace(fine, solution=replace(fine.solution, multipliers=wrong))
    assert certify_mesh(searched.resolver.rows, disturbed).residual > 10 * MET


# Which gap is reported


def test_of_two_plans_the_quicker_is_taken_with_what_both_know():
    """1.000002 s with a reported gap of 9e-6, 1.000003 s with one of 2e-6."""
    plan = Planner(CROSS.robot, CROSS.payload).plan(CROSS.start, CROSS.goal)
    T = plan.duration
    one = replace(plan, trajectory=plan.trajectory.slowed(1.000002), gap=9e-6)
    other = replace(plan, trajectory=plan.trajectory.slowed(1.000003), gap=2e-6)
    for best in (quicker(one, other), quicker(other, one)):
        assert best.duration == one.duration
        assert best.gap == pytest.approx(1e-6, rel=1e-3)
    astray = replace(plan, trajectory=plan.trajectory.slowed(1.1), gap=1e-7)
    assert quicker(one, astray).gap == 9e-6
    assert quicker(one, astray).duration == pytest.approx(1.000002 * T, rel=1e-12)
