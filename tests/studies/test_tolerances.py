"""What a gap costs: gaps are within tolerances, and reports say what was found."""

from __future__ import annotations

from pathlib import Path

import pytest

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
