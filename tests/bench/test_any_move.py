"""Random moves: planned, verified, counted, and named where one fails."""

from __future__ import annotations

from pathlib import Path

import pytest

from deltaopt.bench.any_move import random_plans
from deltaopt.cli import main
from deltaopt.errors import NotConverged
from deltaopt.planning.planner import Planner
from deltaopt.robot.robot import load_robot

PROBLEMS = Path(__file__).parents[2] / "problems"
ORSINO, INDUSTRIAL = (
    load_robot(PROBLEMS / f"robots/{name}.yaml") for name in ("orsino", "industrial")
)


@pytest.mark.parametrize(
    ("robot", "seed"), [(ORSINO, 1), (INDUSTRIAL, 1)], ids=["orsino", "industrial"]
)
def test_random_moves(robot, seed):
    told = []
    outcomes = random_plans(Planner(robot, 1.0), 12, seed, told.append)
    assert [outcome.failures for outcome in outcomes] == 12 * [()]
    assert told == list(range(1, 13))


@pytest.mark.parametrize("word", ["any", "random"])
def test_bench_any(word, capsys):
    robot = str(PROBLEMS / "robots/orsino.yaml")
    assert main(["bench", word, robot, "--number", "1", "--seed", "3"]) == 0
    assert "1 of 1 solved and verified" in capsys.readouterr().out


def test_bench_any_names_what_failed(capsys, monkeypatch):
    def failing(*_):
        raise NotConverged("no luck", "Maximum_Iterations_Exceeded", None)

    monkeypatch.setattr(Planner, "plan", failing)
    robot = str(PROBLEMS / "robots/orsino.yaml")
    assert main(["bench", "any", robot, "--number", "2"]) == 1
    out = capsys.readouterr().out
    assert "0 of 2 solved and verified" in out
    assert out.count(": no luck\n") == 2


def test_random_moves_by_switch_resolution(capsys):
    robot = str(PROBLEMS / "robots/orsino.yaml")
    assert main(["bench", "any", robot, "--number", "1", "--tolerance", "1e-6"]) == 0
    told = capsys.readouterr().out
    assert "planned 1, switches resolved 1, certified 1, verified 1" in told
    assert "1 planned on meshes alone too" in told
    assert "slower by more than both gaps tell in 0, by 0.0e+00 at most, and faster in 0" in told
