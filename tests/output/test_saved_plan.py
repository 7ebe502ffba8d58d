"""Plans that are read back are the plans that were saved."""

from __future__ import annotations

import json

import numpy as np
import pytest

import deltaopt
from deltaopt.output.saved_plan import UnreadablePlan
from studies.problems import PROBLEMS


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A plan and the folder it was saved to."""
    folder = tmp_path_factory.mktemp("plan")
    plan = deltaopt.plan(deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml"))
    plan.save(folder)
    return plan, folder


def test_to_the_last_bit(saved):
    plan, folder = saved
    for path in (folder, str(folder), folder / "plan.json"):
        again = deltaopt.load_plan(path)
        assert again.scene == plan.scene
        assert again.duration == plan.duration
        assert again.record["gap"] == plan.gap
        np.testing.assert_array_equal(again.trajectory.knots, plan.trajectory.knots)
        t = np.linspace(0, plan.duration, 101)
        for name in ("x", "v", "a", "theta", "tau"):
            mine, given = (getattr(p.trajectory(t), name) for p in (again, plan))
            np.testing.assert_array_equal(mine, given)
    assert deltaopt.verify(again.scene, again.trajectory).ok


def test_coordinates_of_their_own(tmp_path):
    """Motions whose loops may drift carry all twelve coordinates."""
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    closure = deltaopt.AccelerationLevel()
    drifting = deltaopt.Redundant(deltaopt.explicit, closure)
    plan = deltaopt.plan(scene, formulation=drifting, tolerance=1e-2)
    assert plan.trajectory.coordinates is not None
    plan.save(tmp_path)
    again = deltaopt.load_plan(tmp_path).trajectory.coordinates
    np.testing.assert_array_equal(again.coefficients, plan.trajectory.coordinates.coefficients)


def test_robot_with_all_terms(tmp_path):
    scene = deltaopt.load_scene(PROBLEMS / "industrial_drive.yaml")
    scene = scene.model_copy(update={"objective": deltaopt.Time()})
    drive = scene.robot.drive.model_copy(update={"friction": {"viscous": 0.3}})
    scene = scene.model_copy(update={"robot": scene.robot.model_copy(update={"drive": drive})})
    plan = deltaopt.plan(scene)
    plan.save(tmp_path)
    assert deltaopt.load_plan(tmp_path).scene == scene


BROKEN = {
    "no file": (lambda c: None, "no such file"),
    "no JSON": (lambda c: "{", "cannot be read"),
    "a list": (lambda c: "[1]", "no record of a plan"),
    "an older plan": (lambda c: json.dumps(c | {"motion": None}), "its motion cannot be used"),
    "no motion": (lambda c: json.dumps({k: c[k] for k in c if k != "motion"}), "has no 'motion'"),
    "another scene": (
        lambda c: json.dumps(c | {"scene": c["scene"] | {"start": [0, "x", 0]}}),
        "its scene cannot be used: start",
    ),
    "a knot too few": (
        lambda c: json.dumps(c | {"motion": c["motion"] | {"knots": c["motion"]["knots"][1:]}}),
        "do not fit",
    ),
    "text": (lambda c: json.dumps(c | {"motion": {"knots": ["a"], "position": []}}), "motion"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_plan_that_is_not_whole_is_one_sentence(saved, tmp_path, name):
    change, expected = BROKEN[name]
    text = change(json.loads((saved[1] / "plan.json").read_text(encoding="utf-8")))
    if text is not None:
        (tmp_path / "plan.json").write_text(text, encoding="utf-8")
    with pytest.raises(UnreadablePlan, match=expected) as error:
        deltaopt.load_plan(tmp_path)
    assert "\n" not in str(error.value)
    assert "plan.json" in str(error.value)
