"""Approach: straight up from the start and down to the goal, by phases, against other problems."""

from __future__ import annotations

import numpy as np
import pytest

import deltaopt
from deltaopt import SceneError, State, load_scene, plan, verify
from tests.good_plans import good_plan

SCENE = load_scene("problems/approach/25_305_25.yaml")
INDUSTRIAL = deltaopt.load_robot("problems/robots/industrial.yaml")
FREE = SCENE.model_copy(update={"approach": None})


@pytest.fixture(scope="module")
def found():
    return plan(SCENE)


@pytest.fixture(scope="module")
def free():
    return plan(FREE)


def approaching(height, radius, *, scene=SCENE, at_goal=None, **changed):
    start = {"height": height, "radius": radius}
    both = {"start": start, "goal": start if at_goal is None else at_goal}
    return scene.model_copy(update={"approach": both, **changed})


def outside(scene, trajectory, samples=40001):
    """The same distance as verification's, from samples alone, m."""
    t = np.linspace(trajectory.knots[0], trajectory.knots[-1], samples)
    x = trajectory(t).x
    ends = (scene.start, scene.goal)
    levels = [end[0] - own.height for end, own in zip(ends, _both(scene), strict=True)]
    up = np.flatnonzero(x[:, 0] <= levels[0])[0]
    down = np.flatnonzero(x[:, 0] <= levels[1])[-1]
    beyond = [
        np.linalg.norm((part - end)[:, 1:], axis=1).max() - own.radius
        for part, end, own in zip((x[:up], x[down + 1 :]), ends, _both(scene), strict=True)
    ]
    return max(*beyond, (x[up : down + 1, 0] - max(levels)).max())


def _both(scene):
    return scene.approach.start, scene.approach.goal


UNEVEN = approaching(
    0.02, 0.004, at_goal={"height": 0.04, "radius": 0.01}, goal=(0.80, 0.1525, 0.02)
)
OTHER_WAY = approaching(
    0.02, 0.004, at_goal={"height": 0.01, "radius": 0.01}, goal=(0.87, 0.1525, 0.02)
)


@pytest.mark.parametrize("scene", [SCENE, UNEVEN, OTHER_WAY])
def test_verified_and_by_samples(scene):
    own = plan(scene)
    checked = verify(scene, own.trajectory)
    assert checked.failures() == []
    assert checked.approach_distance <= 1e-9
    assert outside(scene, own.trajectory) <= 1e-9
    assert own.within_tolerance
    instants = np.cumsum(own.phases)[:-1]
    levels = [column.level for column in scene.columns]
    np.testing.assert_allclose(own.trajectory(instants).x[:, 0], levels, atol=1e-12)


def test_wide_cylinders_leave_the_fastest_motion_as_it_is(free):
    """That rises above both heights by itself."""
    wide = plan(approaching(0.025, 1.0))
    assert wide.duration == pytest.approx(free.duration, rel=wide.gap + free.gap)


def test_no_other_places_to_pass_the_heights_are_faster(found):
    """Through given points at both heights, by the problem for via points: through those found it
    takes as long, through others in the circles longer."""
    gates = found.trajectory(np.cumsum(found.phases)[:-1]).x

    def through(moved):
        return plan(FREE.model_copy(update={"via": tuple(map(tuple, (gates + moved).tolist()))}))

    same = through(np.zeros((2, 3)))
    assert same.duration == pytest.approx(found.duration, rel=same.gap + found.gap)
    for first, second in (((-0.003, 0), (0, 0)), ((0, 0), (0.003, 0)), ((-0.001, 0.004), (0, 0))):
        other = through(np.array([(0, *first), (0, *second)]))
        assert other.duration > found.duration / (1 + found.gap)


def narrow(radius):
    return plan(approaching(0.025, radius))


def test_motion_straight_up_is_the_limit_of_narrow_cylinders():
    """Timed on its straight ends by the path planner and between them from state to state. What a
    radius saves is in proportion to its root, as is how fast a motion can turn aside within it."""
    wider, narrower = narrow(1e-4), narrow(1e-5)

    def limit(of):
        return (10**0.5 * of(narrower) - of(wider)) / (10**0.5 - 1)

    def speeds(found):
        return found.trajectory(np.cumsum(found.phases)[:-1]).v[:, 0]

    up, down = (0.999 * limit(speeds)).tolist()  # nearly the most that a straight end allows
    above = [(column.level, column.y, column.z) for column in SCENE.columns]
    between = {
        "start": State(at=above[0], velocity=(up, 0.0, 0.0)),
        "goal": State(at=above[1], velocity=(down, 0.0, 0.0)),
    }
    parts = (
        {"goal": above[0], "path": {"speeds": (0.0, -up)}},
        between,
        {"start": above[1], "path": {"speeds": (down, 0.0)}},
    )
    timed = [plan(FREE.model_copy(update=part)) for part in parts]
    gap = sum(each.gap for each in (wider, narrower, *timed))
    together = sum(each.duration for each in timed)
    assert limit(lambda found: found.duration) == pytest.approx(together, rel=gap)


def test_a_rounded_path_takes_longer():
    """One that is straight up to the height, whatever the radius."""
    rounded = {"pick_and_place": {"height": 0.03, "blend": 0.005}}
    on_path = plan(FREE.model_copy(update={"path": rounded}))
    assert verify(approaching(0.025, 1e-4), on_path.trajectory).approach_distance <= 1e-9
    durations = [narrow(radius).duration for radius in (5e-3, 1e-3, 1e-4, 1e-5)]
    assert [*durations, on_path.duration] == sorted([*durations, on_path.duration])


def test_back_as_fast_as_forth(found):
    """Without friction, in the mirror image, and with the ends exchanged."""
    back = plan(SCENE.model_copy(update={"start": SCENE.goal, "goal": SCENE.start}))
    assert back.duration == pytest.approx(found.duration, rel=found.gap)
    uneven, start, goal = plan(UNEVEN), *_both(UNEVEN)
    turned = {
        "start": UNEVEN.goal,
        "goal": UNEVEN.start,
        "approach": {"start": goal, "goal": start},
    }
    other = plan(UNEVEN.model_copy(update=turned))
    assert other.duration == pytest.approx(uneven.duration, rel=uneven.gap + other.gap)


def test_verification_sees_what_is_outside(free):
    checked = verify(SCENE, free.trajectory)
    assert checked.approach_distance == pytest.approx(outside(SCENE, free.trajectory), rel=1e-3)
    assert any("outside the scene's approach" in each for each in checked.failures())
    low = verify(approaching(0.2, 1.0), free.trajectory)  # never so high
    highest = 0.85 - free.trajectory(np.linspace(0, free.duration, 20001)).x[:, 0].min()
    assert low.approach_distance == pytest.approx(0.2 - highest, abs=1e-6)


def test_saved_and_read_back(found, tmp_path):
    found.save(tmp_path, chart=False)
    assert deltaopt.load_plan(tmp_path).scene == SCENE


END = {"height": 0.025, "radius": 0.005}


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"approach": {"start": END}}, "approach.goal is missing"),
        ({"approach": {"start": END, "goal": {**END, "radius": 0}}}, "approach.goal.radius is 0"),
        ({"path": "line"}, "expected neither path nor via beside it"),
        ({"via": [(0.8, 0.0, 0.0)]}, "expected neither path nor via beside it"),
        ({"goal": State(at=SCENE.goal, velocity=(1, 0, 0))}, "expected start and goal at rest"),
    ],
)
def test_refused(given, says):
    keys = ("robot", "payload", "start", "goal", "approach")
    content = {key: getattr(SCENE, key) for key in keys}
    with pytest.raises(SceneError) as error:
        deltaopt.Scene(**content | given)
    assert says in str(error.value)


def test_settings_that_do_not_apply_are_refused():
    with pytest.raises(ValueError, match="formulation is forward"):
        plan(SCENE, formulation=deltaopt.forward)


def test_a_cylinder_of_a_micrometre():
    """Cubics are as far beyond it between points as these may be from the axis."""
    scene = approaching(0.025, 1e-6)
    own, wide = good_plan(scene), plan(approaching(0.025, 1e-4))
    assert outside(scene, own.trajectory) <= 1e-9
    assert wide.duration < own.duration < 1.02 * wide.duration


@pytest.mark.parametrize(
    ("goal", "height", "radius"),
    [((0.62, 0.2, -0.21), 0.126, 0.118), ((0.48, -0.52, 0.13), 0.115, 0.057)],
)
def test_a_top_that_is_within_reach_near_its_rim_alone(goal, height, radius):
    """Its middle is not, and these were refused as impossible."""
    ends = {"start": (0.85, -0.1, 0.0), "goal": goal, "robot": INDUSTRIAL, "payload": 1.0}
    at_goal = {"height": height, "radius": radius}
    good_plan(approaching(0.03, 0.02, at_goal=at_goal, **ends))
