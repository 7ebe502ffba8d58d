"""Every example runs, tells what it says it tells, and leaves its picture where asked."""

from __future__ import annotations

import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.py"))


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda script: script.stem)
def test_runs(script, tmp_path):
    picture = tmp_path / "picture.png"
    runpy.run_path(str(script))["main"](picture)
    assert picture.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert picture.stat().st_size > 10_000


def test_both_models_give_the_same_torques():
    example = runpy.run_path(str(EXAMPLES[1]))
    t, explicit, multiplier = example["torques"](example["setup"]())
    assert t[-1] == pytest.approx(0.5)
    assert np.abs(explicit - multiplier).max() < 1e-13 * np.abs(explicit).max()


def test_no_plan_without_verification(monkeypatch):
    """The first example ends with what is wrong when verification fails."""
    example = runpy.run_path(str(EXAMPLES[0]))
    plan = example["deltaopt"].plan(example["setup"]())
    too_fast = replace(plan, trajectory=plan.trajectory.slowed(0.99))
    monkeypatch.setattr(example["deltaopt"], "plan", lambda scene, progress: too_fast)
    with pytest.raises(SystemExit, match="exceeds its limit by"):
        example["solve"](example["setup"]())
