"""What more of a limit would save: held against plans that are made with more of it."""

from __future__ import annotations

import json
import pickle
from html import unescape
from math import log

import numpy as np
import pytest

from deltaopt import Scene, load_scene, plan
from deltaopt.cli import main
from deltaopt.motion.active_limits import ActiveLimit
from deltaopt.motion.limit_sensitivity import LimitSensitivity, limits_in_words
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.way import Rotation

CASES = [
    ("pick_and_place", "torque", 1, "motor 2"),
    ("industrial_cross", "speed", 2, "motor 3"),
    ("limits/specific_force", "specific_force", None, "payload"),
    ("paths/safe_lane", "torque", 1, "motor 2"),
    ("paths/glue_line", "acceleration", None, "platform"),
]
MORE = 0.01
TOLERANCE = 1e-5
"""Of the plans with more and less of a limit, to which the difference of their durations is known;
plans told their sensitivities at the default tolerance, a hundred times as large."""


def shipped(name: str) -> Scene:
    return load_scene(f"problems/{name}.yaml")


def with_more(scene: Scene, key: str, motor: int | None, more: float) -> Scene:
    """With a limit raised by a share: the scene's, and the drive's where that would be less."""
    robot = scene.robot
    given = scene.limits.model_dump(exclude_none=True) if scene.limits else {}
    bounds = limits_of(scene).upper(key.replace("_", " "))
    bounds = bounds * np.where(np.arange(len(bounds)) == (motor or 0), 1 + more, 1)
    if motor is not None:
        values = tuple(bounds.tolist())
        at_arm = {"torque": robot.drive.torque, "speed": robot.drive.speed, key: values}
        unlike = {"motor": None, "gear": None, "brake": None}
        drive = robot.drive.model_copy(update={**at_arm, **unlike})
        robot = robot.model_copy(update={"drive": drive})
        given.pop(key, None)
    else:
        given[key] = float(bounds[0])
    return Scene(
        robot=robot,
        payload=scene.payload,
        start=scene.start,
        goal=scene.goal,
        limits=given or None,
        path=scene.path,
    )


@pytest.mark.parametrize(("name", "key", "motor", "subject"), CASES)
def test_plans_with_a_little_more_of_a_limit_are_that_much_faster(name, key, motor, subject):
    scene = shipped(name)
    told = {(each.limit, each.subject): each for each in plan(scene).sensitivities}
    less, more = (
        plan(with_more(scene, key, motor, by), tolerance=TOLERANCE).duration for by in (-MORE, MORE)
    )
    exponent = log(more / less) / log((1 + MORE) / (1 - MORE))
    found = told[key.replace("_", " "), subject].exponent
    assert found == pytest.approx(exponent, rel=0.03, abs=2e-3)
    assert exponent < -4e-3  # it is not nothing that is compared


@pytest.mark.parametrize("name", ["pick_and_place", "paths/safe_lane"])
def test_without_gravity_torques_count_by_the_root(name):
    """Inertia forces are as 1/T², so that T is as 1/√torque when all motors have more."""
    scene = shipped(name)
    light = scene.robot.model_copy(update={"gravity": 0.0})
    found = plan(scene.model_copy(update={"robot": light})).sensitivities
    assert {each.limit for each in found} == {"torque"}
    assert sum(each.exponent for each in found) == pytest.approx(-0.5, abs=1e-3)


def test_in_words():
    active = [
        ActiveLimit("torque", "motor 2", (), 0.43),
        ActiveLimit("speed", "motor 1", (), 0.004),
        ActiveLimit("arm angle", "motor 3", (), 0.1),
        ActiveLimit("ball joint angle", "chain 1", (), 0.004),
        ActiveLimit("platform speed", "platform", (), 0.1),
        ActiveLimit("specific force", "payload", (), 0.1),
    ]
    known = [
        LimitSensitivity("torque", "motor 2", -0.32),
        LimitSensitivity("speed", "motor 1", -0.1),
    ]
    assert limits_in_words(active, known) == [
        "motor 2's torque is at its limit 43 % of the time; 10 % more would save 3.0 %",
        "motor 1's speed is at its limit 0 % of the time; 10 % more would save 0.9 %",
        "motor 3's arm angle is at its limit 10 % of the time",
        "the platform speed is at its limit 10 % of the time",
        "the payload's specific force is at its limit 10 % of the time",
    ]


def test_what_a_fourth_axis_takes_is_not_saved():
    scene = shipped("pick_and_place")
    found = plan(scene)
    for share, told in ((0.99, 0.01), (1.2, None)):
        turning = {"angle": 1.0, "speed": 700.0, "acceleration": 4 / (share * found.duration) ** 2}
        rotation = Rotation(**turning)
        each = plan(scene.model_copy(update={"rotation": rotation})).sensitivities
        assert each[0].saved_by(0.1) == pytest.approx(told, abs=1e-6) if told else not each


def test_where_it_is_told(tmp_path, capsys):
    scene = "problems/industrial_cross.yaml"
    assert main(["plan", scene, "--no-plot", "--report", "--details", "-o", str(tmp_path)]) == 0
    sentence = "otor 1's torque is at its limit 99 % of the time; 10 % more would save 3.6 %"
    assert f"  m{sentence}\n" in capsys.readouterr().out
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert f"M{sentence}." in unescape(page)
    found = plan(load_scene(scene))
    told = json.loads((tmp_path / "plan.json").read_text(encoding="utf-8"))["active_limits"]
    exponents = {(each.limit, each.subject): each.exponent for each in found.sensitivities}
    reached = {(each["limit"], each["subject"]): each["exponent"] for each in told}
    assert reached.items() <= exponents.items()
    assert all(name in reached or abs(value) < 1e-4 for name, value in exponents.items())
    assert sum(each["share_of_time"] > 0.8 for each in told) == 3
    assert pickle.loads(pickle.dumps(found)).sensitivities == found.sensitivities


def test_where_it_is_not_known(tmp_path):
    scene = shipped("objectives/pick_and_place_gently")
    assert plan(scene, tolerance=1e-2).sensitivities == ()
    scene = "problems/pick_and_place.yaml"
    assert main(["plan", scene, "--baseline", "--no-plot", "-o", str(tmp_path)]) == 0
    told = json.loads((tmp_path / "plan.json").read_text(encoding="utf-8"))["active_limits"]
    assert told
    assert all(each["exponent"] is None for each in told)
