"""Features of scenes together: which pairs are planned and verified, and which are refused.

Those of compiled code that other tests share; docs/combinations.md has all pairs.
"""

from __future__ import annotations

import pytest

from deltaopt import Body, Effort, Plan, SceneError, load_scene, plan, verify
from deltaopt.limits.running_cost import Running
from deltaopt.motion.running_cost import running_cost
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.moving_ends import goal_in
from deltaopt.scene.scene import Scene
from studies.problems import PROBLEMS
from studies.triples.drawn import drawn
from tests.good_plans import good_plan

ROBOT = load_scene(PROBLEMS / "keep_out" / "wall_25_305_25.yaml").robot
PLAIN = {"payload": 1.0, "start": [0.85, -0.1525, 0.0], "goal": [0.85, 0.1525, 0.0]}
OVER = {"pick_and_place": {"height": 0.06, "blend": 0.05}}
END = {"height": 0.02, "radius": 0.005}
FEATURES: dict[str, dict] = {
    "bodies": {"keep_out": [{"box": {"from": [0.80, -0.02, -0.3], "to": [1.5, 0.05, 0.3]}}]},
    "via": {"via": [[0.79, 0.0, -0.03]]},
    "start state": {"start": {"at": [0.85, -0.1525, 0.0], "velocity": [-0.1, 0.3, 0.0]}},
    "goal state": {"goal": {"at": [0.85, 0.1525, 0.0], "velocity": [0.1, 0.3, 0.0]}},
    "belt": {"goal": {"at": [0.85, 0.1525, 0.0], "belt": [0.0, 0.0, 0.3]}},
    "approach": {"approach": {"start": END, "goal": END}},
    "path": {"path": OVER},
    "tube": {"path": OVER, "tube": 0.005},
    "effort": {"objective": "effort", "duration": 0.3},
    "time and effort": {"objective": {"time": 1, "effort": 0.002}},
    "rates": {"limits": {"torque_rate": 5000.0}},
    "rotation": {"rotation": {"angle": 3.0, "speed": 30.0, "acceleration": 400.0}},
}
SMALL = {
    "name": "small",
    "base_radius": 0.1534,
    "platform_radius": 0.0554,
    "upper_arm": {"length": 0.1786, "mass": 0.8241},
    "forearm": {"length": 0.4331, "mass": 0.1582},
    "platform": {"mass": 0.2922},
    "drive": {"torque": 3.1825, "speed": 12.6427627},
}
CELL = [
    {"box": {"from": [0.842, -1.0, 0.0], "to": [0.982, 1.0, 0.005]}},
    {"box": {"from": [0.842, -0.068, 0.182], "to": [0.982, 0.068, 0.185]}},
    {"box": {"from": [0.842, -0.068, 0.315], "to": [0.982, 0.068, 0.318]}},
    {"half_space": {"point": [0.882, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}},
]
"""A wall of 40 mm, two sides of a box as high, and what they stand on, with a part 30 mm high."""


def together(*names: str) -> Scene:
    content = PLAIN | {"robot": ROBOT}
    for name in names:
        content |= FEATURES[name]
    return Scene.model_validate(content)


@pytest.mark.parametrize("beside", ["via", "start state", "belt", "path", "rotation"])
def test_bodies_beside(beside):
    good_plan(together("bodies", beside), tolerance=1e-2)


def test_the_motion_to_a_belt_without_a_wall_led_aside_leads_to_the_plan_past_it():
    leaving = {"goal": {"at": [0.85, 0.1525, 0.0], "belt": [0.0, 0.8, 0.0]}}
    found = plan(Scene.model_validate(PLAIN | {"robot": ROBOT} | FEATURES["bodies"] | leaving))
    assert found.within_tolerance
    first = next(each for each in found.journal if str(each).startswith("the way"))
    assert first.duration == pytest.approx(found.duration, rel=3e-3)


@pytest.mark.parametrize(
    "others",
    [
        ("bodies", "belt"),
        ("via", "start state"),
        ("approach", "bodies"),
        ("rotation",),
    ],
    ids=" and ".join,
)
def test_rates_beside(others):
    """With an acceleration that is continuous where phases meet."""
    scene = together("rates", *others)
    found = plan(scene)
    verified = verify(scene, found.trajectory)
    assert verified.ok, verified.failures()
    assert found.gap <= 2e-3
    assert found.duration > plan(together(*others)).duration * (1 - 1e-9)


def test_least_effort_with_rates_costs_a_little_more():
    without, found = plan(together("effort")), good_plan(together("rates", "effort"))
    assert without.cost * (1 - 1e-3) < found.cost < 1.05 * without.cost


@pytest.mark.parametrize("cost", ["effort", "time and effort"])
@pytest.mark.parametrize("moving", [(), ("start state",)], ids=["at rest", "moving"])
def test_gaps_of_least_effort_with_rates_are_large_enough(moving, cost):
    """On the coarse meshes of a loose tolerance, whose torques leave an end slowly."""
    scene = together("rates", cost, *moving)
    roughly, nearly = plan(scene, tolerance=1e-2), plan(scene, tolerance=1e-4)
    assert roughly.within_tolerance
    assert roughly.cost <= nearly.cost * (1 + roughly.gap)
    assert nearly.gap <= 2e-4


def test_least_effort_meets_a_belt_past_bodies_when_the_duration_is_over():
    """Waiting for the belt, as in least time, would take another duration."""
    effort = {"objective": Effort(duration=0.22)}
    good_plan(drawn(77, 18).model_copy(update=effort), tolerance=1e-2)


MOVING = ("start state", "goal state", "belt")


@pytest.mark.parametrize("moving", MOVING)
def test_ways_past_bodies_where_an_end_moves(moving):
    found = plan(together("bodies", moving))
    best, *others = found.ways
    assert (best.name, best.duration) == ("above keep_out[0]", found.duration)
    assert all(way.duration > found.duration for way in others)


def test_a_belt_that_hardly_moves_past_bodies_is_a_fixed_goal():
    at_rest, scene = plan(together("bodies")), together("bodies")
    slow = {"at": list(scene.goal), "belt": [0.0, 0.0, 1e-4]}
    found = plan(scene.model_copy(update={"goal": goal_in(slow)}))
    assert found.duration == pytest.approx(at_rest.duration, rel=2e-3)
    assert found.ways[0].name == at_rest.ways[0].name


def test_a_belt_that_moves_behind_a_thin_wall_is_met():
    """From quintics between the ends, which lead through the wall, no mesh leads out of it."""
    wall = [{"box": {"from": [0.7177, -0.0264, -0.5], "to": [1.5, -0.0201, 0.5]}}]
    goal = {"at": [0.85, 0.1905, 0.0698], "belt": [-0.2319, -0.314, 0.798]}
    ends = {"start": [0.85, -0.1905, -0.0476], "goal": goal}
    scene = Scene.model_validate(PLAIN | {"robot": ROBOT, "keep_out": wall} | ends)
    good_plan(scene, tolerance=1e-2)


def test_neighbours_on_a_belt_over_a_wall_into_a_box_have_neighbouring_plans():
    """Taken from a belt, without ways one of these places led over the wall by a detour."""
    durations = []
    for y in (-0.1442, -0.1441, 0.1102):
        taken = {"start": {"at": [0.85, y, -0.12], "velocity": [0.0, 0.3, 0.0]}}
        content = PLAIN | {"goal": [0.85, 0.02, 0.25], "payload": 0.1} | taken
        found = plan(Scene.model_validate(content | {"robot": ROBOT, "keep_out": CELL}))
        assert found.within_tolerance
        assert len(found.ways) >= 1
        durations.append(found.duration)
    assert durations[0] == pytest.approx(durations[1], rel=2e-3)
    assert durations[2] == pytest.approx(durations[0], rel=0.05)


def test_a_shelf_that_an_approach_just_clears_changes_nothing():
    """The best motion without the shelf is clear of it, so it is the best one with it too."""
    end, level = {"height": 0.025, "radius": 0.005}, 0.85 - 0.026
    shelf = {"box": {"from": [level - 0.04, -0.1, -0.5], "to": [level, 0.1, 0.5]}}
    content = PLAIN | {"robot": ROBOT, "approach": {"start": end, "goal": end}}
    free = Scene.model_validate(content)
    beside = free.model_copy(update={"keep_out": (Body.model_validate(shelf),)})
    assert good_plan(beside).duration == good_plan(free).duration


def test_an_approach_past_a_narrow_wall_takes_no_longer_than_past_a_wide_one():
    """What is clear of the wide wall is clear of the narrow one."""
    end = {"height": 0.01786, "radius": 0.005358}

    def past_a_wall(half_width: float) -> Plan:
        corners = [0.35787, 0.016074, -half_width], [0.969575, 0.019646, half_width]
        content = {
            "robot": SMALL,
            "payload": 0.1461,
            "start": [0.433775, -0.1068771, 0.00893],
            "goal": [0.430203, 0.1068771, -0.01786],
            "approach": {"start": end, "goal": end},
            "keep_out": [{"box": dict(zip(("from", "to"), corners, strict=True))}],
        }
        return good_plan(Scene.model_validate(content))

    narrow, wide = past_a_wall(0.07144), past_a_wall(0.3572)
    assert narrow.duration <= (1 + narrow.gap) * wide.duration


@pytest.mark.parametrize("beside", ["via", "approach", "belt", "tube"])
def test_effort_beside(beside):
    """In a given time: kept, with less effort than the fastest motion needs, slowed, where that can
    be: a motion whose end moves cannot."""
    scene, fastest = together(beside, "effort"), plan(together(beside))
    found = good_plan(scene)
    assert found.duration == pytest.approx(0.3, rel=1e-12)
    if scene.task.is_at_rest:
        slowed = fastest.trajectory.slowed(0.3 / fastest.duration)
        assert found.cost < running_cost(problem_of(scene), slowed, Running.EFFORT)


@pytest.mark.parametrize(("pair", "times"), [(("via", "belt"), 3.0), (("bodies", "via"), 1.02)])
def test_effort_in_a_time_far_from_and_near_the_shortest(pair, times):
    """A belt is elsewhere after three times as long; and in 2 % more than the shortest time motors
    are still at their limits beside the body."""
    scene = together(*pair)
    duration = times * plan(scene).duration
    found = good_plan(scene.model_copy(update={"objective": Effort(duration=duration)}))
    assert found.duration == pytest.approx(duration, rel=1e-12)


@pytest.mark.parametrize(
    ("one", "other", "key"),
    [
        *((moving, "approach", "approach") for moving in MOVING),
        *((moving, "path", "path") for moving in MOVING),
        *((moving, "rotation", "rotation") for moving in MOVING),
        ("via", "approach", "approach"),
        ("via", "path", "via"),
        ("approach", "path", "approach"),
        ("path", "effort", "objective"),
    ],
)
def test_what_is_refused(one, other, key):
    with pytest.raises(SceneError) as refused:
        together(one, other)
    assert refused.value.key == key
