"""Random moves: planned, verified, counted, and named where one fails."""

from __future__ import annotations

import numpy as np

from deltaopt.planning.planner import Planner
from deltaopt.robot.robot import load_robot
from studies.__main__ import main
from studies.bench.any_move import random_plans
from studies.bench.random_scenes import random_scenes
from studies.problems import PROBLEMS

ORSINO, INDUSTRIAL = (
    load_robot(PROBLEMS / f"robots/{name}.yaml") for name in ("orsino", "industrial")
)


def test_random_moves():
    told = []
    outcomes = random_plans(Planner(INDUSTRIAL, 1.0), 6, 1, told.append)
    assert [outcome.failures for outcome in outcomes] == 6 * [()]
    assert told == list(range(1, 7))


def test_a_payload_that_no_motor_can_hold(capsys):
    robot = str(PROBLEMS / "robots/orsino.yaml")
    assert main(["bench", "any", robot, "--payload", "100"]) == 1
    told = capsys.readouterr().err
    assert "none of 500 random moves in a row, and of as many points after them, is" in told
    assert "possible; of the last, start: at rest" in told


def test_moves_of_a_robot_that_can_be_in_a_tenth_of_its_workspace(monkeypatch):
    """One pair of points in a hundred is possible; a hundred in a row that are not end nothing."""
    monkeypatch.setattr("studies.bench.random_scenes._MOST_MOVES", 100)
    robot = load_robot(PROBLEMS / "robots/industrial_limited.yaml")
    moves = list(random_scenes(robot, None, 40, seed=1))
    assert len(moves) == 40
    (depth, most), radius = robot.workspace.depth, robot.workspace.radius
    for x, y, z in (point for each in moves for point in each.given_points):
        assert depth <= x <= most
        assert np.hypot(y, z) <= radius
