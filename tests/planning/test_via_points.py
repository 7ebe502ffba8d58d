"""Motions through via points: against the motions between them, and laws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import deltaopt
from deltaopt import Belt, Infeasible, Robot, Scene, SceneError, State, load_scene, plan, verify
from deltaopt.verify.path_distance import off_via_points
from tests.good_plans import good_plan

SCENE = load_scene("problems/via/three_points.yaml")
FREE = SCENE.model_copy(update={"via": None})
BENT = (0.80, 0.0, 0.06)
PASSED, BELT = (load_scene(f"problems/moving/{name}.yaml") for name in ("passed_state", "belt"))


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


@pytest.mark.parametrize("shares", [(0.5,), (0.1, 0.2, 0.9)])
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
    point, velocity = (tuple(each.tolist()) for each in (now.x, now.v))

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
        ({"via": [(0.8, 0.0)]}, "via is [(0.8, 0.0)]; expected at most 100 points"),
        ({"path": "line"}, "expected no path beside it"),
        (
            {"start": State(at=SCENE.start, velocity=(1, 0, 0)), "goal": "anywhere"},
            "expected a goal that is a point, a state or on a belt beside it",
        ),
        ({"via": [{"at": BENT, "within": 0}]}, "via[0].within is 0; expected a length in m"),
        ({"via": [{"at": BENT, "wthin": 1}]}, "via[0].wthin is not a known key; expected within"),
        ({"via": [{"within": 1}]}, "via[0].at is missing"),
        ({"via": [{"at": BENT, "within": 0.2}]}, "holds all of the point before or after it"),
        (
            {"via": [{"at": BENT, "within": 0.004}, {"at": (0.8, 0.01, 0.06), "within": 0.02}]},
            "via[1].within is 0.02; expected less than 0.014 m",
        ),
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
    with pytest.raises(ValueError, match="formulation is forward"):
        plan(SCENE, formulation=deltaopt.forward)


# Within a sphere


@pytest.mark.parametrize("name", ["within", "onto_a_belt"])
def test_shipped_scenes_are_verified(name):
    good_plan(load_scene(f"problems/via/{name}.yaml"))


UNEQUAL = Robot(
    name="unequal motors",
    base_radius=0.15,
    platform_radius=0.1,
    upper_arm={"length": 0.3, "mass": 0.8},
    forearm={"length": 0.55, "mass": 0.3},
    platform={"mass": 0.4},
    drive={"torque": (12.0, 30.0, 20.0), "speed": 9.0},
)


def test_a_sphere_whose_centre_is_beyond_a_singularity():
    """Found by a campaign: nowhere on the way, but somewhere in the sphere, can the robot be."""
    inside = {"at": (0.1675271, 0.1105516, 0.2000016), "within": 0.0948637}
    scene = Scene(
        robot=UNEQUAL,
        start=(0.1462398, 0.3336443, 0.1892706),
        goal=(0.3441271, -0.3138207, 0.2521212),
        via=[inside, {"at": (0.1600691, -0.1209098, 0.2662515), "within": 0.0258461}],
    )
    centre = scene.model_copy(update={"via": [inside["at"]]})
    with pytest.raises(deltaopt.DeltaOptError):
        plan(centre)
    good_plan(scene, tolerance=1e-2)


def test_through_points_to_a_belt_that_only_legs_from_rest_to_rest_lead_to():
    """Found by a campaign: it was refused, for neither a spline nor stops along simple curves keep
    the limits. The robot rests at most at each point, so it is there in time."""
    points = [(0.433, -0.421, -0.019), (0.318, -0.192, 0.014), (0.251, -0.209, -0.194)]
    belt = Belt(at=(0.152, -0.116, -0.287), belt=(0.0, 0.063, 0.584))
    start = (0.408, -0.5, 0.158)
    scene = Scene(robot=UNEQUAL, payload=0.786, start=start, goal=belt, via=points)
    assert good_plan(scene).duration < 0.95


def near(within, centre=BENT, **settings):
    return plan(through({"at": centre, "within": within}), **settings)


def passing_place(found):
    """Where the phases of a motion through one via point meet, and its velocity there."""
    now = found.trajectory(found.phases[0])
    return now.x, now.v


def least_distance(found, point=BENT):
    """By samples alone."""
    t = np.linspace(0, found.duration, 40001)
    return np.linalg.norm(found.trajectory(t).x - point, axis=1).min()


@pytest.fixture(scope="module")
def sphere():
    return near(0.02, tolerance=1e-5)


def test_a_sphere_is_touched_and_verified():
    sphere = near(0.02)
    checked = verify(sphere.scene, sphere.trajectory)
    assert checked.failures() == []
    assert checked.via_distance <= 1e-15
    assert sphere.within_tolerance
    assert 0.02 * (1 - 1e-3) < least_distance(sphere) <= 0.02


def test_small_spheres_tend_to_the_point_in_proportion_to_the_radius():
    tolerance, radii = 1e-5, (1e-2, 1e-3, 1e-4)
    exact = plan(through(BENT), tolerance=tolerance)
    durations = [near(radius, tolerance=tolerance).duration for radius in radii]
    assert durations == sorted(durations)
    slopes = (exact.duration - np.array(durations)) / radii
    assert slopes[1] == pytest.approx(slopes[0], rel=0.05)
    assert slopes[2] == pytest.approx(slopes[1], rel=tolerance * exact.duration / 1e-4 / slopes[1])
    tiny = near(1e-7)
    assert tiny.duration == pytest.approx(exact.duration, rel=tiny.gap + exact.gap)
    assert verify(tiny.scene, tiny.trajectory).failures() == []


@pytest.mark.parametrize("within", [0.07])
def test_a_wide_sphere_leaves_the_fastest_motion_as_it_is(free, within):
    """That passes the centre at 60 mm."""
    assert least_distance(free) < within
    wide = near(within)
    assert wide.duration == pytest.approx(free.duration, rel=wide.gap + free.gap)


def exact_duration(place, tolerance=1e-5):
    return plan(through(tuple(place)), tolerance=tolerance).duration


def test_the_place_is_best_to_first_order(sphere):
    """Planned through points beside it, the duration changes along the radius alone; and the motion
    passes at a right angle to it, for otherwise it would come nearer."""
    x, v = passing_place(sphere)
    step = 2e-3 * np.eye(3)
    slope = np.array([exact_duration(x + d) - exact_duration(x - d) for d in step])
    radius = (x - BENT) / np.linalg.norm(x - BENT)
    assert slope @ radius < -0.999 * np.linalg.norm(slope)
    assert abs(radius @ v) < 0.01 * np.linalg.norm(v)


def test_points_and_spheres_in_turn():
    one, two, three = SCENE.via
    spheres = {"at": two, "within": 0.005}, {"at": three, "within": 1e-3}
    mixed, exact = plan(through(one, *spheres)), plan(SCENE)
    checked = verify(mixed.scene, mixed.trajectory)
    assert checked.failures() == []
    assert mixed.duration < exact.duration
    assert len(mixed.phases) == 4
    apart = np.abs(mixed.trajectory(np.cumsum(mixed.phases)[:-1]).x - SCENE.via)
    assert (np.linalg.norm(apart, axis=1) <= np.array([1e-9, 0.005, 1e-3])).all()


def test_verification_sees_spheres_that_are_missed_or_passed_out_of_turn():
    trajectory = near(0.02).trajectory
    away = np.linalg.norm(trajectory(np.linspace(0, trajectory.duration, 40001)).x - BENT, axis=1)
    missed = verify(through({"at": BENT, "within": 0.015}), trajectory)
    assert missed.via_distance == pytest.approx(away.min() - 0.015, rel=1e-4)
    assert any("misses a via point by" in each for each in missed.failures())
    # A place that the motion passes on its way into a wide sphere, before it is nearest.
    early = trajectory(0.4 * trajectory.duration).x.tolist()
    wide = {"at": BENT, "within": float(np.linalg.norm(np.subtract(early, BENT))) + 0.01}
    assert off_via_points(through(wide, tuple(early)).task, trajectory) < 1e-9
    narrow = {"at": BENT, "within": 0.0201}
    assert off_via_points(through(narrow, tuple(early)).task, trajectory) > 0.005


def test_points_that_were_passed_are_not_asked_for_again():
    """Whatever comes next of a scene, it takes no longer than what is left of its motion."""
    scene = through(SCENE.via[0], {"at": BENT, "within": 0.01})
    old, planner = plan(scene), deltaopt.Planner(SCENE.robot, payload=SCENE.payload)
    first, second = np.cumsum(old.phases)[:2]
    for t, ahead in ((0.9 * first, 2), (0.5 * (first + second), 1), (second + 1e-3, 0)):
        new = planner.plan_scene(scene, start=old.trajectory(t))
        assert len(new.scene.via or ()) == ahead
        assert verify(new.scene, new.trajectory).failures() == []
        assert new.duration <= (old.duration - t) * (1 + 1e-9)
    state = old.trajectory(second + 1e-3)
    alone = State(at=tuple(state.x.tolist()), velocity=tuple(state.v.tolist()))
    asked = plan(scene.model_copy(update={"start": alone}))  # nobody says what was passed
    assert len(asked.scene.via) == 2


def test_a_sphere_whose_centre_is_in_a_body():
    """A body about the centre, smaller than the sphere: the motion passes between both."""
    content = {"sphere": {"centre": BENT, "radius": 0.01}}
    scene = through({"at": BENT, "within": 0.02}).model_copy(update={"keep_out": [content]})
    found = plan(scene)
    assert verify(scene, found.trajectory).failures() == []
    covered = scene.model_copy(update={"keep_out": [{"sphere": {"centre": BENT, "radius": 0.03}}]})
    with pytest.raises(
        Infeasible, match=r"via 1: .* no possible place was found within 19.8 mm of it"
    ):
        plan(covered)


def test_a_sphere_of_which_a_cap_alone_is_clear_is_passed_there():
    """A half-space covers it but for a cap of 22 degrees to a side that is none of a cube's."""
    centre, inwards = np.array([0.82, 0.0, 0.04]), np.array([0.897123, -0.403705, -0.179425])
    side = {"point": (centre - 0.0275 * inwards).tolist(), "normal": inwards.tolist()}
    scene = SCENE.model_copy(
        update={
            "start": (0.8244, 0.1296, 0.049),
            "goal": (0.7259, -0.0892, 0.049),
            "via": [{"at": centre.tolist(), "within": 0.03}],
            "keep_out": [{"half_space": side}],
        }
    )
    assert verify(scene, plan(scene).trajectory).failures() == []


# With ends that move

MOVING = {"passed state": PASSED, "belt": BELT}


@pytest.fixture(scope="module", params=MOVING, ids=list(MOVING))
def underway(request):
    """A scene whose ends move, and its fastest motion without via points."""
    return MOVING[request.param], plan(MOVING[request.param])


def test_points_on_a_motion_with_moving_ends_leave_its_duration(underway):
    scene, free = underway
    places = free.trajectory(np.array([0.3, 0.7]) * free.duration).x.tolist()
    for via in ([tuple(places[0])], [tuple(places[0]), {"at": places[1], "within": 2e-3}]):
        own = scene.model_copy(update={"via": via})
        same = plan(own)
        assert verify(own, same.trajectory).failures() == []
        assert same.duration == pytest.approx(free.duration, rel=same.gap + free.gap)
        assert same.phases[0] == pytest.approx(0.3 * free.duration, rel=0.02)


@pytest.mark.parametrize("within", [0.0, 0.005])
def test_points_beside_a_motion_with_moving_ends_are_passed(underway, within):
    scene, free = underway
    beside = np.add(free.trajectory(0.5 * free.duration).x, (-0.03, 0.01, 0.03)).tolist()
    point = {"at": beside, "within": within} if within else beside
    own = scene.model_copy(update={"via": [point]})
    found = good_plan(own)
    assert found.duration > free.duration
    assert least_distance(found, beside) == pytest.approx(within, rel=1e-2, abs=2e-5)


def test_parts_before_and_after_a_via_point_are_fastest_motions_from_and_to_its_state():
    """On a belt the second part begins when the goal has moved for as long as the first takes."""
    scene = BELT.model_copy(update={"via": [(0.82, -0.02, 0.05)]})
    whole = plan(scene)
    x, v = passing_place(whole)
    state = State(at=tuple(x.tolist()), velocity=tuple(v.tolist()))
    first = plan(BELT.model_copy(update={"goal": state}))
    now = np.add(BELT.goal.at, np.multiply(first.duration, BELT.goal.belt))
    goal = Belt(at=tuple(now.tolist()), belt=BELT.goal.belt)
    second = plan(BELT.model_copy(update={"start": state, "goal": goal}))
    gaps = whole.gap + first.gap + second.gap
    assert first.duration + second.duration == pytest.approx(whole.duration, rel=gaps)


def over_a_wall(thickness, via, **changed):
    """The industrial robot from one side of a wall to the other."""
    half = thickness / 2
    wall = deltaopt.Body(box={"from": (0.75, -half, -0.6), "to": (1.3, half, 0.6)})
    given = {"start": (0.85, -0.15, 0.0), "goal": (0.85, 0.15, 0.0), "keep_out": (wall,)}
    return Scene(robot=SCENE.robot, via=(via,), **(given | changed))


def test_a_sheet_behind_a_point_is_passed_as_its_neighbours_are():
    """Between the points of the first two meshes every motion from there leads through it."""
    one, other = (plan(over_a_wall(0.0005, (0.82, -0.02025, z))) for z in (0.029, 0.030))
    assert max(one.gap, other.gap) < 2e-3
    assert one.duration == pytest.approx(other.duration, rel=2e-3)


def test_a_start_that_cannot_wait_meets_a_belt_behind_a_wall():
    """As soon as it gets to where the belt is then: that is a goal with a state, without a belt."""
    via, belt = (0.8405, -0.0176, 0.016), (0.0, 0.22, 0.21)
    start = State(at=(0.85, -0.15, 0.0), velocity=(0.12, 0.4, -0.17))
    on_belt = over_a_wall(0.005, via, start=start, goal=Belt(at=(0.85, 0.15, 0.0), belt=belt))
    found = plan(on_belt)
    assert verify(on_belt, found.trajectory).ok
    met = State(at=tuple(found.trajectory(found.duration).x), velocity=belt)
    there = plan(over_a_wall(0.005, via, start=start, goal=met))
    assert found.duration == pytest.approx(there.duration, rel=2e-3)
