"""How long plans take: what is measured, and what is said of it."""

from __future__ import annotations

import numpy as np

from deltaopt.planning.planner import Planner
from deltaopt.robot.robot import load_robot
from studies.bench.plan_timing import timed_plans
from studies.problems import PROBLEMS

ROBOT = PROBLEMS / "robots/orsino.yaml"


def test_plans_are_timed_and_held_against_finer_ones():
    done = []
    first, second = timed_plans(
        Planner(load_robot(ROBOT), 1.0), 2, seed=1, references=1, progress=done.append
    )
    assert done == [1, 2, 3, 4]
    for timed in (first, second):
        assert timed.ok
        assert timed.gap <= 1e-3
    assert 0 < first.true_gap < 2e-3
    assert np.isnan(second.true_gap)
