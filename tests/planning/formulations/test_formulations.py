"""Poses, loop closures and transcriptions against each other and against what they promise."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest

import deltaopt
from deltaopt.compare.plans.measures import quality
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.errors import NotConverged
from deltaopt.planning.formulations.choice import Redundant
from deltaopt.planning.formulations.collocation import FAR, CollocationProblem
from deltaopt.planning.formulations.loop_closure import (
    AccelerationLevel,
    Baumgarte,
    KnotConstraints,
    Projection,
)
from deltaopt.planning.nlp.problem import Cost
from deltaopt.planning.nlp.program import IPOPT
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from studies.problems import PROBLEMS
from tests.planned_scenes import first_guess, scaling_of
from tests.planned_scenes import flat_equations as planners_equations
from tests.shipped_cases import case, interpreted

CLOSURES = [KnotConstraints(), Projection(), Baumgarte(), AccelerationLevel()]


def name(value):
    return getattr(value, "name", value)


@cache
def equations(scene, formulation, closure=None):
    system = case(scene).system
    build = {
        "flat": deltaopt.flat.equations,
        "forward": deltaopt.forward.equations,
        "explicit": Redundant(deltaopt.explicit, closure).equations,
        "multiplier": Redundant(deltaopt.multiplier, closure).equations,
    }
    return interpreted(build[formulation](system))  # compiling takes longer than these solves


@cache
def solved(scene, formulation, closure=None, intervals=10):
    """Problem, solution and quality from the baseline."""
    task = case(scene).task
    problem = CollocationProblem(
        equations(scene, formulation, closure),
        PiecewiseAcceleration(),
        np.full(intervals, 1 / intervals),
    )
    guess = problem.pack(case(scene).guess, task)
    solution = problem.program(FAR).solve(guess, *problem.bounds(task), task.p)
    return problem, solution, quality(case(scene), problem, solution.z)


SCENES = ["pick_and_place", "five_bar"]
"""One of each mechanism."""
SOLVED = [*(("five_bar", closure) for closure in CLOSURES)]
SOLVED += [("pick_and_place", closure) for closure in CLOSURES[:2]]


@pytest.mark.parametrize("scene", SCENES)
def test_formulations_agree_on_a_coarse_mesh(scene):
    """Ten intervals: what is left is the error of the transcription."""
    durations = [
        solved(scene, *formulation)[2].duration
        for formulation in (
            ("flat",),
            ("forward",),
            ("explicit", KnotConstraints()),
            ("multiplier", Projection()),
        )
    ]
    np.testing.assert_allclose(durations, durations[0], rtol=4e-3)


@pytest.mark.parametrize(("scene", "closure"), SOLVED, ids=name)
def test_explicit_and_multiplier_have_the_same_solutions(scene, closure):
    """λ takes nothing from and adds nothing to the motion: the collocation is the same."""
    explicit, multiplier = (
        solved(scene, formulation, closure) for formulation in ("explicit", "multiplier")
    )
    np.testing.assert_allclose(explicit[2].duration, multiplier[2].duration, rtol=1e-6)
    for _, solution, _ in (explicit, multiplier):
        assert solution.iterations <= 40


def test_the_flat_formulation_is_that_of_the_planner():
    """The flat equations of collocation and the production ones on the same mesh."""
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    mesh = np.full(10, 0.1)
    problem = planners_equations(scene)(mesh)
    planners = problem.solve(first_guess(scene, 1e-8), scaling_of(scene))
    c = case("pick_and_place")
    problem = CollocationProblem(equations("pick_and_place", "flat"), PiecewiseAcceleration(), mesh)
    problem = replace(problem, regularisation=0.0)
    z = problem.pack(c.guess, c.task)
    solution = problem.program(FAR).solve(z, *problem.bounds(c.task), c.task.p)
    duration = problem.unpack(solution.z, c.task).knots[-1]
    assert planners.position.knots[-1] == pytest.approx(duration, rel=1e-6)


def test_plans_pass_verification_in_redundant_coordinates():
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    flat = deltaopt.plan(scene, tolerance=1e-3)
    for formulation in (deltaopt.explicit, deltaopt.multiplier):
        plan = deltaopt.plan(scene, tolerance=1e-3, formulation=formulation)
        report = deltaopt.verify(scene, plan.trajectory)
        assert report.ok, report.failures()
        assert report.kinematic_error <= 1e-9
        assert plan.duration == pytest.approx(flat.duration, rel=1e-3)


def test_drift_is_in_the_reported_motion():
    """Acceleration level: verify measures the twelve polynomials, and does not pass them."""
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    formulation = Redundant(Multiplier(), AccelerationLevel())
    plan = deltaopt.plan(scene, tolerance=1.0, formulation=formulation)
    report = deltaopt.verify(scene, plan.trajectory)
    assert plan.trajectory.coordinates is not None
    assert 1e-7 < report.kinematic_error < 1e-1
    assert any("loops open" in failure for failure in report.failures())


@pytest.mark.parametrize("closure", [KnotConstraints(), Projection()], ids=name)
@pytest.mark.parametrize("scene", ["pick_and_place", "five_bar"])
def test_loops_are_closed_at_knots(scene, closure):
    assert solved(scene, "explicit", closure)[2].at_knots <= 1e-9


SMOOTH = "pick_and_place"


@cache
def least_effort(formulation, closure, degree, intervals):
    """Least mean of (τ/τ_max)² at twice the baseline's duration, where no limit is active."""
    c = case(SMOOTH)
    guess = c.guess.slowed(2.0)
    p = c.task.p.copy()
    p[4] = guess.knots[-1]  # the scale of time
    task = replace(c.task, p=p)
    effort = Cost(time=0.0, running=1 / p[5] ** 2, duration_is_given=True)
    problem = CollocationProblem(
        equations(SMOOTH, formulation, closure),
        PiecewiseAcceleration(degree, ()),
        np.full(intervals, 1 / intervals),
        effort,
    )
    start = problem.pack(guess, task)
    solution = problem.program(FAR).solve(start, *problem.bounds(task), task.p)
    tau = problem.variables.algebraic(solution.z)[:, :, :3]
    measured = quality(replace(c, task=task), problem, solution.z)
    per_interval = np.einsum("j,njk->n", problem.transcription.quadrature, tau**2)
    return float(problem.mesh @ per_interval), measured


@pytest.mark.parametrize(
    ("formulation", "closure", "degree"),
    [
        ("flat", None, 1),
        ("flat", None, 2),
        ("forward", None, 2),
        ("explicit", KnotConstraints(), 1),
        ("explicit", AccelerationLevel(), 1),
        ("explicit", AccelerationLevel(), 2),
        ("multiplier", Projection(), 1),
    ],
    ids=name,
)
def test_order_of_the_transcription(formulation, closure, degree):
    """Lobatto's rule on degree + 1 nodes is exact for polynomials of degree 2 degree - 1, so that
    the cost of a smooth problem converges with the power 2 degree of the interval length."""
    exact, _ = least_effort("flat", None, 4, 16)
    errors = [abs(least_effort(formulation, closure, degree, n)[0] - exact) for n in (8, 16)]
    measured = np.log2(errors[0] / errors[1])
    assert measured == pytest.approx(2 * degree, abs=0.3)


@pytest.mark.parametrize("degree", [1, 2])
def test_drift_falls_with_the_order(degree):
    """Acceleration level on a smooth motion: the loops open with the error of the mesh."""
    drift = [least_effort("explicit", AccelerationLevel(), degree, n)[1] for n in (8, 16)]
    slope = np.log2(drift[0].kinematic_error / drift[1].kinematic_error)
    assert slope == pytest.approx(2 * degree, abs=0.3)


def active_rank(problem, solution, task):
    """How many rows of the Jacobian hold with equality at a solution, and their rank, which is
    smaller if rows depend on each other. Variables that a bound holds do not count."""
    program = problem.program(FAR)
    _, J = program._solver.get_function("nlp_jac_g")(solution.z, task.p)
    lower, upper = program.rows
    least, most = problem.bounds(task)
    free = (least < most) & ~(np.abs(solution.bound_multipliers) > 1e-4)
    active = (lower == upper) | (np.abs(solution.row_multipliers) > 1e-4)
    rows = np.asarray(ca.DM(J).full())[active][:, free]
    return len(rows), int(np.linalg.matrix_rank(rows, tol=1e-9 * np.abs(rows).max()))


@pytest.mark.parametrize("formulation", ["explicit", "multiplier"])
@pytest.mark.parametrize(("scene", "closure"), SOLVED, ids=name)
def test_no_active_row_depends_on_others(formulation, scene, closure):
    problem, solution, _ = solved(scene, formulation, closure)
    rows, rank = active_rank(problem, solution, case(scene).task)
    assert rank == rows


def test_not_converged_names_constraint_and_time(monkeypatch):
    monkeypatch.setitem(IPOPT, "ipopt.max_iter", 2)
    task = case("pick_and_place").task
    problem = CollocationProblem(
        equations("pick_and_place", "multiplier", KnotConstraints()),
        PiecewiseAcceleration(),
        np.full(4, 0.25),
    )
    guess = problem.pack(case("pick_and_place").guess, task)
    named = (
        r"Maximum_Iter.*worst constraint: (dynamics, equation \(37\) for coordinate|loop closure at"
        r" (a knot|acceleration level), constraint( and its rate, row)?) \d+ at [\d.]+% of "
    )
    with pytest.raises(NotConverged, match=named):
        problem.program(FAR).solve(guess, *problem.bounds(task), task.p)
