"""The campaign: its moves, the independent check whether one is possible, and its files."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import load_scene, plan
from deltaopt.robot.model import delta_model
from studies.__main__ import main
from studies.bench import campaign as room
from studies.bench.campaign import Row, campaign, table, told, write_scene
from studies.bench.hard_moves import ROBOTS, move
from studies.bench.met_belts import of_belt
from studies.bench.possible import possibility
from studies.bench.statics import Statics
from studies.bench.strata import STRATA
from studies.kept_rows import read_rows


def test_moves_are_of_all_robots_and_strata_and_known_by_their_number():
    number = len(ROBOTS) * len(STRATA)
    assert len({(n % len(ROBOTS), n // len(ROBOTS)) for n in range(number)}) == number
    some = [move(1, n) for n in range(0, number, 23)]
    assert len({each.stratum for each in some}) == len(some)
    assert some[3] == move(1, 69)
    assert some[3].scene != move(2, 69).scene


@pytest.mark.parametrize("stratum", ["inside", "tilted gravity", "tool", "centres and pins"])
@pytest.mark.parametrize("number", range(len(ROBOTS)))
def test_statics_of_the_independent_check(stratum, number):
    """Virtual work by differences beside inverse dynamics at rest: two derivations."""
    scene = move(1, number + len(ROBOTS) * list(STRATA).index(stratum)).scene
    points, rest = np.array(scene.given_points), np.zeros((2, 3))
    model = delta_model(scene.robot, scene.payload)
    found = Statics(scene.robot, scene.payload or 0.0).at(points)
    size = 1e-8 * max(scene.robot.torque_limits)
    np.testing.assert_allclose(
        found.torques, model.inverse_dynamics(points, rest, rest), rtol=1e-7, atol=size
    )
    np.testing.assert_allclose(found.alignments, model.alignments(points), rtol=1e-9)
    q = model.inverse_kinematics(points)
    np.testing.assert_allclose(found.angles, q[:, 3::3], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(np.abs(found.sideways), np.abs(q[:, 5::3]), rtol=1e-9, atol=1e-12)


def test_a_move_is_possible_unless_the_motors_are_too_weak_between_its_ends(monkeypatch):
    monkeypatch.setattr("studies.bench.possible._STEPS", (12,))
    scene = move(1, 0).scene
    far = {"sphere": {"centre": [10.0, 0.0, 0.0], "radius": 1.0}}
    assert possibility(scene.model_copy(update={"keep_out": [far]})).found
    torque = tuple(1e-3 * t for t in scene.robot.torque_limits)
    weak = scene.robot.model_copy(
        update={"drive": scene.robot.drive.model_copy(update={"torque": torque})}
    )
    assert not possibility(scene.model_copy(update={"robot": weak})).found


@pytest.mark.parametrize("body", ["box", "sphere", "cylinder", "half_space"])
def test_a_move_is_not_possible_where_a_body_encloses_its_goal(monkeypatch, body):
    monkeypatch.setattr("studies.bench.possible._STEPS", (12,))
    scene = move(1, 0).scene
    goal = np.array(scene.goal)
    way = np.linalg.norm(goal - np.array(scene.start))
    bodies = {
        "box": {"from": (goal - way / 2).tolist(), "to": (goal + way / 2).tolist()},
        "sphere": {"centre": scene.goal, "radius": way / 2},
        "cylinder": {
            "from": (goal - way / 4).tolist(),
            "to": (goal + way / 4).tolist(),
            "radius": way / 2,
        },
        "half_space": {"point": ((goal + scene.start) / 2).tolist(), "normal": goal - scene.start},
    }
    assert not possibility(scene.model_copy(update={"keep_out": [{body: bodies[body]}]})).found


def test_a_given_path_is_possible_where_it_is_reachable_and_can_be_held():
    line = move(1, len(ROBOTS) * list(STRATA).index("line")).scene
    assert possibility(line).found
    x, y, z = line.start
    beyond = line.model_copy(update={"goal": (x + 5, y, z)})
    assert not possibility(beyond).found


def test_a_campaign_goes_on_where_it_ended(tmp_path, monkeypatch):
    seen = []
    rows = campaign(tmp_path, 3, 1, 1, 1e-3, seen.append)
    assert seen == [0, 1, 2, 3]
    assert read_rows(tmp_path / "moves_1_0.001.csv", Row) == rows
    assert not any(row.problem for row in rows)
    with (tmp_path / "moves_1_0.001.csv").open("a") as file:
        file.write("3,haptic,ins")
    monkeypatch.setattr(room, "row_of_number", None)  # nothing is planned again
    assert campaign(tmp_path, 3, 1, 1, 1e-3, seen.append) == rows
    assert (tmp_path / "moves_1_0.001.csv").read_text().count("\n") == 4
    assert "inside                     3     3       0        0           0" in table(rows)


@pytest.mark.parametrize("name", ["lifted", "corner", "sphere", "moving ends", "range of payloads"])
def test_a_scene_of_every_kind_is_read_as_it_was_written(tmp_path, name):
    each = move(1, len(ROBOTS) * list(STRATA).index(name))
    assert load_scene(write_scene(tmp_path, each, "why")) == each.scene


def test_a_failure_is_a_scene_that_can_be_planned(tmp_path):
    each = move(1, 2)
    file = write_scene(tmp_path, each, "why")
    assert file.read_text().startswith("# inside: why\n")
    scene = load_scene(file)
    assert plan(scene).duration == plan(each.scene).duration


def test_a_fault_of_the_program_is_a_failure(monkeypatch):
    def broken(scene, tolerance):
        raise ZeroDivisionError("in the program")

    monkeypatch.setattr(room, "plan", broken)
    row = room.row_of(move(1, 0), 1e-3)
    assert row.failed
    assert row.problem == "ZeroDivisionError: in the program"


def test_what_counts_as_a_failure():
    def row(duration, possible, problem, impossible=""):
        return Row(0, "", "inside", 0.1, duration, 0.0, 0.0, possible, problem, impossible)

    assert row(1.0, False, "torque").failed
    assert row(0.0, True, "NotConverged").failed
    assert row(0.0, False, "Unreachable").refused
    assert not row(1.0, False, "").failed
    none = row(0.0, False, "Unreachable", "no path")
    assert (none.is_impossible, none.refused, none.failed) == (True, False, False)
    assert told([none, row(1.0, False, "torque"), row(1.0, False, "")]) == [
        "  failed: move 0 (, inside): torque",
        "  impossible: move 0 (, inside): no path",
    ]


def test_an_approach_is_possible_unless_a_cylinder_leads_nowhere(monkeypatch):
    """A slab above the start leaves no way up, and none around it in the cylinder."""
    monkeypatch.setattr("studies.bench.possible._STEPS", (12,))
    free = move(1, len(ROBOTS) * list(STRATA).index("approach")).scene
    assert possibility(free).found
    x, y, z = free.start
    blocked = free.model_copy(
        update={
            "keep_out": [
                {"box": {"from": [x - 0.02, y - 1, z - 1], "to": [x - 0.01, y + 1, z + 1]}}
            ],
            "approach": {**free.approach.model_dump(), "start": {"height": 0.03, "radius": 0.01}},
        }
    )
    assert "out of the cylinder about the start" in possibility(blocked).against


def test_belts_that_can_be_met_and_others(monkeypatch):
    """One is never in reach slowly enough, one leaves too soon, and one is met; by the default
    solver instead of Ipopt, which takes ten times as long."""
    monkeypatch.setattr("studies.bench.met_belts._PLACES", 2)
    monkeypatch.setattr("studies.bench.met_belts.plan", lambda scene, solver: plan(scene))
    too_fast, leaving = (of_belt(move(3, number).scene) for number in (373, 377))
    assert "at none of 2000 places of the belt do the chains close" in too_fast.against
    assert "motions to 2 places there take 1.41 times as long" in leaving.against
    assert of_belt(load_scene("problems/moving/belt.yaml")).found


def test_the_command_takes_ten_thousand_moves(monkeypatch, tmp_path, capsys):
    asked = []

    def recorded(folder, number, *settings):
        asked.append(number)
        return []

    monkeypatch.setattr(room, "campaign", recorded)
    main(["bench", "any", "--number", "10000", "-o", str(tmp_path)])
    assert asked == [10_000]
    with pytest.raises(SystemExit):
        main(["bench", "any", "--number", "1000000"])
    assert "'1000000' is not a whole number from 1 to 999999" in capsys.readouterr().err
