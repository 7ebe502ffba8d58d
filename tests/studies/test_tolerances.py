"""bench tolerances and bench random at fine tolerances."""

from __future__ import annotations

from pathlib import Path

import pytest

from deltaopt.cli import main
from deltaopt.scene.scene import load_scene
from studies.plots.tolerances import draw
from studies.tolerances import REFINED, SWITCHES, csv, table, tolerance_study

PROBLEMS = Path(__file__).parents[2] / "problems"


@pytest.fixture(scope="module")
def study():
    scene = load_scene(PROBLEMS / "pick_and_place.yaml")
    return tolerance_study(scene, tolerances=(1e-2, 1e-3, 1e-6), uniform=(10,))


def test_gaps_are_within_tolerances(study):
    assert [c.method for c in study.costs[1:]] == [REFINED, REFINED, REFINED, SWITCHES]
    assert all(0 <= study.gap(c) <= c.tolerance for c in study.costs[1:])
    assert study.gap(study.costs[0]) > 1e-3


def test_reports(study, tmp_path):
    assert len(csv({"one": study}).splitlines()) == 1 + len(study.costs)
    assert "against 0.140870" in table("one", study)
    draw({"one": study, "two": study, "three": study}, tmp_path / "chart.png")
    assert (tmp_path / "chart.png").read_bytes().startswith(b"\x89PNG")


def test_random_moves_by_switch_resolution(capsys):
    robot = str(PROBLEMS / "robots/orsino.yaml")
    assert main(["bench", "random", robot, "--number", "1", "--tolerance", "1e-6"]) == 0
    told = capsys.readouterr().out
    assert "planned 1, switches resolved 1, certified 1, verified 1" in told
    assert "1 planned on meshes alone too" in told
    assert "slower by more than both gaps tell in 0, by 0.0e+00 at most, and faster in 0" in told
