"""Motions through via points: against the motions between them, and laws."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import deltaopt
from deltaopt import SceneError, State, load_scene, plan, verify
from deltaopt.planning.comparisons import straight_lines

SCENE = load_scene("problems/via/three_points.yaml")
FREE = SCENE.model_copy(update={"via": None})


@pytest.fixture(scope="module")
def found():
    return plan(SCENE)


@pytest.fixture(scope="module")
def free():
    return plan(FREE)


def through(*points, scene=SCENE):
    return scene.model_copy(update={"via": points})


def test_verified(found):
    checked = verify(SCENE, found.trajectory)
    assert checked.failures() == []
    assert checked.via_distance <= 1e-9
    assert found.within_tolerance
    assert sum(found.phases) == pytest.approx(found.duration, rel=1e-12)
    instants = np.cumsum(found.phases)[:-1]
    np.testing.assert_allclose(found.trajectory(instants).x, SCENE.via, atol=1e-9)


@pytest.mark.parametrize("shares", [(0.5,), (0.3, 0.6), (0.1, 0.2, 0.9)])
def test_points_on_the_fastest_motion_leave_its_duration(free, shares):
    instants = np.array(shares) * free.duration
    points = [tuple(x) for x in free.trajectory(instants).x.tolist()]
    same = plan(through(*points))
    assert same.duration == pytest.approx(free.duration, rel=same.gap + free.gap)
    assert np.cumsum(same.phases)[:-1] == pytest.approx(instants, rel=0.01)


def test_its_parts_are_fastest_motions_of_their_own():
    """To and from the state in which the point is passed; with another velocity there both take
    longer together."""
    scene = through((0.80, 0.0, 0.06))
    whole = plan(scene)
    now = whole.trajectory(whole.phases[0])
    point, velocity = (tuple(each[0].tolist()) for each in (now.x, now.v))

    def in_two_parts(velocity):
        state = State(at=point, velocity=velocity)
        parts = [plan(FREE.model_copy(update={end: state})) for end in ("goal", "start")]
        return sum(each.duration for each in parts), max(each.gap for each in parts)

    duration, gap = in_two_parts(velocity)
    assert duration == pytest.approx(whole.duration, rel=whole.gap + gap)
    for change in ((0.0, -0.8, 0.0), (0.5, -0.5, 0.3), (0.0, -0.5, 0.5)):
        other, gap = in_two_parts(tuple(np.add(velocity, change).tolist()))
        assert other > whole.duration / (1 + whole.gap)


def test_back_as_fast_as_forth(found):
    """Without friction, through the points in reverse."""
    back = {"start": SCENE.goal, "goal": SCENE.start, "via": SCENE.via[::-1]}
    other = plan(SCENE.model_copy(update=back))
    assert other.duration == pytest.approx(found.duration, rel=found.gap + other.gap)
    assert other.phases[::-1] == pytest.approx(found.phases, rel=0.02)


def test_passing_takes_longer_than_not_and_less_than_stopping(found, free):
    places = [SCENE.start, *SCENE.via, SCENE.goal]
    stops = deltaopt.Planner(SCENE.robot, SCENE.payload).plan_many(list(pairwise(places)))
    assert free.duration < found.duration < sum(each.duration for each in stops)


def test_there_and_back_to_the_start():
    content = {key: getattr(SCENE, key) for key in ("robot", "payload", "start")}
    scene = deltaopt.Scene(**content, via=[(0.80, 0.0, 0.06)], goal=SCENE.start)
    round_trip = plan(scene)
    assert verify(scene, round_trip.trajectory).failures() == []
    assert round_trip.phases[0] == pytest.approx(round_trip.phases[1], rel=0.02)


def test_verification_sees_points_that_are_missed_or_passed_out_of_turn(found, free):
    missed = verify(SCENE, free.trajectory)
    nearest = [
        np.linalg.norm(free.trajectory(np.linspace(0, free.duration, 20001)).x - point, axis=1)
        for point in SCENE.via
    ]
    assert missed.via_distance == pytest.approx(max(each.min() for each in nearest), rel=1e-3)
    assert any("misses a via point by" in each for each in missed.failures())
    turned = through(*SCENE.via[::-1])
    assert verify(turned, found.trajectory).via_distance > 0.05


def test_a_limited_motion_with_a_payload_range():
    """Speed limits and both ends of the range are kept in all phases."""
    scene = SCENE.model_copy(update={"payload": (0.5, 1.5), "limits": {"speed": 4.0}})
    slow = plan(scene)
    assert verify(scene, slow.trajectory).failures() == []


def test_no_line_that_misses_the_points_is_compared_with_it():
    assert straight_lines(SCENE) == {}
    assert len(straight_lines(FREE)) == 2


def test_saved_and_read_back(found, tmp_path):
    found.save(tmp_path, chart=False)
    back = deltaopt.load_plan(tmp_path)
    assert back.scene == SCENE
    assert replace(found, trajectory=back.trajectory).phases == found.phases


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"via": [SCENE.start]}, "each other than the one before it"),
        ({"via": []}, "each other than the one before it"),
        ({"via": [(0.8, 0.0)]}, "via is [(0.8, 0.0)]; expected points"),
        ({"path": "line"}, "expected no path beside it"),
        ({"goal": State(at=SCENE.goal, velocity=(1, 0, 0))}, "expected start and goal at rest"),
        ({"objective": deltaopt.Effort(duration=1.0)}, "expected time, where there are via points"),
    ],
)
def test_refused(given, says):
    content = {key: getattr(SCENE, key) for key in ("robot", "payload", "start", "via", "goal")}
    with pytest.raises(SceneError) as error:
        deltaopt.Scene(**content | given)
    assert says in str(error.value)


def test_points_out_of_reach_are_refused():
    with pytest.raises(deltaopt.Unreachable, match="via 2: "):
        plan(through((0.82, 0, 0), (1.5, 0, 0)))


def test_settings_that_do_not_apply_are_refused():
    with pytest.raises(ValueError, match="starts is 2; it has no effect where there are via"):
        plan(SCENE, starts=2)
    with pytest.raises(ValueError, match="formulation is forward"):
        plan(SCENE, formulation=deltaopt.forward)
