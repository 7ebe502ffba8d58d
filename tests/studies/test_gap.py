"""Estimated gaps against true ones."""

from __future__ import annotations

from deltaopt.scene.scene import load_scene
from studies.gap import gap_study, table
from studies.problems import PICK_AND_PLACE


def test_true_gap_is_about_the_estimated_one():
    done = []
    study = gap_study(load_scene(PICK_AND_PLACE), (1e-2, 3e-3), done.append)
    assert done == [1, 2]
    lines = table("pick_and_place", study).splitlines()
    assert lines[0] == "pick_and_place"
    assert " ".join(lines[1].split()) == "tolerance intervals iterations estimated gap true gap"
    tolerance, intervals, iterations, estimated, true = map(float, lines[2].split())
    assert tolerance == 1e-2
    assert intervals >= 10
    assert iterations >= 5
    assert 0 < true < 2 * estimated
