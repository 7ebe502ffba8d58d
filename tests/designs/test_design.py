"""Designs: held against a gear ratio in closed form, one another, and every choice planned."""

from __future__ import annotations

import json
import re
from math import sqrt

import pytest

import deltaopt
from deltaopt.cli import main

ROBOT = """
name: arms alone
base_radius: 0.2
platform_radius: 0.05
upper_arm: {length: 0.3, mass: 0, inertia: 0.02}
forearm: {length: 0.8, mass: 0}
platform: {mass: 1.0e-6}
gravity: 0
drive:
  motor: {peak_torque: 3.82, inertia: 0.28 kg*cm^2}
  gear: {ratio: 20}
"""
"""With a motor of its own only the inertia of the arms is to be turned: 0.02 kg m²."""
RATIO = sqrt(0.02 / 0.28e-4)
MOTORS = """Model,Peak torque [N*m],Rotor inertia [kg*cm^2],Price [EUR]
small,1.91,0.14,100
large,3.82,0.28,200
huge,3.82,0.28,90000
"""
CATALOGUE = """
catalogues:
  - file: motors.csv
    name: Model
    price: Price [EUR]
    number: 3
    columns:
      robot.drive.motor.peak_torque: Peak torque [N*m]
      robot.drive.motor.inertia: Rotor inertia [kg*cm^2]
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "robot.yaml").write_text(ROBOT)
    for name, depth in (("near", 0.75), ("far", 0.85)):
        goal = f"robot: robot.yaml\nstart: [0.65, 0, 0]\ngoal: [{depth}, 0, 0]\n"
        (tmp_path / f"{name}.yaml").write_text(goal)
    (tmp_path / "motors.csv").write_text(MOTORS)
    return tmp_path


def written(folder, text):
    file = folder / "design.yaml"
    file.write_text(text)
    return file


GEAR = "change: [{key: robot.drive.gear.ratio, least: 8, most: 60}]\n"


@pytest.mark.parametrize(("over", "derivatives"), [("worst", True), ("sum", False)])
def test_the_best_gear_is_that_of_equal_inertias(folder, over, derivatives):
    """T ~ √((J + n² Jm) / n) of a constant inertia J: n is the best where n² Jm = J."""
    file = written(folder, f"scenes: [near.yaml, far.yaml]\nover: {over}\n{GEAR}")
    found = deltaopt.design(file, derivatives=derivatives)
    assert found.best.values == pytest.approx([RATIO], rel=2e-3)
    durations = found.best.durations
    assert found.best.value == pytest.approx(sum(durations) if over == "sum" else durations[1])
    assert found.evaluations < (12 if derivatives else 40)


def test_a_change_by_a_factor_is_one_without_known_derivatives(folder):
    factor = GEAR.replace("ratio, least: 8, most: 60", "ratio times, least: 0.4, most: 3")
    found = deltaopt.design(written(folder, f"scenes: [near.yaml]\n{factor}"))
    assert found.best.values == pytest.approx([RATIO / 20], rel=2e-3)


def test_a_scene_without_known_sensitivities_is_designed_without_derivatives(folder):
    """Of arms alone the line that is given is the way of the fastest motion."""
    with (folder / "far.yaml").open("a") as scene:
        scene.write("path: line\n")
    file = written(folder, f"scenes: [far.yaml]\n{GEAR}")
    found, without = (deltaopt.design(file, derivatives=each, tolerance=1e-3) for each in (1, 0))
    assert found.best == without.best
    assert found.best.values == pytest.approx([RATIO], rel=2e-2)


def test_what_a_gear_costs_and_what_a_scene_may_take(folder):
    """A price makes the ratio smaller, as far as the scene may take so long."""
    text = f"scenes: [far.yaml]\nlongest: 34 ms\n{GEAR.replace('most: 60', 'most: 60, price: 1')}"
    found = deltaopt.design(written(folder, text))
    assert found.best.durations == pytest.approx([0.034], rel=1e-4)
    assert found.best.durations[0] <= 0.034
    shares = [sqrt((0.02 + n * n * 0.28e-4) / n) for n in (found.best.values[0], RATIO)]
    fastest = deltaopt.design(written(folder, f"scenes: [far.yaml]\n{GEAR}")).best.durations[0]
    assert shares[0] / shares[1] == pytest.approx(0.034 / fastest, rel=1e-4)
    assert found.best.values[0] < RATIO


@pytest.mark.parametrize("how", ["", " times"])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_the_least_torque_that_will_do(folder, how, tolerance):
    """T ~ 1/√τ: at a share 1.15 of what the middle of the bounds takes it is τ / 1.15²."""
    unit, key = 3.82 if how else 1, f"robot.drive.motor.peak_torque{how}"
    least, most = 3 / unit, 9.5 / unit
    text = f"change: [{{key: {key}, least: {least}, most: {most}, price: 1}}]\n"
    text = f"scenes: [far.yaml]\nper_second: 0\n{text}"
    (folder / "robot.yaml").write_text(ROBOT.replace("3.82", "6.25"))
    scene = deltaopt.load_scene(folder / "far.yaml")
    longest = 1.15 * deltaopt.plan(scene, tolerance=1e-6).duration
    (folder / "robot.yaml").write_text(ROBOT)
    file = written(folder, f"{text}longest: {longest} s\n")
    for derivatives in (True, False):
        found = deltaopt.design(file, derivatives=derivatives, tolerance=tolerance).best
        assert found.durations[0] <= longest
        expected = 6.25 / unit / 1.15**2
        assert found.values == pytest.approx([expected], rel=max(3e-4, 5 * tolerance))


def test_a_search_begins_where_there_is_a_plan(folder):
    """Straight down arms reach √((0.3 + f)² - 0.15²): to 0.85 m with f > 0.563 m, above the middle
    of the bounds. No worse than any forearm of a scan."""
    change = "change:\n  - {key: robot.forearm.length, least: 0.2, most: 0.9}\n"
    for more in ("", "  - {key: robot.drive.gear.ratio, least: 8, most: 60}\n"):
        file = written(folder, f"scenes: [far.yaml]\n{change}{more}")
        found = deltaopt.design(file, tolerance=1e-3).best
        assert 0.563 < found.values[0] <= 0.9
        for length in (0.6, 0.7, 0.8, 0.9):
            other = ROBOT.replace("length: 0.8", f"length: {length}")
            (folder / "other.yaml").write_text(other)
            scene = (folder / "far.yaml").read_text().replace("robot.yaml", "other.yaml")
            (folder / "scene.yaml").write_text(scene)
            scanned = deltaopt.plan(deltaopt.load_scene(folder / "scene.yaml")).duration
            assert found.durations[0] <= 1.002 * scanned


def test_rows_of_a_catalogue(folder, capsys):
    """The best of all rows; those that cannot be better are not planned."""
    text = f"scenes: [near.yaml, far.yaml]\nper_second: 20000\n{CATALOGUE}"
    file = written(folder, text)
    assert main(["design", str(file), "--json", "-o", str(folder / "out")]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["evaluations"] == 1
    assert told["best"]["design"] == "large"
    durations = told["best"]["near [s]"] + told["best"]["far [s]"]
    assert told["best"]["value"] == pytest.approx(600 + 20000 * durations)
    best = deltaopt.load_robot(folder / "out" / "robot.yaml")
    assert best.drive.motor.peak_torque == 3.82
    assert len((folder / "out" / "designs.csv").read_text().splitlines()) == 2
    assert main(["design", str(file), "-o", str(folder / "out")]) == 0
    assert "2 choices passed over, which cannot be better" in capsys.readouterr().out


def test_a_row_that_cannot_reach_the_ends_is_discarded(folder):
    """Its lower bound is not known, and it has no plan; that of the other row is the best."""
    (folder / "arms.csv").write_text("Model,Length [mm]\nshort,20\nmid,300\n")
    columns = "{robot.upper_arm.length: 'Length [mm]'}"
    text = f"catalogues: [{{file: arms.csv, name: Model, columns: {columns}}}]\n"
    found = deltaopt.design(written(folder, f"scenes: [far.yaml]\n{text}"), tolerance=1e-3)
    assert [each.choice.name for each in found.candidates] == ["mid"]


def test_numbers_of_a_catalogue_in_any_notation(folder):
    """T ~ √((J + n² Jm) / τ) of motors of τ = 0.955 and 3.82 N·m, Jm = 0.14 and 0.28 kg·cm²."""
    file = written(folder, f"scenes: [near.yaml]\n{CATALOGUE}")

    def duration(row):
        (folder / "motors.csv").write_text(f"{MOTORS.splitlines()[0]}\nmotor,{row},100\n")
        return deltaopt.design(file).best.durations[0]

    slow, fast = duration(".955,+.14"), duration("382e-2,.28")
    inertias = [0.02 + 20**2 * rotor for rotor in (0.14e-4, 0.28e-4)]
    assert slow / fast == pytest.approx(sqrt(inertias[0] / 0.955 / (inertias[1] / 3.82)), rel=1e-4)


@pytest.mark.parametrize("cell", ["", "-", "~3.82", "on request"])
def test_a_row_without_a_number_is_refused(folder, cell):
    """Ranked with the robot's own number it would be another motor."""
    (folder / "motors.csv").write_text(MOTORS.replace("3.82,0.28,200", f"{cell},0.28,200"))
    told = f"motors.csv has no number in column Peak torque [N*m], but {cell!r} in line 3; expected"
    with pytest.raises(deltaopt.SceneError, match=re.escape(told)):
        deltaopt.design(written(folder, f"scenes: [near.yaml]\n{CATALOGUE}"))


def test_both_files_or_none_and_no_robot_of_somebody(folder, capsys):
    file = written(folder, f"scenes: [far.yaml]\n{GEAR}")
    words = ["design", str(file), "--tolerance", "1e-3", "-o"]
    assert main([*words, str(folder)]) == 1
    assert "robot.yaml exists and is not overwritten" in capsys.readouterr().err
    assert (folder / "robot.yaml").read_text() == ROBOT
    assert main([*words, str(folder / "out")]) == 0
    (folder / "out" / "robot.yaml").unlink()
    (folder / "out" / "robot.yaml").mkdir()
    (folder / "out" / "designs.csv").write_text("old")
    assert main([*words, str(folder / "out")]) == 2
    assert (folder / "out" / "designs.csv").read_text() == "old"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "scenes: [far.yaml]\n" + GEAR.replace("}]", f"}}, {GEAR[GEAR.index('{') :].strip()}"),
            "robot.drive.gear.ratio is changed twice; expected one change of each key",
        ),
        ("scenes: [far.yaml]\nover: mean", "over is 'mean'; expected sum or worst"),
        (GEAR, "scenes is missing; expected a list of scene files"),
        (
            "scenes: [far.yaml]\n" + GEAR.replace("least: 8", "least: 80"),
            "change[0].most is 60.0; expected a number greater than 80",
        ),
        (
            "scenes: [far.yaml]\n" + GEAR.replace("robot.drive.gear.ratio", "times"),
            "times names no key to change; expected a key, such as payload, alone or before times",
        ),
        (
            "scenes: [far.yaml]\n" + GEAR.replace("robot.drive.gear.ratio", "'.'"),
            ". names no key to change",
        ),
        (
            "scenes: [far.yaml]\n" + GEAR.replace("ratio", "ratoi"),
            "robot.drive.gear.ratoi is not a known key",
        ),
        (
            "scenes: [far.yaml]\n" + GEAR.replace("drive.gear", "dirve.gear"),
            "robot.dirve is not a known key; expected drive, at the bounds of change",
        ),
        (
            "scenes: [far.yaml]\n" + GEAR.replace("least: 8", "least: -8"),
            "robot.drive.gear.ratio is -8.0; expected a number greater than 0",
        ),
        (
            "scenes: [far.yaml]\n" + CATALOGUE.replace("Rotor", "Motor"),
            "catalogues[0].file motors.csv has no column Motor inertia [kg*cm^2]",
        ),
    ],
)
def test_errors_are_one_sentence(folder, capsys, text, sentence):
    assert main(["design", str(written(folder, text)), "-o", str(folder / "out")]) == 2
    told = capsys.readouterr().err
    assert sentence in told
    assert told.startswith(f"deltaopt: {folder / 'design.yaml'}")
    assert told.count("\n") == 1
    assert not (folder / "out").exists()
