"""Via points whose spheres overlap, which a motion may pass in one place."""

from __future__ import annotations

import numpy as np
import pytest

import deltaopt
from deltaopt import Planner, Scene, plan, verify
from tests.good_plans import good_plan

INDUSTRIAL = deltaopt.load_robot("problems/robots/industrial.yaml")
MOVE = {"robot": INDUSTRIAL, "payload": 1.0, "start": (0.85, -0.15, 0.0), "goal": (0.85, 0.15, 0.0)}
SMALL, LARGE = 0.03, 0.045
PAIRS = {
    "both are touched where they meet": ((0.78, 0.0171, -0.0038), (0.7502, -0.037, 0.0164)),
    "one of them is enough": ((0.78, -0.0067, 0.036), (0.7967, -0.0047, 0.0116)),
    "one after the other": ((0.804, 0.0222, -0.0436), (0.78, 0.0442, -0.0383)),
}
BACKWARD = PAIRS["both are touched where they meet"]
WALL = {"box": {"from": (0.77, 0.03, -0.5), "to": (1.5, 0.04, 0.5)}}
FEATURES = {
    "wall": {"keep_out": [WALL], "payload": (0.2, 1.0)},
    "state": {"start": {"at": (0.85, -0.15, 0.0), "velocity": (0.2, 1.0, 0.0)}},
    "time and effort": {"objective": {"time": 1, "effort": 1e-4}},
}


def through(*via, **changes):
    return Scene.model_validate({**MOVE, **changes, "via": list(via)})


def spheres(pair):
    return [{"at": at, "within": r} for at, r in zip(pair, (SMALL, LARGE), strict=True)]


def in_both(pair, rng):
    """A place in both spheres, m."""
    (a, b), size = np.array(pair), np.array((SMALL, LARGE))
    while True:
        place = a + rng.uniform(-SMALL, SMALL, 3)
        if (np.linalg.norm(place - [a, b], axis=1) < size).all():
            return place.tolist()


def chain(within, number):
    """Points in a row, six about 45 mm apart."""
    u = np.linspace(0.0, 1.0, number + 2)[1:-1]
    bow, wave = np.sin(np.pi * u), np.sin(3 * np.pi * u)
    points = np.transpose([0.85 - 0.05 * bow, -0.15 + 0.3 * u, 0.06 * wave])
    return through(*({"at": each.tolist(), "within": within} for each in points))


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
def test_back_as_fast_as_forth(pair):
    """Without friction a motion that is driven back in time keeps all limits."""
    there = good_plan(through(*spheres(pair)))
    ends = {"start": MOVE["goal"], "goal": MOVE["start"]}
    back = good_plan(through(*spheres(pair)[::-1], **ends))
    assert there.duration == pytest.approx(back.duration, rel=1e-3)


@pytest.mark.parametrize("changes", FEATURES.values(), ids=FEATURES)
def test_no_dearer_than_through_a_place_in_both(changes):
    rng = np.random.default_rng(1)
    scene = through(*spheres(BACKWARD), **changes)
    found = good_plan(scene)
    for _ in range(3):
        place = plan(through(in_both(BACKWARD, rng), **changes))
        assert verify(scene, place.trajectory).ok
        assert found.cost < (1 + 1e-3) * place.cost


@pytest.mark.parametrize(("number", "narrow", "wide"), [(6, 0.03, 0.05), (24, 0.005, 0.02)])
def test_no_slower_in_wider_spheres(number, narrow, wide):
    found, slower = good_plan(chain(wide, number)), good_plan(chain(narrow, number))
    assert verify(found.scene, slower.trajectory).ok
    assert found.duration < slower.duration


def test_a_motion_under_way_is_finished_where_nothing_is_faster():
    """Shortly before the place in which it passes both."""
    scene = through(*spheres(BACKWARD))
    old = plan(scene)
    for share in (0.45, 0.5):
        begun = old.trajectory(share * old.duration)
        found = Planner(INDUSTRIAL).plan_scene(scene, start=begun)
        assert verify(found.scene, found.trajectory).ok
        assert found.duration < (1 + 1e-3) * (1 - share) * old.duration


def test_a_share_of_the_fastest_motions_duration_is_one_of_the_fastest_known():
    fastest = plan(through(*spheres(BACKWARD)))
    found = good_plan(through(*spheres(BACKWARD), objective=deltaopt.Effort(of_fastest=1.5)))
    assert found.duration == pytest.approx(1.5 * fastest.duration, rel=1e-3)
