"""Prices of speed limits and of the fold's margin on arcs: exact ones, and what a limit costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.posed_scenes import machine_code, random_move, resolved, scales_of

from deltaopt.planning.flat.constraint_rows import Stage
from deltaopt.planning.planner import Planner
from deltaopt.planning.switching.arc_mesh import Grid
from deltaopt.planning.switching.conditions import Conditions
from deltaopt.planning.switching.detection import read_structure
from deltaopt.planning.switching.state_multipliers import pushes
from tests.planning.switching.test_exact_answers import LINES, UNEVEN, Line


@pytest.mark.parametrize("line", [line for line in LINES if line.v], ids=str)
def test_a_speed_limit_has_its_exact_price(line: Line):
    """T = d/v + v/u, so a share more of v saves d/v - v/u; in equal parts at all times at it."""
    motion, _ = line.on_mesh(UNEVEN, line.guess)
    arcs = read_structure(UNEVEN, *line.loads(motion))
    conditions = Conditions.of(
        Stage(line.equations), arcs, Grid.of(arcs, 5), line.scales, np.zeros(0)
    )
    found = conditions.solve(conditions.guess(motion, line.scales)).motion
    (push,) = pushes(conditions, found)
    assert push.entry.of_speed
    assert push.entry.motor == 0
    assert push.held.sum() == conditions.grid.parts[1]
    eta = push.price * line.scales.time
    at_limit = line.d / line.v - line.v / line.u
    assert eta[0] == 0.0
    assert eta[-1] == pytest.approx(at_limit, rel=1e-6)
    inside = eta[1:-1].reshape(-1, 21)  # of equally long intervals
    begin = np.arange(len(inside))[:, None]
    share = (begin + np.linspace(0, 1, 21)) / len(inside)
    np.testing.assert_allclose(inside, at_limit * share, atol=1e-6 * at_limit)
    assert push.falls.max() < 1e-6
    pulled = replace(found, entry=-found.entry, multipliers=-found.multipliers)
    (pulling,) = pushes(conditions, pulled)
    assert pulling.pulls.any()
    assert not push.pulls.any()
    assert pulling.falls.max() == pytest.approx(at_limit / line.duration, rel=1e-5)


MARGIN = 8
"""Among the stage's parameters: that of the fold, after start, D, time and torque limits."""


@pytest.mark.parametrize("number", [7, 43])
def test_the_price_of_a_margin_is_what_a_wider_one_costs(number):
    """By solving again."""
    scene = random_move("orsino", number)
    found, scales = resolved(scene), scales_of(scene)
    at_margin = found.conditions
    assert at_margin.structure.opening.any()
    at = at_margin.solve(at_margin.guess(found.trajectory, scales)).motion
    by = 1e-5 * at_margin.p[MARGIN]
    wider = replace(at_margin, p=at_margin.p + by * np.eye(len(at_margin.p))[MARGIN])
    slower = wider.solve(wider.guess(found.trajectory, scales)).motion
    cost = (slower.duration - at.duration) / by
    assert cost > 1e-2
    prices = [push.price for push in pushes(at_margin, at)]
    assert sum(eta[-1] for eta in prices) == pytest.approx(cost, rel=1e-3)
    for eta in prices:  # it pushes all along, not only where it begins
        assert np.diff(eta).min() > -1e-9
        assert 0 < eta[1] < 0.5 * eta[-1]
        assert eta[-2] - eta[1] > 0.1 * eta[-1]


@machine_code
def test_an_arc_at_the_margin_that_should_be_left_is_not_the_answer():
    """One structure of this move meets all other conditions and is slower by 1.4e-5 than what
    meshes find, which know of no structure."""
    scene = random_move("orsino", 34)
    planner = Planner(scene.robot, 1.0, tolerance=1e-6)
    found = planner.plan(scene.start, scene.goal)
    on_meshes = replace(planner, resolved_below=0.0).plan(scene.start, scene.goal)
    assert found.duration == pytest.approx(on_meshes.duration, rel=2e-6)
