"""Gaps that plans tell, held against true ones."""

from __future__ import annotations

import pytest

import deltaopt
from deltaopt.scene.scene_file import load_scene
from studies.gap import campaign, truth_beside
from studies.problems import PICK_AND_PLACE


def test_plans_tell_no_less_than_the_truth(tmp_path):
    rows = campaign(tmp_path / "gap.csv", 5, 3, 100, (1e-2, 1e-3))
    assert [row.tolerance for row in rows] == 3 * [1e-2, 1e-3]
    for row in rows:
        assert 0 < row.true <= row.told <= row.tolerance
        assert row.truth_gap <= row.tolerance / 10
        assert not row.too_small
        assert not row.missed


def test_truth_is_the_optimum():
    """Of a scene whose optimum other methods find too (tests/planning/switching)."""
    scene = load_scene(PICK_AND_PLACE)
    truth = truth_beside(scene, deltaopt.plan(scene).trajectory, 1e-6)
    assert truth.resolved
    assert truth.duration == pytest.approx(0.140870097, rel=1e-8)
