"""Gaps that plans tell, held against true ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import deltaopt
from deltaopt.scene.scene import load_scene
from studies import gap
from studies.gap import Held, campaign, remarks, table, truth_beside
from studies.gap_moves import KINDS, STRATA, move
from studies.kept_rows import read_rows
from studies.problems import PICK_AND_PLACE

SEED, TOLERANCES = 5, (1e-2, 1e-3)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("gap") / "gap.csv"


@pytest.fixture(scope="module")
def rows(file):
    return campaign(file, SEED, 3, 100, TOLERANCES)


def test_plans_tell_no_less_than_the_truth(rows):
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


def test_a_campaign_goes_on_where_it_was_interrupted(file, rows, monkeypatch):
    text = file.read_text(encoding="utf-8")
    lines = text.splitlines(keepends=True)
    file.write_text("".join(lines[:-1]) + lines[-1][:20], encoding="utf-8")
    planned = []

    def held(each, tolerances):
        planned.append((each.number, tolerances))
        return [row for row in rows if row.move == each.number]

    monkeypatch.setattr(gap, "held_plans", held)
    assert campaign(file, SEED, 3, 100, TOLERANCES) == rows
    assert planned == [(2, TOLERANCES)]
    assert file.read_text(encoding="utf-8") == text
    assert campaign(file, SEED, 3, 100, TOLERANCES) == rows == read_rows(file, Held)
    assert len(planned) == 1


def test_what_is_too_small_and_what_is_missed_is_said():
    right = Held(0, "robot", "inside", 1.0, True, 1e-3, told=9e-4, true=6e-4)
    small, missed = replace(right, told=5e-4), replace(right, true=1.2e-3)
    refused = replace(right, told=float("nan"), true=float("nan"), failure="NotConverged: no")
    assert (right.too_small, right.missed) == (False, False)
    assert (small.too_small, small.missed) == (True, False)
    assert (missed.too_small, missed.missed) == (True, True)
    every = [right, right, small, missed, refused]
    told = table(every).splitlines()[1].split()
    assert told[:6] == ["1e-03", "4", "4", "1", "50.00%", "0.75"]
    worst, next_worst, last = remarks(every)
    assert "MISSED" in worst
    assert "told 5.00e-04, true 6.00e-04" in next_worst
    assert last == "1 refused or not converged, 0 without a truth"


def test_moves_are_known_by_seed_and_number():
    assert move(SEED, 7) == move(SEED, 7)
    assert move(SEED, 7).scene.start != move(SEED + 1, 7).scene.start
    moves = [move(SEED, i) for i in range(len(KINDS) * 4)]
    assert {each.stratum for each in moves} == set(STRATA)
    assert len({each.scene.robot.name for each in moves}) == len(KINDS) + 1
    assert all(np.isfinite(each.scene.goal).all() for each in moves)
