"""Knots at switches: where they are put, and what they do for redundant formulations."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import deltaopt
from deltaopt.compare.plans.measures import independent
from deltaopt.compare.plans.study import at_switches
from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.formulations.collocation import FAR, NEAR, CollocationProblem
from deltaopt.planning.mesh.error_estimate import FRACTIONS, ErrorEstimate
from deltaopt.planning.nlp.transcription import PiecewiseAcceleration
from tests.shipped_cases import case, interpreted

FORMULATIONS = {
    "flat": deltaopt.flat.equations,
    "forward": deltaopt.forward.equations,
    "explicit": deltaopt.Redundant(deltaopt.explicit).equations,
    "multiplier": deltaopt.Redundant(deltaopt.multiplier).equations,
}


def bang_bang(mesh, switch):
    """One motor from its upper to its lower limit, the switching interval a ramp of its impulse."""
    begin = np.append(0.0, np.cumsum(mesh))[:-1]
    share = np.clip((switch - begin) / mesh, 0, 1)[:, None, None]
    ramp = (2 * share - 1) - (1 - np.abs(2 * share - 1)) * (2 * FRACTIONS[:, None] - 1)
    return np.where((share > 0) & (share < 1), ramp, 2 * share - 1) * np.ones((1, 25, 1))


@pytest.mark.parametrize("switch", [0.33, 0.5, 0.618])
def test_a_knot_lies_at_the_switch(switch):
    mesh = np.full(50, 0.02)
    lost = ErrorEstimate(np.zeros(50), np.zeros(50))
    found = at_switches(mesh, ByOrder(bang_bang(mesh, switch)), lost, 1e-4)
    assert found.sum() == pytest.approx(1.0, abs=1e-14)
    assert np.abs(np.cumsum(found) - switch).min() < 1e-3
    assert len(found) <= 52


def test_an_arc_is_divided_where_it_exceeds_its_limits():
    """Twice the aim to the square: in two, and only there."""
    mesh = np.full(50, 0.02)
    lost = ErrorEstimate(np.zeros(50), np.where(np.arange(50) < 10, 4e-4, 0.0))
    found = at_switches(mesh, ByOrder(bang_bang(mesh, 0.5)), lost, 1e-4)
    assert found[:19] == pytest.approx(0.01, rel=1e-6)
    assert found[20:] == pytest.approx(0.02, rel=1e-6)


@cache
def continued(scene, formulation, regularisation=None, meshes=3):
    """From 20 uniform intervals to two meshes with knots at switches: iterations of each, and
    the last duration, as planned and slowed until it is safe."""
    c = case(scene)
    equations = interpreted(FORMULATIONS[formulation](c.system))
    mesh, guess, iterations = np.full(20, 0.05), c.guess, []
    for options in (FAR, NEAR, NEAR)[:meshes]:
        problem = CollocationProblem(equations, PiecewiseAcceleration(), mesh)
        if regularisation is not None:
            problem = replace(problem, regularisation=regularisation)
        z, bounds = problem.pack(guess, c.task), problem.bounds(c.task)
        solution = problem.program(options).solve(z, *bounds, c.task.p)
        guess = independent(c, problem, problem.unpack(solution.z, c.task))
        lost = c.lost(guess, problem.multipliers(solution))
        mesh = at_switches(mesh, c.by_order(guess), lost, 1e-4)
        iterations.append(solution.iterations)
    duration = float(guess.knots[-1])
    return iterations, duration, duration * c.safe_factor(guess)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_every_formulation_converges_on_every_mesh(formulation):
    assert max(continued("five_bar", formulation)[0]) <= 40


def test_the_hardest_case_of_the_delta_converges_where_knots_are_at_switches():
    assert max(continued("long_diagonal", "explicit", meshes=2)[0]) <= 40


def test_formulations_under_one_rule_for_limits_agree():
    """Limits at the nodes: three formulations, one motion but for the error of the mesh."""
    own = [each for each in FORMULATIONS if each != "flat"]
    durations = [continued("five_bar", formulation)[1] for formulation in own]
    np.testing.assert_allclose(durations, durations[0], rtol=1e-4)


def test_regularisation_costs_next_to_nothing():
    """With knots at the switches the duration is that of the problem without it."""
    steady, free = (continued("five_bar", "multiplier", value)[1] for value in (None, 0.0))
    assert steady == pytest.approx(free, rel=3e-5)
