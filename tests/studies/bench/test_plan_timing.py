"""How long plans take: what is measured, and what is said of it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from deltaopt.errors import NotConverged
from deltaopt.planning.planner import Planner
from deltaopt.robot.robot import load_robot
from studies.__main__ import main
from studies.bench.plan_timing import Timed, plan_report, timed_plans

ROBOT = Path(__file__).parents[3] / "problems/robots/orsino.yaml"
GOOD = Timed(2e-3, 1e-3, 5e-4, 1e-4, 6e-4, np.nan, True)


def test_parts_are_parts_of_the_whole():
    done = []
    first, second = timed_plans(
        Planner(load_robot(ROBOT), 1.0), 2, seed=1, references=1, progress=done.append
    )
    assert done == [1, 2, 3, 4]
    for timed in (first, second):
        assert timed.ok
        assert 0 < timed.evaluation + timed.algebra < timed.wall
        assert timed.gap <= 1e-3
    assert 0 < first.true_gap < 2e-3
    assert np.isnan(second.true_gap)


def test_a_plan_that_fails_is_timed_and_told(monkeypatch):
    def failing(*_):
        raise NotConverged("no luck", "Maximum_Iterations_Exceeded", None)

    monkeypatch.setattr(Planner, "plan", failing)
    (timed,) = timed_plans(
        Planner(load_robot(ROBOT), 1.0), 1, seed=1, references=0, progress=lambda done: None
    )
    assert not timed.ok
    assert timed.wall > 0
    assert "1 of 2 verified" in plan_report("robot", [GOOD, timed])


def test_report():
    lines = plan_report("robot", [GOOD, replace(GOOD, wall=4e-3, true_gap=7e-4)]).splitlines()
    assert lines[0] == "robot: 2 of 2 verified and within tolerance"
    assert "clock 3.00 / 3.98 ms" in lines[1]
    assert lines[-1].endswith("(1 moves): median 7.0e-04, largest 7.0e-04")


def test_command(capsys):
    assert main(["bench", "plan", str(ROBOT), "--number", "1"]) == 0
    assert "1 of 1 verified and within tolerance" in capsys.readouterr().out
