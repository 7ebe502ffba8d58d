"""Cycles: what legs that are passed, rest or follow paths make of dwells and periods."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from deltaopt import Cycle, Scene, SceneError, State, plan_cycle
from deltaopt.output.cycle_files import verified
from deltaopt.report.folders import Drawn, save_cycle
from tests.planning.test_cycles import HERE, INDUSTRIAL, THERE


def test_a_period_needs_a_place_to_wait_at():
    """The robot was to wait at a goal that it passes in motion."""
    passed = State(at=HERE, velocity=(0.0, 0.5, 0.5))
    around = ((passed, THERE), (THERE, passed))
    legs = [Scene(robot=INDUSTRIAL, start=start, goal=goal) for start, goal in around]
    with pytest.raises(SceneError, match=r"period is 1\.0; .*cycle\[1\]\.goal is passed in motion"):
        Cycle(legs=legs, period=1.0)
    waiting = Cycle(legs=legs, dwells=("free", 0.0), period=1.0)
    assert waiting.free_dwells == (0,)


def test_legs_on_paths_fill_a_period_by_their_speed_alone(tmp_path):
    """No prices are known of them, nor how near the least heat they are: they were refused for the
    heat of motors without a limit of it."""
    legs = [
        Scene(robot=INDUSTRIAL, start=a, goal=b, path="line")
        for a, b in ((HERE, THERE), (THERE, HERE))
    ]
    found = plan_cycle(Cycle(legs=legs, period=0.5))
    assert found.period == pytest.approx(0.5, rel=1e-12)
    fastest = plan_cycle(Cycle(legs=legs))
    waited = replace(fastest, dwells=(0.0, 0.5 - fastest.period))
    assert found.squares.sum() < 0.5 * waited.squares.sum()
    save_cycle(tmp_path, found, verified(found), 1000.0, Drawn(chart=False))
    record = json.loads((tmp_path / "cycle.json").read_text())
    assert (record["gap"], record["verification"]["ok"]) == (None, True)


@pytest.mark.parametrize("key", ["velocity", "belt"])
def test_what_moves_at_a_velocity_of_0_rests(key):
    """A dwell there was one on a belt, which was not verified, or one at a goal that is passed."""
    there = {"at": THERE, key: [0, 0, 0]}
    legs = [Scene(robot=INDUSTRIAL, start=a, goal=b) for a, b in ((HERE, there), (there, HERE))]
    assert legs[0].goal == legs[1].start == THERE
    assert verified(plan_cycle(Cycle(legs=legs, dwells=(0.05, 0.0)))).ok


def test_a_copy_is_read_as_a_scene_is():
    moving = State(at=THERE, velocity=(0.0, 0.5, 0.0))
    scene = Scene(robot=INDUSTRIAL, start=HERE, goal=moving)
    assert scene.model_copy(update={"goal": State(at=THERE)}).goal == THERE
