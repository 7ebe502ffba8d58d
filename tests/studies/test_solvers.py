"""Studies of other solvers, of settings and of peers that fix the path."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from deltaopt.bench import fixed_paths
from deltaopt.bench.fixed_paths import driven, fixed_path_comparison, platform_motion, straight
from deltaopt.codegen.compile import compiler
from deltaopt.errors import MissingPackage
from deltaopt.planning.nlp.problem import Guess
from deltaopt.planning.planner import Planner
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import load_robot
from deltaopt.scene.scene import load_scene
from studies import solvers
from studies.near import gain_report, moved, planner_near
from studies.settings import compare_settings, settings_report
from studies.solvers import (
    Trial,
    case_of,
    flat_problem,
    flat_stages,
    left_out,
    report_line,
)
from studies.sqp import FeasibleSqp, sqp
from studies.stages import StageResult, Start, fatrop

PROBLEMS = Path(__file__).parents[2] / "problems"
ORSINO = load_robot(PROBLEMS / "robots" / "orsino.yaml")
PICK = load_scene(PROBLEMS / "pick_and_place.yaml")

PROBLEM = flat_problem(ORSINO, 1.0, 6)
STAGES = flat_stages(PROBLEM)
CASE = case_of(PROBLEM, PICK)


def start() -> Start:
    return CASE.start(CASE.guess.trajectory)


def needs(plugin: str):
    there = compiler() is not None and (ca.has_nlpsol(plugin) or ca.has_conic(plugin))
    return pytest.mark.skipif(not there, reason=f"no {plugin}, or no C compiler to feed it with")


# Stage by stage


def test_every_stage_has_its_variables_and_a_duration():
    n = PROBLEM.n_variables
    assert STAGES.horizon == 6
    assert np.array_equal(np.unique(STAGES.copies), np.arange(n))
    assert (np.bincount(STAGES.copies)[:-1] == 1).all()
    assert np.bincount(STAGES.copies)[-1] == 7
    structure = STAGES.structure
    assert sum(structure["nx"]) + sum(structure["nu"]) == len(STAGES.copies)
    assert sum(structure["nx"][1:]) + sum(structure["ng"]) == len(STAGES.row_bounds[0])


@needs("ipopt")
def test_rows_and_derivatives_are_those_of_the_program():
    """The program is assembled apart; derivatives are held against differences."""
    at, program, gaps = start(), PROBLEM.program, STAGES.nx * STAGES.horizon
    s, order = at.z[STAGES.copies], np.concatenate(STAGES.rows)
    rows = program.jacobian(at.z, at.p)[0].full().ravel()
    linear = len(program.linear.columns)
    expected = np.concatenate([-rows[:linear], np.zeros(STAGES.horizon), rows[linear:]])
    found, jacobian = STAGES.function("nlp_jac_g")(s, at.p)
    np.testing.assert_allclose(found.full().ravel(), expected[order], atol=1e-12)

    rng = np.random.default_rng(1)
    step, prices = 1e-6 * rng.normal(size=len(s)), rng.normal(size=len(order))
    ahead, behind = (STAGES.function("nlp_jac_g")(s + sign * step, at.p) for sign in (1, -1))
    np.testing.assert_allclose(
        (jacobian @ step).full(), (ahead[0] - behind[0]).full() / 2, atol=1e-11
    )
    hessian = STAGES.function("hess_lag")(s, at.p, 1.0, prices)
    difference = ((ahead[1] - behind[1]).T @ prices).full() / 2
    np.testing.assert_allclose((hessian @ step).full(), difference, atol=1e-10)
    assert (order < gaps).sum() == gaps


@needs("fatrop")
def test_fatrop_finds_the_duration_that_ipopt_finds():
    at = start()
    theirs = PROBLEM.program.solve(at.z, at.lower, at.upper, at.p)
    found = fatrop(STAGES, {"tolerance": 1e-6, "mu_init": 1.0}).solve(at)
    assert found.solved
    np.testing.assert_allclose(found.T, theirs.z[-1], rtol=1e-4)


@needs("hpipm")
@pytest.mark.parametrize("method", [sqp, FeasibleSqp])
def test_sqp_finds_the_duration_that_ipopt_finds(method):
    """From Ipopt's own solution slowed by 3 %, which keeps all rows."""
    at = start()
    theirs = PROBLEM.program.solve(at.z, at.lower, at.upper, at.p)
    solved = PROBLEM.solve(Guess(CASE.guess.trajectory, False, 1e-6), CASE.scales, CASE.parameters)
    known = fatrop(STAGES, {"tolerance": 1e-5, "mu_init": 1.0}).solve(at)
    slowed = type(CASE.guess.trajectory)(solved.position, DeltaModel(ORSINO, 1.0)).slowed(1.03)
    found = method(STAGES, "hpipm").solve(CASE.start(slowed), known)
    assert isinstance(found, StageResult)
    assert found.solved
    np.testing.assert_allclose(found.T, theirs.z[-1], rtol=2e-4)


# Reports


def test_a_solver_that_never_solves_is_told_as_such():
    never, exact = [Trial(2.0, 9.0, False)] * 2, [Trial(1.0, 9.0, True, 0.5, 0.7)] * 2
    assert report_line("never", never, exact, exact).split()[:2] == ["never", "0%"]
    words = report_line("exact", exact, exact, exact).split()
    assert words == ["exact", "100%", "9", "1000.00", "1000.0", "1.0", "50%", "0e+00"]


def test_solvers_that_are_not_there_are_told(monkeypatch):
    monkeypatch.setattr(solvers, "compiler", lambda: object())
    sentence = "worhp99 is not in this build of CasADi and left out"
    assert left_out("ipopt", "worhp99") == [sentence]
    monkeypatch.setattr(solvers, "compiler", lambda: None)
    assert left_out("fatrop", "hpipm") == ["without a C compiler fatrop, hpipm are left out"]


def test_ends_are_moved_by_their_share_of_the_way():
    rng = np.random.default_rng(1)
    other, way = moved(PICK, 0.05, rng), np.linalg.norm(np.subtract(PICK.goal, PICK.start))
    for mine, theirs in ((other.start, PICK.start), (other.goal, PICK.goal)):
        assert np.linalg.norm(np.subtract(mine, theirs)) == pytest.approx(0.05 * way)


def test_a_plan_from_near_is_as_fast():
    gains = planner_near(Planner(ORSINO, 1.0), 2, 1, 0.01, lambda _: None)
    assert len(gains) == 2
    assert max(abs(g.difference) for g in gains) < 2e-3
    assert "of 2 moves" in gain_report(gains)


def test_the_chosen_settings_come_first():
    runs = compare_settings(ORSINO, 1.0, 1, 1, lambda _: None)
    lines = settings_report(runs).splitlines()
    assert lines[1].startswith("as chosen")
    assert len(lines) == len(runs) + 1
    chosen, strict = runs["as chosen"][0], runs["tolerance 5e-04"][0]
    assert chosen.ok
    assert chosen.work < strict.work


# Given paths


def test_a_driven_path_by_its_length():
    """Against differences of its positions: tangents of length one, curvature between."""
    motion = Planner(ORSINO, 1.0).plan(PICK.start, PICK.goal).trajectory
    path = driven(motion, 200)
    x, tangent, curvature = (path(path.s, order) for order in range(3))
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=1), 1.0, rtol=1e-12)
    inner = slice(400, 600)  # the third interval, away from rest
    slopes = np.gradient(x[inner], path.s[inner], axis=0)[1:-1]
    np.testing.assert_allclose(tangent[inner][1:-1], slopes, atol=1e-5)
    bends = np.gradient(tangent[inner], path.s[inner], axis=0)[1:-1]
    np.testing.assert_allclose(curvature[inner][1:-1], bends, atol=1e-3 * np.abs(bends).max())


def test_motors_and_platform_move_together():
    model, rng = DeltaModel(ORSINO, 1.0), np.random.default_rng(1)
    x = np.array(PICK.start) + 0.02 * rng.normal(size=(5, 3))
    v, a = rng.normal(size=(2, 5, 3))
    _, dq, ddq = model.motion(x, v, a)
    found = platform_motion(model, x, dq[:, 3::3], ddq[:, 3::3])
    np.testing.assert_allclose(found, (v, a), rtol=1e-10, atol=1e-10)


def test_peers_that_are_missing_are_told(monkeypatch):
    def missing(package: str):
        raise MissingPackage(f"{package} is not installed")

    monkeypatch.setattr(fixed_paths, "installed", missing)
    told = fixed_path_comparison(ORSINO, 1.0, 1, 1, lambda _: None)
    assert told.splitlines()[1:] == ["  toppra is not installed", "  ruckig is not installed"]


def test_toppra_drives_our_path_as_fast_as_we_do():
    """On a grid fine enough, and faster by no more than the gap that the plan states."""
    pytest.importorskip("toppra")
    plan = Planner(ORSINO, 1.0).plan(PICK.start, PICK.goal)
    coarse, fine = (
        fixed_paths.toppra_duration(plan.scene, driven(plan.trajectory, pieces)) / plan.duration
        for pieces in (32, 128)
    )
    assert 1 - plan.gap < fine < 1 + 3e-4
    assert fine < coarse < 1 + 2e-3
    line = fixed_paths.toppra_duration(plan.scene, straight(plan.scene, 100))
    assert line > plan.duration
