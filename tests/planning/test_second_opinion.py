"""Other first motions beside the usual plan, for every kind of task."""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from deltaopt import Scene, load_robot, plan, verify
from deltaopt.cli import main
from deltaopt.errors import NotConverged
from deltaopt.planning.attempts import Outcomes
from deltaopt.planning.first_motions.multistart import other_motions
from deltaopt.planning.loop import Loop
from studies.problems import PROBLEMS

ROBOT = load_robot(PROBLEMS / "robots/industrial.yaml")
START, GOAL = (0.85, -0.15, 0.0), (0.85, 0.15, 0.0)
COLUMN = {"height": 0.02, "radius": 0.005}
WALL = [{"box": {"from": [0.8, -0.01, -0.3], "to": [1.2, 0.01, 0.3]}}]
TASKS = {
    "a via point": {"via": [[0.8, 0.02, 0.03]]},
    "a via point beside a wall": {"via": [[0.84, -0.08, 0.03]], "keep_out": WALL},
    "a state": {"start": {"at": START, "velocity": [0, 0, 0.5]}},
    "a belt": {"goal": {"at": [0.85, 0.12, 0], "belt": [0, 0, 0.3]}},
    "an approach": {"approach": {"start": COLUMN, "goal": COLUMN}},
    "a tube": {"path": "line", "tube": 0.005},
    "a wall": {"keep_out": WALL},
}


def scene_of(task: str) -> Scene:
    return Scene(robot=ROBOT, payload=1.0, **{"start": START, "goal": GOAL} | TASKS[task])


@pytest.mark.parametrize("task", ["a via point beside a wall", "a state", "an approach", "a tube"])
def test_starts_add_to_the_usual_plan(task):
    scene = scene_of(task)
    usual, found = plan(scene), plan(scene, starts=3)
    assert found.duration <= usual.duration
    assert found.gap <= 1e-3
    assert found.searched.startswith("2 more first motions were tried")
    saved = 1 - found.duration / usual.duration
    gained = re.search(r"the best is (\S+) % faster", found.searched)
    if gained:
        assert float(gained[1]) == pytest.approx(100 * saved, rel=0.06)
    else:
        assert "none is faster by more than the tolerance" in found.searched
        assert saved <= found.tolerance
    assert not usual.searched
    assert verify(scene, found.trajectory).ok


@pytest.mark.parametrize("task", ["a via point", "a belt", "an approach"])
def test_bent_motions_pass_the_same_points(task):
    scene = scene_of(task)
    known = plan(scene).trajectory
    motions = list(islice(other_motions(scene, known, 3, seed=2), 3))
    ends = known.position.at(known.knots[[0, -1]])
    for motion in motions:
        np.testing.assert_allclose(motion.position.at(motion.knots[[0, -1]]), ends, atol=1e-12)
        speeds = [each.position.derivative().at(each.knots[[0, -1]]) for each in (known, motion)]
        np.testing.assert_allclose(*speeds, atol=1e-9)
        for point in scene.task.via:
            away = motion.position.at(motion.knots) - point.position
            assert np.linalg.norm(away, axis=1).min() < 1e-9
    assert len({motion.position.coefficients.tobytes() for motion in motions}) == 3


def test_others_are_looked_at_where_the_usual_ones_lead_to_no_plan(monkeypatch):
    def none(*_):
        raise NotConverged("none", "No_Start", None)

    monkeypatch.setattr(Loop, "by_merit", none)
    scene = Scene(robot=ROBOT, payload=1.0, start=START, goal=GOAL)
    found = plan(scene, starts=2)
    assert found.gap <= 1e-3
    assert "the usual ones led to no plan, 1 of these did" in found.searched
    with pytest.raises(NotConverged):
        plan(scene)


def test_a_longer_plan_near_its_optimum_says_nothing_of_the_best_one(picked):
    slower = replace(picked, trajectory=picked.trajectory.slowed(1.4), gap=5e-4)
    so_far = Outcomes(picked.scene, enough=1e-3)
    so_far.add(slower)
    assert so_far.is_good
    so_far.add(replace(picked, gap=0.02))
    assert not so_far.is_good
    assert not so_far.is_near
    so_far.add(replace(picked, trajectory=picked.trajectory.slowed(1.0001), gap=5e-4))
    assert so_far.is_good  # hardly longer than the best


def test_a_refusal_in_a_tube_names_the_body():
    tube = TASKS["a tube"] | {"keep_out": WALL}
    scene = Scene(robot=ROBOT, payload=1.0, start=START, goal=GOAL, **tube)
    with pytest.raises(NotConverged, match=r"tool overlaps keep_out\[0\], a box, by 10 mm"):
        plan(scene)


def test_a_budget_of_seconds(tmp_path, capsys):
    file = str(PROBLEMS / "keep_out/wall_25_305_25.yaml")
    arguments = ["--exhaustive", "0.2", "--tolerance", "1e-2", "--no-plot"]
    assert main(["plan", file, *arguments, "-o", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "any others were not looked at" in told
    assert "no motion takes less" in told.lower() or "lower bound" in told.lower()


def test_a_budget_is_a_positive_number():
    with pytest.raises(ValueError, match="exhaustive is 0; it must be greater than 0"):
        plan(scene_of("a wall"), exhaustive=0)
    with pytest.raises(ValueError, match=r"exhaustive is 1\.0; it has no effect"):
        plan(Scene(robot=ROBOT, start=START, goal=GOAL, path="line"), exhaustive=1.0)
