"""Sensitivities: held against dimensions, plans of changed scenes, and a scene with a kink."""

from __future__ import annotations

import json
from math import log

import pytest

import deltaopt
from deltaopt.cli import main
from deltaopt.sensitivity.keys import changed, content_of, job_of

DIMENSIONS = {
    "": (0, 0, 0),
    "m": (1, 0, 0),
    "kg": (0, 1, 0),
    "s": (0, 0, 1),
    "rad": (0, 0, 0),
    "rad/s": (0, 0, -1),
    "m/s": (1, 0, -1),
    "m/s^2": (1, 0, -2),
    "m/s^3": (1, 0, -3),
    "rad/s^3": (0, 0, -3),
    "N*m": (2, 1, -2),
    "N*m/s": (2, 1, -3),
    "N*m*s/rad": (2, 1, -1),
    "kg*m^2": (2, 1, 0),
}
"""Powers of length, mass and time."""


def shipped(name):
    kind = deltaopt.load_cycle if name.startswith("cycles") else deltaopt.load_scene
    return kind(f"problems/{name}.yaml")


def planned(job, tolerance=1e-3):
    kind = deltaopt.plan_cycle if isinstance(job, deltaopt.Cycle) else deltaopt.plan
    return kind(job, tolerance=tolerance)


@pytest.mark.parametrize(
    "name",
    [
        "hornet/1_kg",
        "payload/range",
        "via/onto_a_belt",
        "approach/25_305_25",
        "keep_out/into_a_box",
        "paths/tube",
        "limits/smooth",
        "industrial_drive",
        "cycles/there_and_back",
    ],
)
def test_units_do_not_matter(name, monkeypatch):
    """Whatever the units of length, mass and time are, the robot is as fast: a duration is a
    homogeneous function of all numbers of its files (Euler's theorem), on a coarse mesh too."""
    monkeypatch.setattr("deltaopt.sensitivity.priced_motion._INTERVALS", 120)
    found = planned(shipped(name)).sensitivity()
    sums = [
        sum(one.exponent * DIMENSIONS[one.number.unit][k] for one in found if one.number.value)
        for k in range(3)
    ]
    assert sums == pytest.approx([0, 0, 1], abs=1e-3 if "cycles" in name else 1e-4)
    assert max(abs(one.exponent) for one in found) > 0.1


@pytest.mark.parametrize(
    ("key", "about"),
    [("robot.forearm.length", -0.2), ("robot.drive.torque", -0.55), ("goal[1]", 0.3)],
)
def test_plans_of_changed_scenes_take_as_long_as_told(key, about):
    """Where switches are resolved; and from the default tolerance within the error told."""
    scene = shipped("pick_and_place").model_copy(update={"limits": None})
    fine, usual = (
        next(one for one in planned(scene, tolerance).sensitivity() if one.number.key == key)
        for tolerance in (1e-9, 1e-3)
    )
    of, step = fine.number, 1e-3
    longer = [
        log(planned(job_of(changed(content_of(scene), {of.key: value})), 1e-9).duration)
        for value in (of.value * (1 - step), of.value * (1 + step))
    ]
    exponent = (longer[1] - longer[0]) / (2 * step)
    assert fine.exponent == pytest.approx(exponent, abs=1e-5)
    assert abs(usual.exponent - exponent) <= usual.error * of.value / usual.duration + 1e-6
    assert exponent == pytest.approx(about, abs=0.01)  # it is not nothing that is compared


def test_what_limits_only_from_there_on_is_told_for_both_sides():
    """A gear that may have as much as its motor gives: more of it alone saves nothing."""
    content = content_of(shipped("hornet/1_kg"))
    gear, motor = (content["robot"]["drive"][part] for part in ("gear", "motor"))
    gear["peak_torque"] = gear["ratio"] * gear["efficiency"] * motor["peak_torque"]
    found = {one.number.key: one for one in planned(job_of(content)).sensitivity()}
    one = found["robot.drive.gear.peak_torque"]
    assert one.is_one_sided
    assert one.above == pytest.approx(0, abs=1e-12)
    assert one.below < 0
    assert "72.5342 instead of 71.816 N*m: as long; 71.0978 instead of" in str(one)
    assert not found["payload"].is_one_sided
    assert found["robot.drive.motor.max_speed"].exponent == pytest.approx(0, abs=1e-6)


def test_prices_of_limits_and_sensitivities_are_the_same():
    """Both ways to read the multipliers, the first on the plan's own mesh."""
    found = planned(shipped("pick_and_place").model_copy(update={"limits": None}))
    by_key = {one.number.key: one.exponent for one in found.sensitivity()}
    of_motors = sum(each.exponent for each in found.sensitivities if each.limit == "torque")
    assert of_motors == pytest.approx(by_key["robot.drive.torque"], abs=5e-3)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("paths/glue_line", "path is .*; expected none, or a tube about it"),
        ("keep_out/wall_25_305_25", "keep_out has a sharp edge .*; expected a tool with a radius"),
        ("objectives/pick_and_place_gently", "objective is .*; expected time"),
    ],
)
def test_where_they_are_not_known(name, words):
    with pytest.raises(deltaopt.SceneError, match=words):
        planned(shipped(name), 1e-3).sensitivity()


def test_limits_that_all_legs_share_have_one_key():
    """Also where a leg has some of its own: a change of one changes it in all of them."""
    cycle = deltaopt.load_cycle("problems/cycles/there_and_back.yaml")
    of_all, of_one = {"torque": 35.0, "acceleration": 150.0}, {"platform_speed": 3.5}
    limits = {**of_all, **of_one, "acceleration": 120.0}, of_all
    legs = [leg.model_copy(update={"limits": x}) for leg, x in zip(cycle.legs, limits, strict=True)]
    content = content_of(cycle.model_copy(update={"legs": legs}))
    again = job_of(changed(content, {"limits.torque": 20.0}))
    assert [leg.given("torque") for leg in again.legs] == [20.0, 20.0]
    assert [leg.given("acceleration") for leg in again.legs] == [120.0, 150.0]
    assert [leg.given("platform_speed") for leg in again.legs] == [3.5, None]


@pytest.mark.parametrize("key", ["tube", "drive.torque"])
def test_a_key_of_no_number_is_refused(key):
    with pytest.raises(deltaopt.SceneError, match=f"{key} is no number that is given"):
        planned(shipped("pick_and_place"), 1e-3).sensitivity(["payload", key])


def test_told_by_the_command(tmp_path, capsys):
    command = [
        "plan",
        "problems/hornet/1_kg.yaml",
        "--sensitivity",
        "--no-plot",
        "-o",
        str(tmp_path),
    ]
    assert main(command) == 0
    told = capsys.readouterr().out
    assert "  robot.drive.gear.ratio: 21 instead of 20: 0.18 % longer\n" in told
    assert main([*command, "--json"]) == 0
    first = json.loads(capsys.readouterr().out)["sensitivity"][0]
    assert (first["key"], first["unit"]) == ("robot.drive.gear.peak_torque", "N*m")
    assert main([*command, "--baseline"]) == 2
    assert "--sensitivity is for a plan, which --baseline" in capsys.readouterr().err
