"""Belts that leave, come, or cannot be met: when the robot can be there, and what is said."""

from __future__ import annotations

import re

import numpy as np
import pytest

from deltaopt import (
    Belt,
    DeltaOptError,
    Infeasible,
    State,
    load_robot,
    load_scene,
    plan,
    verify,
)
from deltaopt.errors import if_possible
from deltaopt.motion.lower_bound import soonest
from deltaopt.planning.first_motions.belt import Meetings, not_found
from deltaopt.planning.loop import Loop
from deltaopt.robot.model import delta_model
from studies.bench.hard_moves import move
from studies.bench.statics import Statics
from tests.good_plans import good_plan

SCENE = load_scene("problems/moving/belt.yaml")
FASTEST = SCENE.robot.drive.speed


def towards(at, belt, **changed):
    return SCENE.model_copy(update={"goal": Belt(at=at, belt=belt), **changed})


def refusal(scene) -> str:
    with pytest.raises(Infeasible) as error:
        plan(scene)
    return str(error.value)


@pytest.mark.parametrize(
    ("at", "belt", "says"),
    [
        ((0.85, 3.0, 1.0), (0, 0, -1.0), "is never within 1.28 m of the base's centre"),
        ((2.0, 0.0, 0.0), (0, 0.5, 0), "is never within 1.28 m of the base's centre"),
        ((0.85, 0.05, 0.5), (0, 0, 1.0), "which it passes 0 to 0.456 s after the start, do the"),
        ((0.85, 0.05, 0.1), (0, 0, 5.0), "the speed of motor 3 is -10.26 rad/s, where at least"),
        (
            (0.85, 0.05, 1.0),
            (0, 0, -20.0),
            " places of its way within 1.28 m of the base's centre, which it",
        ),
        ((0.85, 0.05, 0.1), (0, 0, 100.0), "are position and speed within the limits; nearest"),
    ],
)
@pytest.mark.parametrize("via", [None, [(0.82, -0.02, 0.0)]])
def test_a_belt_that_cannot_be_met_ends_in_a_sentence_on_what_was_searched(at, belt, says, via):
    said = refusal(towards(at, belt, via=via))
    assert said.startswith("goal: ")
    assert says in said
    assert "Ipopt" not in said


def test_a_belt_that_leaves_too_soon_ends_in_a_sentence_on_when_it_can_be_met():
    """It is within reach for 76 ms, and 0.5 m away."""
    scene = towards((0.85, 0.2, 0.2), (0, 2.0, 0), start=(0.85, -0.2, -0.2))
    with pytest.raises(Infeasible, match=r"take 2\.85 times as long") as error:
        plan(scene.model_copy(update={"via": [(0.8, 0.0, 0.0)]}))
    said = str(error.value)
    assert "which positions and speeds allow from 0 to 0.0765 s after the start" in said
    assert "3 attempts were made, and none led to one that keeps all limits" in said
    assert isinstance(error.value.__cause__, DeltaOptError)


def test_no_way_past_a_wall_is_looked_for_to_a_belt_that_is_missed_without_it():
    """Each would be solved on several meshes in vain."""
    wall = {"box": {"from": [0.8, -0.05, -0.5], "to": [1.5, 0.0, 0.5]}}
    missed = towards((0.85, 0.2, 0.2), (0, 2.0, 0), start=(0.85, -0.2, -0.2), keep_out=[wall])
    lines = list[str]()
    with pytest.raises(Infeasible, match=r"take [\d.]+ times as long as the belt, or more"):
        plan(missed, progress=lines.append)
    assert lines
    assert not [line for line in lines if line.startswith("the way ")]


def test_a_state_that_is_not_reached_is_told_in_words_of_its_own():
    """And that it stands still, for who meant a belt; other errors stay as they are."""
    passed = load_scene("problems/moving/passed_state.yaml")
    assert not_found(passed, 1) == (
        "no motion was found that passes [0.85, 0.1, -0.05] m at [-0.3, 1, 0] m/s, a point that "
        "stands still; one attempt was made, and none led to one that keeps all limits"
    )
    assert not_found(load_scene("problems/moving/stop.yaml"), 2) == (
        "no motion was found; 2 attempts were made, and none led to one that keeps all limits"
    )
    assert "a point that stands still, passed in motion" in passed.task.description


def test_when_a_belt_can_be_met_is_what_the_kinematics_say():
    """By inverse kinematics at the belt's velocity: in reach, and no motor too fast."""
    rng, model = np.random.default_rng(7), delta_model(SCENE.robot, None)
    found = []
    for _ in range(5):
        at = (0.85, *rng.uniform(-0.4, 0.4, 2))
        belt = (0.0, *rng.uniform(-3.0, 3.0, 2))
        meetings = Meetings(towards(at, belt))
        for t, possible in zip(meetings.times, meetings.possible, strict=True):
            place = np.array(at) + t * np.array(belt)
            try:
                _, rates, _ = model.motion(place, np.array(belt), np.zeros(3))
                expected = np.abs(rates[3::3]).max() <= FASTEST
            except DeltaOptError:
                expected = False
            found.append((possible, expected))
        inside = np.linalg.norm(np.array(at) + meetings.times[:, None] * belt, axis=1)
        assert (inside <= meetings.near + 1e-9).all()
    possible, expected = np.array(found).T
    # Limits keep a margin of serial singularities besides, at the edge of the reach.
    assert not (possible & ~expected).any()
    assert (expected & ~possible).mean() < 0.02
    assert 0.1 < possible.mean() < 0.9


def test_a_belt_is_not_met_where_a_forearm_is_in_a_body():
    """By samples of their lines. Places were planned to where no motion can end, for minutes."""
    robot = load_robot("problems/robots/industrial_links.yaml")
    low, high = (0.782, -0.044, 0.003), (0.838, 0.014, 0.097)
    box = {"box": {"from": low, "to": high}}
    free = towards((0.924, -0.033, -0.06), (0.0, -0.396, 0.336), robot=robot, clearance=0.002)
    scene = free.model_copy(update={"keep_out": [box], "robot_keeps_clear": True})
    meetings = Meetings(scene)
    otherwise = (meetings.sizes[:, :-1] <= 1).all(axis=1)
    assert meetings.possible.sum() < otherwise.sum()
    places = np.array(free.goal.at) + meetings.times[:, None] * free.goal.belt
    begin, end = Statics(robot, 0.0).forearms(places).swapaxes(0, 2).swapaxes(1, 2)
    lines = begin + np.linspace(0.0, 1.0, 2001)[:, None, None, None] * (end - begin)
    away = np.linalg.norm(np.maximum(np.maximum(low - lines, lines - high), 0), axis=-1)
    clear = away.min(axis=(0, 2)) - robot.link_radius(1) - 0.002
    known = np.abs(clear) > 1e-5  # samples are 0.4 mm apart
    assert (meetings.possible == otherwise & (clear > 0))[known].all()
    assert meetings.possible.any()


def test_a_link_that_is_in_the_way_all_along_a_belt_is_named():
    """It was told as a limit of the clearance of links, after a plan past the body."""
    robot = load_robot("problems/robots/industrial_links.yaml")
    beside_the_arm = {"box": {"from": (0.115, 0.369, -0.063), "to": (0.36, 0.556, 0.143)}}
    start, far = (0.85, -0.2, 0.0), towards((0.86, 0.2, -0.3), (0.0, 0.0, 0.4))
    changed = {"robot": robot, "start": start, "keep_out": [beside_the_arm]}
    scene = far.model_copy(update={**changed, "robot_keeps_clear": True})
    assert "arm 1 is 42.53 mm too near to keep_out[0], a box" in refusal(scene)


@pytest.fixture(scope="module")
def coming():
    scene = towards((0.85, 0.05, 1.5), (0, 0, -1.0))
    return scene, plan(scene)


def test_a_belt_that_comes_is_waited_for(coming):
    """It is met nearly as soon as that is possible, at the edge of the reach."""
    scene, found = coming
    assert verify(scene, found.trajectory).failures() == []
    first = Meetings(scene).durations[0]
    assert found.duration == pytest.approx(first, rel=0.02)


def test_a_belt_that_comes_from_farther_is_met_as_much_later(coming):
    """At the same place, whatever the robot does until then."""
    _, found = coming
    for farther in (1.0, 3.5):
        away = towards((0.85, 0.05, 1.5 + farther), (0, 0, -1.0))
        later = plan(away)
        expected = found.duration + farther
        tolerance = found.gap * found.duration + later.gap * later.duration
        assert later.duration == pytest.approx(expected, abs=tolerance)


def test_through_a_via_point_to_a_belt_that_comes(coming):
    scene, found = coming
    own = scene.model_copy(update={"via": [{"at": (0.8, 0.0, 0.0), "within": 0.01}]})
    later = plan(own)
    assert verify(own, later.trajectory).failures() == []
    assert later.duration == pytest.approx(found.duration, rel=later.gap + found.gap)


@pytest.mark.parametrize(("seed", "number"), [(2, 371), (6, 373)])
def test_met_later_where_no_first_motion_leads_there(seed: int, number: int):
    """The first of these belts passes places that quintics leave the workspace to, the second is
    within reach at once, leaves it, and can be met when it is back; both are met no later than at
    any of some places to which the fastest motion takes no longer than the belt."""
    scene = move(seed, number).scene
    found = good_plan(scene)
    belt = scene.task.goal
    in_time = False
    for share in (0.9, 1.0, 1.1):
        passed = belt.at(share * found.duration, belt.position)
        state = State(at=passed.position, velocity=passed.velocity)
        try:
            takes = plan(scene.model_copy(update={"goal": state})).duration
        except DeltaOptError:
            continue
        assert (takes <= share * found.duration * (1 + 1e-3)) == (share >= 1)
        in_time |= share >= 1
    assert in_time


def test_told_how_nearly_a_belt_is_met():
    """By what the lower bound does not rule out: within reach for 76 ms, and 0.5 m away."""
    with pytest.raises(DeltaOptError) as error:
        plan(towards((0.85, 0.2, 0.2), (0, 2.0, 0), start=(0.85, -0.2, -0.2)))
    told = r"take (\S+) times as long as the belt, or more, (\S+) instead of (\S+) s"
    times, takes, there = map(float, re.search(told, str(error.value)).groups())
    assert 1.5 < times == pytest.approx(takes / there, rel=0.02)
    assert there <= 0.0765


def test_a_belt_that_no_motion_gets_to_in_time_is_refused_unsolved(monkeypatch):
    """The lower bound proves it of all places at which the belt can be met."""
    monkeypatch.delattr(Loop, "made")
    away = towards((0.85, 0.2, 0.2), (0, 2.5, 0), start=(0.85, -0.25, -0.25))
    said = refusal(away)
    assert "too late: positions and speeds allow to meet it from 0 to 0.0" in said
    least = float(re.search(r"takes less than (\S+) s", said).group(1))
    assert least >= Meetings(away).durations[-1]
    assert least == pytest.approx(soonest(away, away.goal.at), rel=0.2)


def test_out_of_reach_no_belt_is_met_though_no_limit_says_so():
    """By inverse kinematics, of a robot without a limit of speed."""
    drive = SCENE.robot.drive.model_copy(update={"speed": None})
    robot = SCENE.robot.model_copy(update={"drive": drive})
    scene = towards((0.85, 0.05, 0.0), (0, 0, 1.0), robot=robot)
    meetings, model = Meetings(scene), delta_model(robot, None)
    closes = [
        if_possible((DeltaOptError,), model.inverse_kinematics, np.array([[0.85, 0.05, t]]))
        is not None
        for t in meetings.times.tolist()
    ]
    assert meetings.possible.tolist() == closes
    assert 0.1 < np.mean(closes) < 0.9
