"""The comparison of plans on a tiny run: what it says is what it measured."""

from __future__ import annotations

from dataclasses import replace
from unittest.mock import patch

import casadi as ca
import numpy as np
import pytest

import deltaopt
from deltaopt.compare.plans.cases import delta_case, five_bar_case
from deltaopt.compare.plans.measures import Quality
from deltaopt.compare.plans.report import answer, csv, tables
from deltaopt.compare.plans.study import METHODS, compare_plans
from deltaopt.mechanisms.five_bar import five_bar, inverse_kinematics
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.formulations.collocation import FAR, CollocationProblem
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from deltaopt.plots.plans import draw
from deltaopt.problem.of_scene import problem_of
from studies.problems import PROBLEMS
from tests.shipped_cases import interpreted


@pytest.fixture(scope="module")
def study():
    tiny = {"OF_REFERENCE": 1e-2, "UNIFORM": (6,), "REFINEMENTS": 1}
    with patch.multiple("deltaopt.compare.plans.study", **tiny):
        return compare_plans([five_bar_case()], lambda *_: None)


def test_every_method_is_in_it(study):
    assert {str(row.method) for row in study.rows} == {str(method) for method in METHODS}
    assert not [row for row in study.rows if row.failure and not row.refined]
    assert all(0 < row.evaluation_seconds < row.seconds for row in study.rows if not row.failure)


def test_table_and_csv(study):
    lines = csv(study).splitlines()
    assert lines[0].startswith("formulation,closure,degree,case,intervals,refined,failure,seconds")
    assert len(lines) == 1 + len(study.rows)
    assert {line.count(",") for line in lines if '"' not in line} == {lines[0].count(",")}
    assert "multiplier   constraints at knots" in tables(study)


def test_answer_and_chart_with_a_failure(study, tmp_path):
    first = study.rows[-1]
    failed = replace(first, failure="said so", quality=Quality(), gap=np.inf)
    broken = replace(study, rows=[*study.rows[:-1], failed])
    told = " ".join(answer(broken).split())
    assert f"(not: {first.method} on five_bar ({first.intervals} intervals))" in told
    assert f"{len(study.rows) - 1} of {len(study.rows)} problems were solved" in told
    assert "failed" in tables(broken)
    times = 0.007 * 1.01 ** np.arange(len(broken.rows))  # measured ones change the picture
    rows = [replace(row, seconds=t) for row, t in zip(broken.rows, times, strict=True)]
    draw(replace(broken, rows=rows), "five_bar", tmp_path / "chart.png")
    assert (tmp_path / "chart.png").stat().st_size > 20_000


def test_safe_duration_is_that_of_verification():
    """Of the Delta, by the general way that serves the five-bar too."""
    scene = deltaopt.load_scene(PROBLEMS / "industrial_cross.yaml")
    model = deltaopt.DeltaModel(scene.robot, scene.payload)
    c = delta_case("cross", scene)
    faster = c.guess.slowed(0.8)
    expected = safe_factor(problem_of(scene), Trajectory(faster, model))
    assert c.safe_factor(faster) == pytest.approx(expected, rel=1e-4)


def test_slowing_the_five_bar_with_friction():
    """Friction falls with the speed, not with its square: the limit is met exactly."""
    c = five_bar_case()
    faster = c.guess.slowed(0.7)
    torque = c.by_order(faster.slowed(c.safe_factor(faster))).control
    assert np.abs(torque).max() == pytest.approx(1.0, abs=1e-9)


def test_five_bar_closes_its_loops():
    m = five_bar()
    q = inverse_kinematics()([0.3, 0.02], [])
    closure = ca.Function("closure", [m.q], [m.holonomic])(q)
    np.testing.assert_allclose(closure, 0, atol=1e-15)
    C, P = m.closed_form
    J = m.J
    JC, JP = (np.array(x) for x in ca.Function("JC", [m.q], [J @ C, J @ P])(q))
    np.testing.assert_allclose(JC, 0, atol=1e-15)
    np.testing.assert_allclose(JP, np.eye(4), atol=1e-14)


def test_compiled_and_interpreted_functions_give_the_same_solution():
    c = five_bar_case()
    equations = deltaopt.flat.equations(c.system)
    durations = []
    for e in (equations, interpreted(equations)):
        problem = CollocationProblem(e, PiecewiseAcceleration(), np.full(6, 1 / 6))
        guess = problem.pack(c.guess, c.task)
        solution = problem.program(FAR).solve(guess, *problem.bounds(c.task), c.task.p)
        durations.append(solution.z[-1])
    assert durations[0] == pytest.approx(durations[1], rel=1e-9)
