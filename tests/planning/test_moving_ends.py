"""Motions that begin or end moving: against closed forms, symmetries, and another solver."""

from __future__ import annotations

import numpy as np
import pytest

import deltaopt
from deltaopt import (
    Anywhere,
    Belt,
    DeltaModel,
    Effort,
    Planner,
    Scene,
    SceneError,
    State,
    TimeAndEffort,
    load_scene,
    plan,
    verify,
)
from deltaopt.errors import Infeasible
from deltaopt.planning.in_flight import finished_first
from deltaopt.planning.journal import Journal
from deltaopt.planning.loop import Loop
from deltaopt.planning.trajectory_optimiser import TrajectoryOptimiser
from studies.frozen import cases
from studies.problems import PROBLEMS
from tests.good_plans import good_plan
from tests.planning.switching.test_vertical_moves import MOVES, VerticalMove

CROSS = load_scene("problems/industrial_cross.yaml")
WALL = load_scene("problems/keep_out/wall_25_305_25.yaml")
PASSED, BELT, STOP = (
    load_scene(f"problems/moving/{name}.yaml") for name in ("passed_state", "belt", "stop")
)
SHIPPED = {"passed state": PASSED, "belt": BELT, "stop": STOP}
PLANNER = Planner(CROSS.robot, CROSS.payload)
ROUGHLY = Planner(CROSS.robot, CROSS.payload, tolerance=1e-2)
"""Where it is verification that judges."""
_COLUMN = {"height": 0.02, "radius": 0.005}
UP_AND_DOWN = {"start": _COLUMN, "goal": _COLUMN}


@pytest.fixture(scope="module")
def across():
    return PLANNER.plan(CROSS.start, CROSS.goal)


@pytest.fixture(scope="module", params=SHIPPED, ids=list(SHIPPED))
def shipped(request):
    return plan(SHIPPED[request.param])


# Against closed forms


class Underway:
    """A vertical move halfway to where its torques switch: an angle of the arms, a depth in m, a
    velocity in m/s, and the time since the start in s; all by energy alone."""

    def __init__(self, move: VerticalMove) -> None:
        first, leaves = move.ends[0], move.switches[0]
        self.angle = (first + leaves) / 2
        self.depth = float(move.depth(np.array(self.angle)))
        self.since = move.time(move.torque, first, self.angle)
        slope = (move.depth(self.angle + 1e-6) - move.depth(self.angle - 1e-6)) / 2e-6
        sign = np.sign(move.torque)
        rate = sign * move.rate(np.array(self.angle), move.torque, first)
        self.speed = float(slope * rate)

    def scene(self, move: VerticalMove, direction: float, goal: object) -> Scene:
        start = State(at=(self.depth, 0, 0), velocity=(direction * self.speed, 0, 0))
        return Scene(robot=move.robot, payload=move.payload, start=start, goal=goal)


@pytest.mark.parametrize("move", MOVES[::3], ids=["down", "up, speed limited"])
@pytest.mark.parametrize("direction", [1.0, -1.0], ids=["towards the goal", "away from it"])
def test_vertical_motion_with_a_speed_at_the_start(move, direction):
    """Towards the goal it is the rest of the move. Away from it the platform first comes to rest
    where the move begins, by the same torques: the arc in reverse."""
    now = Underway(move)
    found = good_plan(now.scene(move, direction, (move.goal, 0.0, 0.0)))
    expected = move.duration - direction * now.since
    assert expected * (1 - 1e-9) <= found.duration <= expected * (1 + found.gap)


@pytest.mark.parametrize("move", MOVES[::3], ids=["down", "up, speed limited"])
def test_vertical_stop(move):
    """Full torque against the motion, until the kinetic energy is used up."""
    now = Underway(move)
    near, far = now.angle, now.angle + np.sign(move.torque) * 0.6
    speed = move.rate(np.array(now.angle), move.torque, move.ends[0])
    for _ in range(100):  # to the angle of rest from which the arc in reverse has this speed here
        middle = (near + far) / 2
        slower = move.rate(np.array(now.angle), -move.torque, middle) < speed
        near, far = (middle, far) if slower else (near, middle)
    expected = move.time(-move.torque, near, now.angle)
    found = plan(now.scene(move, 1.0, Anywhere()))
    assert expected * (1 - 1e-9) <= found.duration <= expected * (1 + found.gap)
    end = found.trajectory(found.duration)
    assert float(end.x[0]) == pytest.approx(float(move.depth(np.array(near))), abs=1e-4)


# Laws


def test_a_belt_that_stands_still_is_a_point(across):
    still = PLANNER.plan(CROSS.start, Belt(at=CROSS.goal, belt=(0, 0, 0)))
    assert still.duration == across.duration
    at_rest = PLANNER.plan(State(at=CROSS.start), State(at=CROSS.goal))
    assert at_rest.duration == across.duration


def test_a_motion_from_state_to_state_can_be_reversed():
    """Without friction the same torques drive the motion backwards."""
    forth = plan(PASSED)
    back = {
        "start": State(at=PASSED.goal.at, velocity=tuple(-v for v in PASSED.goal.velocity)),
        "goal": State(at=PASSED.start.at, velocity=tuple(-v for v in PASSED.start.velocity)),
    }
    found = plan(PASSED.model_copy(update=back))
    assert found.duration == pytest.approx(forth.duration, rel=max(found.gap, forth.gap))


@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_the_rest_of_an_optimal_motion_is_optimal(across, share):
    now = across.trajectory(share * across.duration)
    found = PLANNER.plan(now, CROSS.goal)
    left = (1 - share) * across.duration
    assert found.duration <= left * (1 + 1e-9)  # it can always be finished
    assert found.duration + share * across.duration >= across.duration / (1 + across.gap)


@pytest.mark.parametrize("share", [0.7, 0.9])
def test_a_state_that_lies_ahead_is_passed_at_once_and_not_after_a_loop(share):
    """The rest of an optimal motion begun a little slower takes hardly longer."""
    whole = plan(PASSED)
    now = whole.trajectory(share * whole.duration)
    start = State(at=tuple(now.x), velocity=tuple(0.95 * now.v))
    found = plan(PASSED.model_copy(update={"start": start}))
    assert found.duration == pytest.approx((1 - share) * whole.duration, rel=0.01)


@pytest.mark.parametrize("share", [0.8, 0.9])
def test_a_via_point_close_ahead_is_passed_at_once_and_not_after_a_loop(share):
    """The short leg to it takes less than its share of the time."""
    through = PASSED.model_copy(update={"via": [(0.83, -0.025, -0.025)]})
    whole = plan(through)
    now = whole.trajectory(share * whole.phases[0])
    start = State(at=tuple(now.x), velocity=tuple(0.95 * now.v))
    found = plan(through.model_copy(update={"start": start}))
    left = whole.duration - share * whole.phases[0]
    assert found.duration == pytest.approx(left, rel=0.01)


def test_a_belt_that_moves_away_is_met_as_soon_as_its_place_can_be_reached():
    found = plan(BELT)
    end = found.trajectory(found.duration)
    x, v = (tuple(each.tolist()) for each in (end.x, end.v))
    np.testing.assert_allclose(v, BELT.goal.belt, atol=1e-9)
    expected = np.array(BELT.goal.at) + found.duration * np.array(BELT.goal.belt)
    np.testing.assert_allclose(x, expected, atol=1e-9)
    same = plan(BELT.model_copy(update={"goal": State(at=x, velocity=v)}))
    assert same.duration == pytest.approx(found.duration, rel=found.gap + same.gap)


# Another solver


@pytest.mark.parametrize("name", ["belt", "stop"])
def test_ipopt_finds_the_same(name):
    scene = SHIPPED[name]
    ours, theirs = plan(scene), plan(scene, solver=deltaopt.ipopt)
    assert theirs.duration == pytest.approx(ours.duration, rel=max(ours.gap, theirs.gap))
    assert verify(scene, theirs.trajectory).failures() == []


# Verified, written, read


def test_verified(shipped):
    found = verify(shipped.scene, shipped.trajectory)
    assert found.failures() == []
    assert found.torque_excess <= 1e-9
    assert shipped.within_tolerance


def test_verification_sees_other_ends(shipped):
    scene, motion = shipped.scene, shipped.trajectory
    state = scene.task.start
    shifted = State(at=state.position, velocity=tuple(v + 1e-3 for v in state.velocity))
    found = verify(scene.model_copy(update={"start": shifted}), motion)
    assert any("begins with a velocity" in each for each in found.failures())
    slowed = verify(scene, motion.slowed(1.001))
    assert slowed.failures()
    assert not any("slowed to" in each for each in slowed.failures())


def test_saved_and_read_back(shipped, tmp_path):
    shipped.save(tmp_path, chart=False)
    back = deltaopt.load_plan(tmp_path)
    assert back.scene == shipped.scene
    assert back.trajectory.end_velocities == shipped.trajectory.end_velocities
    after = shipped.duration + 0.01
    np.testing.assert_array_equal(back.trajectory(after).x, shipped.trajectory(after).x)


def test_outside_its_duration_a_motion_moves_on_as_its_ends_do():
    found = plan(BELT)
    T, belt = found.duration, np.array(BELT.goal.belt)
    motion = found.trajectory([-0.1, T, T + 0.02])
    np.testing.assert_allclose(motion.x[2], motion.x[1] + 0.02 * belt, atol=1e-12)
    np.testing.assert_allclose(motion.v[2], belt, atol=1e-12)
    np.testing.assert_allclose(motion.x[0], BELT.start, atol=1e-15)
    np.testing.assert_array_equal(motion.a[[0, 2]], 0)


# At a limit


@pytest.mark.parametrize("before_end", [0.0, 1e-10, 3e-9])
def test_nothing_to_plan_at_the_very_end_of_a_motion(across, before_end):
    """Rounding may leave a way or a speed there; what is left is said, and no motion of 1e-15 s is
    returned."""
    now = across.trajectory(across.duration - before_end)
    with pytest.raises((SceneError, deltaopt.Infeasible, deltaopt.NotConverged)):
        PLANNER.stop(now)
    with pytest.raises((SceneError, deltaopt.Infeasible), match=r"resolve|other than start"):
        PLANNER.plan(now, CROSS.goal)


@pytest.mark.parametrize("left", [1e-4, 3e-5])
def test_a_smooth_motion_that_is_nearly_over_is_finished(left):
    """Of the way of 1e-8 m that is left solvers see little but rounding."""
    robot = deltaopt.load_robot(PROBLEMS / "robots" / "industrial_smooth.yaml")
    planner = Planner(robot)
    at = planner.plan(CROSS.start, CROSS.goal).trajectory
    now = at(at.duration - left)
    for found in (planner.plan(now, CROSS.goal), planner.stop(now)):
        assert found.duration == pytest.approx(left, rel=1e-3)
        assert found.iterations == 0
        assert deltaopt.verify(found.scene, found.trajectory).ok


def test_a_motion_at_its_end_goes_on_from_rest(across):
    elsewhere = (0.8, 0.0, 0.1)
    found = PLANNER.plan(across.trajectory(across.duration), elsewhere)
    rest = PLANNER.plan(CROSS.goal, elsewhere)
    assert found.duration == pytest.approx(rest.duration, rel=1e-12)


def test_a_start_at_the_limit_of_speed():
    """Interrupted while a motor is as fast as it may be: the new motion begins at that limit."""
    planner = Planner(CROSS.robot, CROSS.payload, limits={"speed": 5.0})
    old = planner.plan(CROSS.start, CROSS.goal)
    times = np.linspace(0, old.duration, 200)
    speeds = np.abs(old.trajectory(times).dtheta).max(axis=1)
    now = old.trajectory(float(times[speeds.argmax()]))
    assert np.abs(now.dtheta).max() > 5.0 * (1 - 1e-4)
    new = planner.plan(now, (0.80, 0.0, 0.1))
    assert verify(new.scene, new.trajectory).failures() == []
    assert new.within_tolerance


# In flight, past bodies


@pytest.fixture(scope="module")
def over_the_wall():
    return plan(WALL)


def test_interrupted_beside_a_wall(over_the_wall):
    """To a new goal on either side of the wall, past which finishing first is one way."""
    now = over_the_wall.trajectory(0.3 * over_the_wall.duration)
    left = over_the_wall.duration - float(now.t)
    for goal in (WALL.start, (0.82, 0.12, -0.05)):
        new = ROUGHLY.plan_scene(WALL.model_copy(update={"goal": goal}), start=now)
        rest = plan(WALL.model_copy(update={"start": WALL.goal, "goal": goal}))
        assert verify(new.scene, new.trajectory).failures() == []
        assert new.duration < left + rest.duration
        np.testing.assert_allclose(new.trajectory(0.0).v, now.v, atol=1e-12)


def test_a_body_that_appears_on_the_way(across):
    """The motion under way would run into it, so that finishing it first is no motion."""
    now = across.trajectory(0.1 * across.duration)
    ahead = across.trajectory(0.6 * across.duration).x
    ball = {"sphere": {"centre": tuple(ahead.tolist()), "radius": 0.02}}
    scene = CROSS.model_copy(update={"keep_out": [ball]})
    assert verify(scene, across.trajectory).failures() != []
    new = ROUGHLY.plan_scene(scene, start=now)
    assert verify(new.scene, new.trajectory).failures() == []
    path = new.trajectory(np.linspace(0, new.duration, 2001)).x
    assert np.linalg.norm(path - ahead, axis=1).min() >= 0.02 - 1e-9


@pytest.mark.parametrize("goal", [CROSS.goal, Anywhere()], ids=["the same goal", "a stop"])
def test_finishing_is_a_plan_where_nothing_is_found(across, goal):
    """The motion under way leads to its own goal, and to rest."""
    share = 0.3 * across.duration
    now, rest = across.trajectory(share), across.trajectory.position.after(share)
    state = State(at=tuple(now.x.tolist()), velocity=tuple(now.v.tolist()))
    scene = CROSS.model_copy(update={"start": state, "goal": goal})
    loop = Loop(TrajectoryOptimiser(), Journal(lambda _: None))
    found = finished_first(loop, scene, plan, rest, None)
    assert verify(found.scene, found.trajectory).failures() == []
    assert found.duration == pytest.approx(across.duration - share, rel=1e-12)
    assert found.sensitivities == ()


@pytest.mark.parametrize("share", [0.5, 0.9])
@pytest.mark.parametrize("goal", [(0.80, 0.0, 0.0), Anywhere()], ids=str)
@pytest.mark.parametrize("scene", [PASSED, BELT], ids=["passed state", "belt"])
def test_what_replaces_a_motion_that_ends_moving_comes_to_rest(scene, goal, share):
    """There is no resting at the end of that one: its platform is in motion there."""
    old = plan(scene, tolerance=1e-2)
    new = ROUGHLY.plan(old.trajectory(share * old.duration), goal)
    assert verify(new.scene, new.trajectory).failures() == []


VIA = {"at": (0.78, -0.05, 0.02), "within": 0.01}


@pytest.mark.parametrize(
    ("goal", "via"),
    [(CROSS.goal, (VIA,)), (PASSED.goal, None)],
    ids=["at rest, through a point", "passed"],
)
def test_a_motion_to_the_same_goal_takes_no_longer_than_the_rest_of_it(goal, via):
    """Also where a point is still to be passed, and where the goal is passed in motion."""
    scene = CROSS.model_copy(update={"goal": goal, "via": via})
    old = plan(scene)
    for share in (0.02, 0.95):
        now = old.trajectory(share * (old.phases[0] if via else old.duration))
        new = PLANNER.plan_scene(scene, start=now)
        assert verify(new.scene, new.trajectory).failures() == []
        assert new.duration <= (old.duration - float(now.t)) * (1 + 1e-9)


def test_a_point_that_is_still_to_be_passed_on_the_way_to_where_the_motion_ends(across):
    """That motion leads to the goal, but not through the point."""
    scene = CROSS.model_copy(update={"via": ((0.70, 0.0, 0.0),)})
    new = ROUGHLY.plan_scene(scene, start=across.trajectory(0.9 * across.duration))
    assert verify(new.scene, new.trajectory).failures() == []


def test_a_stop_and_on_from_there_where_nothing_else_is_found():
    """At torques near their limit, which may not jump, and too fast: every other attempt fails."""
    given = {
        "base_radius": 0.2306265891993697,
        "drive": {"torque": 34.651200036927754, "speed": 10},
    }
    given["upper_arm"] = {"length": 0.17372125411599498, "mass": 1.0}
    given["forearm"] = {"length": 0.6397784794846262, "mass": 0.4}
    start = State(
        at=(0.5951665356145185, -0.1260325074969203, -0.004383001520634599),
        velocity=(-1.9068543852320152, 0.45641049893642044, 0.01708420495737742),
        acceleration=(-27.065260465447157, 13.409397976561763, 0.5361319163840873),
    )
    scene = Scene(
        robot=CROSS.robot.model_copy(update=given),
        payload=1.2355410278912609,
        start=start,
        goal=State(at=(0.587, 0.148, 0.02), velocity=(-0.644, 0.254, -0.607)),
        limits={"torque_rate": 4331.400004615969},
    )
    stop = plan(scene.model_copy(update={"goal": Anywhere()}))
    onwards = plan(scene.model_copy(update={"start": stop.reached}))
    found = plan(scene)
    assert verify(found.scene, found.trajectory).failures() == []
    assert found.duration <= (stop.duration + onwards.duration) * (1 + 1e-9)


@pytest.mark.parametrize(
    "objective", [Effort(duration=0.28), TimeAndEffort(time=1.0, effort=1e-4)], ids=str
)
def test_finishing_is_no_plan_for_another_objective(across, objective):
    """It is the shortest, takes another time than is given, and costs more."""
    now = across.trajectory(0.1 * across.duration)
    new = Planner(CROSS.robot, CROSS.payload, objective=objective).plan(now, CROSS.goal)
    assert verify(new.scene, new.trajectory).failures() == []
    assert new.cost == pytest.approx(plan(new.scene).cost, rel=1e-3)


# What cannot be


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"goal": "anywhere"}, "goal is 'anywhere'; expected a start that moves"),
        ({"start": "anywhere"}, "start is 'anywhere'; expected three coordinates"),
        (
            {"start": {"at": (0.85, 0, 0), "velocity": (1, 0, 0), "acceleration": (0, 0, 0)}},
            "expected none without limits of jerk or torque rate, for then it may jump",
        ),
        ({"start": {"at": (0.85, 0, 0), "belt": (1, 0, 0)}}, "expected a belt at the goal alone"),
        ({"goal": {"at": (0.85, 0, 0), "speed": 1}}, "goal.speed is not a known key"),
        ({"goal": {"belt": (1, 0, 0)}}, "goal.at is missing"),
        (
            {"goal": {"at": (0.85, 0, 0), "velocity": (1, 0, 0)}, "path": "line"},
            "expected start and goal at rest beside it",
        ),
        (
            {"goal": {"at": (0.85, 0, 0), "velocity": "fast"}},
            "goal.velocity is 'fast'; expected a velocity [x, y, z] in m/s",
        ),
    ],
)
def test_refused(given, says):
    with pytest.raises(SceneError) as error:
        Scene(**{"robot": CROSS.robot, "start": CROSS.start, "goal": CROSS.goal, **given})
    assert says in str(error.value)


@pytest.mark.parametrize("end", ["start", "goal"])
@pytest.mark.parametrize("via", [None, ((0.80, 0.0, 0.05),)], ids=["", "via"])
def test_an_acceleration_without_velocity_is_kept(end, via):
    """As by a hair's breadth of velocity, which makes next to no difference."""
    limits, found = {"torque_rate": 5000.0}, []
    for speed in (0.0, 1e-6):
        state = State(at=getattr(CROSS, end), velocity=(0, speed, 0), acceleration=(2, 20, -5))
        scene = CROSS.model_copy(update={"limits": limits, "via": via, end: state})
        found.append(good_plan(scene))
    acceleration = found[0].trajectory.path_inside([0.0, 1.0])[2][-(end == "goal")]
    np.testing.assert_allclose(acceleration, [2, 20, -5], atol=1e-9)
    assert found[0].duration == pytest.approx(found[1].duration, rel=1e-3)


@pytest.mark.parametrize("more", [{"via": ((0.8, 0.0, 0.05),)}, {"approach": UP_AND_DOWN}])
def test_a_state_at_rest_is_a_point(more):
    """With and without its velocity, where a belt stands still, and under way at its start."""
    scene = CROSS.model_copy(update=more)
    at_rest = State(at=CROSS.start), State(at=CROSS.start, velocity=(0, 0, 0))
    still = [{"start": each} for each in at_rest]
    still += [{"goal": State(at=CROSS.goal)}, {"goal": Belt(at=CROSS.goal, belt=(0, 0, 0))}]
    old = plan(scene)
    others = [plan(scene.model_copy(update=each)) for each in still]
    others.append(PLANNER.plan_scene(scene, start=old.trajectory(0.0)))
    assert [each.duration for each in others] == pytest.approx([old.duration] * 5, rel=1e-9)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"path": "line"}, "path is 'line'; expected start and goal at rest beside it"),
        ({"path": "line", "tube": 0.005}, "path is 'line'; expected start and goal at rest"),
        ({"approach": UP_AND_DOWN}, "approach is .*; expected start and goal at rest beside it"),
    ],
    ids=["path", "tube", "approach"],
)
def test_what_a_motion_under_way_does_not_go_with_is_refused(across, given, says):
    """It was planned without: off the path, or beside the cylinders."""
    with pytest.raises(SceneError, match=says):
        PLANNER.plan_scene(CROSS.model_copy(update=given), start=across.trajectory(0.02))


def test_fields_of_a_copy_that_do_not_go_together_are_refused():
    copy, motion = CROSS.model_copy(update={"tube": 0.01}), plan(CROSS).trajectory
    with pytest.raises(SceneError, match=r"tube is 0\.01; expected a path beside it"):
        plan(copy)
    with pytest.raises(SceneError, match=r"tube is 0\.01; expected a path beside it"):
        PLANNER.plan_near(copy, motion)


@pytest.mark.parametrize("end", ["start", "goal"])
def test_a_state_whose_own_acceleration_takes_too_much_torque_is_refused(end):
    """Where acceleration is continuous; the torque is that of inverse dynamics."""
    at, v, a = (0.75, -0.12, 0.04), (-1.1, 2.3, -1.4), (200.0, 64.0, -15.0)
    tau = DeltaModel(CROSS.robot, CROSS.payload).inverse_dynamics(*np.array([[at], [v], [a]]))[0]
    motor = int(np.flatnonzero(np.abs(tau) > 40.0)[0])
    state = State(at=at, velocity=v, acceleration=a)
    scene = CROSS.model_copy(update={"limits": {"torque_rate": 4000.0}, end: state})
    says = f"{end}: .*200, 64, -15.* the torque of motor {motor + 1} is {tau[motor]:.4g} N·m"
    with pytest.raises(Infeasible, match=says):
        plan(scene)


def test_a_start_that_is_too_fast_is_refused():
    with pytest.raises(deltaopt.Infeasible, match=r"start: at \[0, 20, 0\] m/s .* the speed of"):
        PLANNER.plan(State(at=CROSS.start, velocity=(0, 20, 0)), CROSS.goal)


def test_another_formulation_plans_to_a_belt():
    found, flat = plan(BELT, formulation=deltaopt.multiplier), plan(BELT, tolerance=1e-4)
    assert verify(found.scene, found.trajectory).failures() == []
    assert found.duration == pytest.approx(flat.duration, rel=found.gap + flat.gap)


def test_settings_of_motions_from_rest_to_rest_are_refused():
    with pytest.raises(ValueError, match="start has 2 instants; one is needed"):
        PLANNER.plan(plan(PASSED).trajectory([0, 0.01]), CROSS.goal)


def test_a_stop_past_a_sphere_whose_first_meshes_are_not_solved():
    """They lose their way in a parallel singularity; kept away from it they are."""
    (case,) = (each for each in cases() if each.name.startswith("stop, sphere haptic 180"))
    assert good_plan(case.scene()).duration < 0.0212


def test_a_rate_of_torque_is_kept_on_a_fine_mesh_where_the_goal_moves() -> None:
    """With rows met to a hundredth of the tolerance the method did not converge on two thousand
    intervals, and the motion that it had found was given up: "no motion was found"."""
    robot = deltaopt.Robot.model_validate(
        {
            "name": "heavy links",
            "base_radius": 0.2187,
            "platform_radius": 0.08785,
            "upper_arm": {"length": 0.4034, "mass": 3.583},
            "forearm": {"length": 1.079, "mass": 3.725},
            "platform": {"mass": 3.463},
            "drive": {"torque": 125.5, "speed": 27.0},
        }
    )
    scene = deltaopt.Scene.model_validate(
        {
            "robot": robot,
            "payload": [0.006763, 0.06763],
            "start": [0.66781, 0.15304, -0.45363],
            "goal": {"at": [0.50888, 0.64347, 0.50284], "velocity": [2.059, 0.4206, -0.2926]},
            "limits": {"torque_rate": 3913.0},
        }
    )
    assert good_plan(scene).duration < 0.3825  # 0.4472 s with a rest on the way


@pytest.mark.parametrize(
    ("lengths", "masses", "torque", "start", "velocity", "box"),
    [
        (
            (0.1994, 0.0854, 0.1736, 0.4146),
            (0.391, 0.2913, 0.4048),
            10.141,
            (0.362912, 0.002805, -0.012116),
            (0.39753, 2.63195, -1.02539),
            {"from": [0.3662, 0.0046, -0.5], "to": [1.6, 0.0246, 0.5]},
        ),
        (
            (0.1506, 0.0374, 0.1995, 0.7155),
            (1.3779, 0.491, 0.4119),
            52.851,
            (0.64833, -0.116472, 0.041869),
            (-0.39512, 2.95338, -4.5643),
            {"from": [0.6458, -0.0962, -0.5], "to": [1.6, -0.0763, 0.5]},
        ),
    ],
)
def test_a_stop_right_over_a_wall_is_no_longer_than_from_a_little_slower(
    lengths, masses, torque, start, velocity, box
):
    """Where it would run into the wall by millimetres it is led aside by as little: it takes about
    as long as the stop without the wall, not 30 times as long."""
    base, platform, arm, forearm = lengths
    robot = deltaopt.Robot(
        name="a Delta of these proportions",
        base_radius=base,
        platform_radius=platform,
        upper_arm={"length": arm, "mass": masses[0]},
        forearm={"length": forearm, "mass": masses[1]},
        platform={"mass": masses[2]},
        drive={"torque": torque},
    )
    scene = Scene(
        robot=robot,
        payload=0.5,
        start={"at": start, "velocity": velocity},
        goal="anywhere",
        keep_out=[{"box": box}],
    )
    slower = [
        {"at": start, "velocity": [share * v for v in velocity]} for share in (1 - 1e-6, 0.999)
    ]
    stops = [good_plan(scene.model_copy(update={"start": each})).duration for each in slower]
    free, stop = plan(scene.model_copy(update={"keep_out": None})), good_plan(scene)
    assert free.duration < stop.duration < 1.1 * free.duration
    assert stops == pytest.approx([stop.duration] * 2, rel=4e-3)


def _behind_a_wall(speed, *edges):
    """A belt that comes from behind a wall, 5 mm below its top, to where this ends at a place of y,
    m, and is gone behind the next where that begins."""
    ends = [(-2.0, edges[0]), *([(edges[1], 2.0)] if len(edges) > 1 else [])]
    return CROSS.model_copy(
        update={
            "payload": None,
            "start": (0.75, 0.0, 0.0),
            "goal": {"at": (0.85, -0.3, 0.0), "belt": (0.0, speed, 0.0)},
            "keep_out": [{"box": {"from": [0.845, a, -0.5], "to": [0.9, b, 0.5]}} for a, b in ends],
        }
    )


def _met(scene):
    """When a belt is met, which is within the gap that is told of when that begins to be possible,
    s: how soon after that a motion can have its velocity is not known."""
    found = plan(scene)
    assert verify(scene, found.trajectory).failures() == []
    return found.duration, found.gap


def _waited_for(scene, y):
    """When the belt is at a place to which a motion that waits for it leads, s."""
    belt = scene.goal
    state = {"at": (*belt.at[:1], y, *belt.at[2:]), "velocity": belt.belt}
    time = (y - belt.at[1]) / belt.belt[1]
    there = good_plan(scene.model_copy(update={"goal": state}))
    assert there.duration < time
    return time


def test_a_belt_from_behind_a_wall_is_met_as_soon_as_it_can_be_wherever_that_ends():
    met = []
    for edge in (0.0471, 0.0472, 0.0473):
        scene, begins = _behind_a_wall(0.3, edge), (edge + 0.3) / 0.3
        time, gap = _met(scene)
        assert begins < time < _waited_for(scene, edge + 0.0007)
        assert time <= begins * (1 + gap) * (1 + 1e-9)
        met.append(time)
    assert np.abs(np.diff(met)).max() < 2e-3 * met[0]
    wide, narrow = (_met(_behind_a_wall(0.3, 0.0453, *end))[0] for end in ((), (0.0573,)))
    assert narrow == pytest.approx(wide, rel=5e-4)


def test_a_belt_that_is_seen_through_a_window_for_milliseconds_is_met():
    met, _ = _met(_behind_a_wall(1.0, 0.0473, 0.0553))
    assert 0.0473 < 1.0 * met - 0.3 < 0.0553


def test_a_belt_that_comes_into_a_workspace_is_met_at_its_rim():
    robot = CROSS.robot.model_copy(update={"workspace": {"radius": 0.2}})
    goal = {"at": (0.85, -0.5, 0.0), "belt": (0.0, 0.1, 0.0)}
    scene = Scene(robot=robot, start=(0.75, 0.0, 0.0), goal=goal)
    time, gap = _met(scene)
    assert 3.0 < time < min(3.005, _waited_for(scene, -0.1995))
    assert time <= 3.0 * (1 + gap) * (1 + 1e-9)


@pytest.mark.parametrize("velocity", [(0.0, -1.0, 0.0), (0.0, 0.0, 1.0)], ids=["back", "aside"])
def test_a_motion_back_to_its_start_past_a_body_ahead(velocity):
    x, y, z = place = CROSS.start
    ends = {
        "start": {"at": place, "velocity": (0.0, 1.0, 0.0)},
        "goal": {"at": place, "velocity": velocity},
        "keep_out": [{"sphere": {"centre": [x, y + 0.02, z], "radius": 0.01}}],
    }
    good_plan(CROSS.model_copy(update=ends))


def test_nobody_stops_in_two_millimetres():
    place = CROSS.start
    wall = {"from": [0.84, place[1] + 0.002, -0.5], "to": [0.9, place[1] + 0.01, 0.5]}
    ends = {
        "start": {"at": place, "velocity": (0.0, 1.0, 0.0)},
        "goal": {"at": place, "velocity": (0.0, -1.0, 0.0)},
        "keep_out": [{"box": wall}],
    }
    with pytest.raises(deltaopt.NotConverged):
        plan(CROSS.model_copy(update=ends))
