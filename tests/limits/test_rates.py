"""Limits of jerk and of the rate of torques: against formulas, a closed solution and another
transcription."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from deltaopt import Planner, Scene, SceneError, load_robot, load_scene, plan, verify
from deltaopt.cli import main
from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.errors import Unusable
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.drive import Friction
from deltaopt.robot.tool import Tool
from deltaopt.scene.moving_ends import State
from studies.problems import PROBLEMS
from tests.good_plans import good_plan
from tests.oracles.rate_limited import fastest_with_rates

CROSS, ORSINO = (load_scene(PROBLEMS / f"{n}.yaml") for n in ("industrial_cross", "pick_and_place"))


def limited(scene, **limits):
    return scene.model_copy(update={"limits": limits})


def differences(trajectory, t, step=2e-6):
    """Rates of torques, jerks of arms and of the platform at instants inside of pieces."""
    before, after = trajectory(t - step), trajectory(t + step)
    rates = (
        (b - a) / (2 * step)
        for a, b in zip(
            (before.tau, before.ddtheta, before.a), (after.tau, after.ddtheta, after.a), strict=True
        )
    )
    return tuple(rates)


def inside(trajectory, count=6):
    knots = trajectory.knots
    shares = (np.arange(count) + 0.5) / count
    return (knots[:-1, None] + np.diff(knots)[:, None] * shares).ravel()


def test_excesses_are_those_of_differences():
    """Of a quintic, whose jerk is not zero at its ends: as far over each limit as differences of
    torques, of the arms' and of the platform's accelerations say."""
    scene = limited(CROSS, torque_rate=800.0, jerk=500.0, joint_jerk=2000.0)
    start, goal = np.array(scene.start), np.array(scene.goal)
    at_rest = np.zeros((2, 3))
    path = PiecewisePolynomial.hermite(
        np.array([0.0, 0.4]), np.array([start, goal]), at_rest, at_rest
    )
    model = plan(CROSS).trajectory.model
    found = verify(scene, Trajectory(path, model))
    t = np.linspace(1e-5, 0.4 - 1e-5, 20001)
    torque, arms, platform = differences(Trajectory(path, model), t)
    most = (np.abs(torque).max() / 800, np.linalg.norm(platform, axis=1).max() / 500)
    assert found.torque_rate_excess == pytest.approx(most[0] - 1, rel=1e-4)
    assert found.jerk_excess == pytest.approx(most[1] - 1, rel=1e-3)
    assert found.joint_jerk_excess == pytest.approx(np.abs(arms).max() / 2000 - 1, rel=1e-3)
    assert found.jump_of_acceleration == 0.0


@pytest.mark.parametrize(
    ("scene", "limits"),
    [
        (CROSS, {"torque_rate": 5000.0}),
        (ORSINO, {"jerk": 1500.0, "torque_rate": 2000.0}),
        (CROSS, {"joint_jerk": 20000.0}),
    ],
    ids=["torque rate", "jerk and torque rate", "joint jerk"],
)
def test_a_plan_keeps_them_at_all_instants_and_begins_with_holding_torques(scene, limits):
    trajectory = good_plan(limited(scene, **limits), tolerance=1e-2).trajectory
    torque, arms, platform = differences(trajectory, inside(trajectory))
    reached = {
        "torque_rate": np.abs(torque).max(),
        "jerk": np.linalg.norm(platform, axis=1).max(),
        "joint_jerk": np.abs(arms).max(),
    }
    shares = [reached[name] / limit for name, limit in limits.items()]
    assert max(shares) <= 1 + 1e-5
    assert max(shares) >= 0.98
    still, zero = trajectory.knots[[0, -1]], np.zeros(3)
    model, ends = trajectory.model, trajectory(still)
    for tau, x in zip(ends.tau, ends.x, strict=True):
        np.testing.assert_allclose(tau, model.inverse_dynamics(x, zero, zero), atol=1e-6)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-5, 1e-6])
def test_a_jerk_alone_is_a_closed_solution(tolerance):
    """Far from all other limits the straight line with the jerk at its limit all the time, one way,
    twice back and one way: T³ = 32 d / J. Its torques do not jump: there are no switches to resolve
    where that is asked for, nor costates of an acceleration that is a state."""
    scene = limited(CROSS, jerk=60.0)
    way = float(np.linalg.norm(np.subtract(scene.goal, scene.start)))
    found = plan(scene, tolerance=tolerance)
    assert found.within_tolerance
    assert found.certificate is None
    exact = (32 * way / 60.0) ** (1 / 3)
    assert exact * (1 - 1e-6) <= found.duration <= exact * (1 + found.gap)


def test_the_more_rate_the_sooner_until_it_is_no_limit():
    durations = [plan(limited(ORSINO, torque_rate=rate)).duration for rate in (1e3, 5e3, 1e5)]
    without = plan(ORSINO, tolerance=1e-4).duration
    assert durations[0] > 1.01 * durations[1] > 1.01 * durations[2]
    assert without * (1 - 1e-4) < durations[2] < without * (1 + 1.5e-3)


def test_another_transcription_finds_the_same_over_a_wall():
    """The test cycle with a tool of 10 mm and 8 ms from no torque to the peak, extrapolated as if
    the error, 2.3e-3 and 6e-4, fell with the square of the length of intervals. It does but for
    some, as torques turn elsewhere within them: from 100 and 200 the plan is 5e-5 longer instead of
    5e-5 shorter."""
    wall = load_scene(PROBLEMS / "keep_out" / "wall_25_305_25.yaml")
    robot = wall.robot.model_copy(update={"tool": Tool(radius=0.01)})
    scene = limited(wall, torque_rate=5000.0).model_copy(update={"robot": robot})
    found = plan(scene, tolerance=1e-4)
    assert found.gap <= 1e-4
    coarse, fine = (
        fastest_with_rates(scene, n, found.duration, found.trajectory) for n in (50, 100)
    )
    assert found.duration < fine < coarse
    assert found.duration == pytest.approx(fine + (fine - coarse) / 3, rel=1e-4)


def test_a_jump_of_acceleration_is_none_of_a_smooth_motion():
    """The fastest motion without such limits, slowed until its jerk is small: it jumps."""
    scene = limited(CROSS, jerk=1e5)
    slowed = plan(CROSS).trajectory.slowed(20.0)
    found = verify(scene, slowed)
    assert found.jerk_excess < 0
    assert any("acceleration jumps" in failure for failure in found.failures())
    assert any("begins with an acceleration" in failure for failure in found.failures())


def test_a_start_with_an_acceleration_goes_on_with_it():
    limits = {"torque_rate": 8000.0}
    planner = Planner(CROSS.robot, payload=1.0, limits=limits)
    first = planner.plan(CROSS.start, CROSS.goal)
    instant = first.trajectory(0.4 * first.duration)
    x, y, z = CROSS.goal
    second = planner.plan(instant, (x, y, z - 0.1))
    assert verify(second.scene, second.trajectory).failures() == []
    begin = second.trajectory.path_inside([0.0])
    np.testing.assert_allclose(begin[2][0], instant.a, atol=1e-9)
    assert np.linalg.norm(instant.a) > 1.0


def test_what_is_refused():
    state = State(at=CROSS.start, velocity=(0.0, 0.1, 0.0), acceleration=(0.0, 1.0, 0.0))
    with pytest.raises(SceneError, match=r"start.acceleration .*jerk or torque rate"):
        type(CROSS).model_validate({**dict(CROSS), "start": state})
    with pytest.raises(SceneError, match="a tube about it"):
        type(CROSS).model_validate({**dict(CROSS), "path": "line", "limits": {"jerk": 100.0}})
    with pytest.raises(Unusable, match="flat formulation"):
        plan(limited(CROSS, jerk=1000.0), formulation=Multiplier())


def test_the_least_payload_of_a_range_counts_too():
    """With 0 to 2 kg: as fast as neither alone, and kept with both."""
    scene = limited(CROSS, torque_rate=5000.0).model_copy(update={"payload": (0.0, 2.0)})
    found = plan(scene)
    assert verify(scene, found.trajectory).failures() == []
    for payload in (None, 2.0):
        alone = scene.model_copy(update={"payload": payload})
        of_one = plan(alone)
        same = replace(found.trajectory, model=of_one.trajectory.model)
        assert verify(alone, same).failures() == []
        assert of_one.duration <= found.duration * (1 + 1e-3)


def test_commands_take_them(tmp_path, capsys):
    """A table with rows each millisecond asks for less than one of torques that jump, 1.17."""
    scene, out = PROBLEMS / "limits" / "smooth.yaml", tmp_path / "out"
    assert main(["check", str(scene)]) == 0
    assert "torque rate" in capsys.readouterr().out
    assert main(["plan", str(scene), "--details", "--no-plot", "-o", str(out)]) == 0
    assert "jump of acceleration" in capsys.readouterr().out
    words = ["--cycle", "1ms", "--controller", "cubic", "--anyway", "-o", str(tmp_path / "t.csv")]
    assert main(["export", "table", str(out), *words]) == 0
    asked = re.search(r"asks for ([\d.]+) of", capsys.readouterr().out)
    assert asked
    assert float(asked[1]) < 1.01


def test_friction_that_changes_its_sign_between_two_points_is_found():
    """Where an arm turns back, friction changes its sign within a millisecond, and the rate of the
    torque peaks. A mesh whose points all miss the peak exceeds the limit there, and its motion must
    be slowed. Friction that changes its sign more slowly is seen by every mesh: the durations of
    both agree within 1 %."""
    found = {}
    for width in (0.1, 0.2):
        friction = Friction(viscous=0.8, coulomb=4.0, speed=width)
        drive = CROSS.robot.drive.model_copy(update={"friction": friction})
        robot = CROSS.robot.model_copy(update={"drive": drive})
        ends = {"start": (0.4282, 0.3867, -0.3533), "goal": (0.6993, 0.4546, 0.1550)}
        scene = Scene(robot=robot, payload=1.0, limits={"torque_rate": 9900.0}, **ends)
        found[width] = good_plan(scene)
    assert found[0.1].duration == pytest.approx(found[0.2].duration, rel=0.01)


def with_friction(name, friction):
    robot = load_robot(PROBLEMS / "robots" / f"{name}.yaml")
    return robot.model_copy(update={"drive": robot.drive.model_copy(update={"friction": friction})})


def test_an_arm_turns_back_under_friction_as_fast_as_without():
    """Within 0.02 rad/s friction changes its sign while the torque may hardly change:
    acceleration falls instead, which costs next to nothing. A limit more makes no motion faster;
    and friction, which drives where motors brake, does not make that of a limited rate slower by
    more than it makes others. Limited on one side of each third of an interval alone, rates peaked
    on the other, and this missed its tolerance."""
    robot = with_friction("rl5", Friction(coulomb=15.0, speed=0.02))
    ends = {
        "start": (0.9172782993746647, -0.38647028499711666, 0.03360056431962488),
        "goal": (1.162358401893388, 0.502563723102327, 0.03652782477532335),
        "payload": 0.5,
    }
    rate = 43750.0
    without = robot.drive.model_copy(update={"friction": None})
    smooth = Scene(robot=robot.model_copy(update={"drive": without}), **ends)
    rough = Scene(robot=robot, **ends)
    both = limited(rough, torque_rate=rate)
    found = good_plan(both)
    by_friction, by_rate = (
        plan(each).duration for each in (rough, limited(smooth, torque_rate=rate))
    )
    assert by_friction * (1 - 1e-3) < found.duration < max(by_friction, by_rate) * 1.01
