"""The crude planner that refusals are held against."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import Cycle, Scene, load_robot, verify
from studies.problems import PROBLEMS
from studies.triples.crude import crude_motion
from studies.triples.drawn import FEATURES, TRIPLES, drawn, triple_of

ROBOT = load_robot(PROBLEMS / "robots/industrial.yaml")
WALL = [{"box": {"from": [0.8, -0.01, -0.5], "to": [1.2, 0.01, 0.5]}}]
COLUMN = {"height": 0.06, "radius": 0.01}


@pytest.mark.parametrize(
    "keys",
    [
        {"via": [[0.85, -0.08, 0.03]]},
        {"goal": {"at": [0.85, 0.12, 0], "belt": [0, 0, 0.05]}},
        {"approach": {"start": COLUMN, "goal": COLUMN}},
    ],
)
def test_the_crude_planner_passes_a_wall(keys):
    ends = {"start": (0.85, -0.15, 0.0), "goal": (0.85, 0.15, 0.0)}
    scene = Scene(robot=ROBOT, payload=1.0, keep_out=WALL, **ends | keys)
    found = crude_motion(scene, np.random.default_rng(1))
    assert found is not None
    assert verify(scene, found).ok


def test_every_triple_is_drawn_once():
    drawn_ones = [triple_of(number) for number in range(len(TRIPLES))]
    assert sorted(drawn_ones) == sorted(TRIPLES)
    assert {feature for triple in TRIPLES for feature in triple} == set(FEATURES)


@pytest.mark.parametrize("number", range(4))
def test_scenes_ask_for_their_features(number):
    problem = drawn(1, number)
    assert isinstance(problem, Cycle if "cycle" in triple_of(number) else Scene)
    scene = problem.legs[0] if isinstance(problem, Cycle) else problem
    for feature, key in (("via", "via"), ("tube", "tube"), ("approach", "approach")):
        assert (getattr(scene, key) is not None) == (feature in triple_of(number))
    assert scene.moves_at_ends == bool({"belt", "state"} & {*triple_of(number)})
