"""Multipliers of velocity and position limits on arcs: exact ones, and what a limit costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from deltaopt.planning.flat.constraint_rows import ConstraintRows
from deltaopt.planning.switching.arc_mesh import ArcMesh
from deltaopt.planning.switching.conditions import OptimalityConditions
from deltaopt.planning.switching.detection import detect_structure
from deltaopt.planning.switching.newton import solve_conditions
from deltaopt.planning.switching.residuals import state_multipliers
from tests.planned_scenes import random_move, resolved, scaling_of
from tests.planning.switching.test_exact_answers import LINES, UNEVEN, Line


@pytest.mark.parametrize("line", [line for line in LINES if line.v], ids=str)
def test_a_velocity_limit_has_its_exact_multiplier(line: Line):
    """T = d/v + v/u, so a share more of v saves d/v - v/u; in equal parts at all times at it."""
    motion, _ = line.on_mesh(UNEVEN, line.guess)
    arcs = detect_structure(UNEVEN, line.rows(motion))
    rows, mesh = ConstraintRows(line.equations), ArcMesh.of(arcs, 5)
    p = line.scaling.parameters
    conditions = OptimalityConditions(rows, arcs, mesh, line.scaling.at_goal, p)
    found = solve_conditions(conditions, motion, line.scaling).point
    (multiplier,) = state_multipliers(conditions, found)
    assert multiplier.order == 1
    assert multiplier.entry.motor == 0
    assert multiplier.active.sum() == conditions.mesh.parts[1]
    eta = multiplier.eta * line.scaling.time
    at_limit = line.d / line.v - line.v / line.u
    assert eta[0] == 0.0
    assert eta[-1] == pytest.approx(at_limit, rel=1e-6)
    inside = eta[1:-1].reshape(-1, 21)  # of equally long intervals
    begin = np.arange(len(inside))[:, None]
    share = (begin + np.linspace(0, 1, 21)) / len(inside)
    np.testing.assert_allclose(inside, at_limit * share, atol=1e-6 * at_limit)
    assert multiplier.falls.max() < 1e-6
    opposite = replace(found, entry=-found.entry, multipliers=-found.multipliers)
    (wrong,) = state_multipliers(conditions, opposite)
    assert wrong.has_wrong_sign.any()
    assert not multiplier.has_wrong_sign.any()
    assert wrong.falls.max() == pytest.approx(at_limit / line.duration, rel=1e-5)


MARGIN = 11
"""Place of the least distance to the serial singularity among the parameters of the rows: after
start, length, time, unit of torque, and the torque limits."""


@pytest.mark.parametrize("number", [7, 43])
def test_the_multiplier_of_a_position_limit_is_what_a_tighter_one_costs(number):
    """By solving again."""
    scene = random_move("orsino", number)
    found, scaling = resolved(scene), scaling_of(scene)
    at_margin = found.conditions
    assert at_margin.structure.state(0).min() == -1  # at the lower side
    assert at_margin.structure.state(0).max() <= 0
    at = solve_conditions(at_margin, found.trajectory, scaling).point
    by = 1e-5 * at_margin.p[MARGIN]
    tighter = replace(at_margin, p=at_margin.p + by * np.eye(len(at_margin.p))[MARGIN])
    slower = solve_conditions(tighter, found.trajectory, scaling).point
    cost = (slower.duration - at.duration) / by
    assert cost > 1e-2
    multipliers = [each.eta for each in state_multipliers(at_margin, at)]
    assert sum(eta[-1] for eta in multipliers) == pytest.approx(cost, rel=1e-3)
    for eta in multipliers:  # it pushes all along, not only where it begins
        assert np.diff(eta).min() > -1e-9
        assert 0 < eta[1] < 0.5 * eta[-1]
        assert eta[-2] - eta[1] > 0.1 * eta[-1]
