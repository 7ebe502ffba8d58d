"""Least effort, and time weighted with it: exact answers, symmetries, other formulations."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import permutations

import casadi as ca
import numpy as np
import pytest
from numpy.polynomial import Polynomial

import deltaopt
from deltaopt import Scene, load_scene, plan, verify
from deltaopt.errors import Infeasible
from deltaopt.limits.running_cost import Running
from deltaopt.motion.running_cost import cost, running_cost
from deltaopt.motion.time_scaling import highest_rows
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.flat.equations import PointEquations
from deltaopt.planning.nlp.problem import Cost
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.known_limits import limits_of
from deltaopt.scene.objective import (
    Effort,
    SmoothMotion,
    SmoothTorque,
    TimeAndEffort,
    TimeAndJerk,
    TimeAndTorqueRate,
)
from studies.bench.hard_moves import robot_of
from studies.keep_out.other_ways import past_obstacle
from tests.planning.switching.test_exact_answers import Line, UnitMass, solved_on

EFFORT = Cost(time=0.0, running=1.0, duration_is_given=True)
PICK = load_scene("problems/pick_and_place.yaml")
CROSS = load_scene("problems/industrial_cross.yaml")
ACROSS = Scene(robot=CROSS.robot, payload=1.0, start=(0.85, -0.15, 0.0), goal=(0.85, 0.15, 0.0))
LONG = load_scene("problems/long_diagonal.yaml")
LIGHT = load_scene("problems/light_and_fast.yaml")
GENTLY = load_scene("problems/objectives/pick_and_place_gently.yaml")
MILD = load_scene("problems/objectives/industrial_cross_mild.yaml")


@dataclass(frozen=True)
class Push(Line):
    """A way of d along the first axis in the time T with |force| ≤ u and least ∫ force² dt.

    The force is linear in time, from 6 d / T² to its opposite, unless that is more than u: then
    it is u for a time s first, and -u for as long at the end.
    """

    T: float = 1.0

    @property
    def s(self) -> float:
        """From d = 2 u (s T/2 - s²/2 + (T/2 - s)²/3)."""
        if 6 * self.d / self.T**2 <= self.u:
            return 0.0
        rest = (self.T**2 / 4 - self.d / self.u) * 3  # (T/2 - s)², by substitution
        return self.T / 2 - float(np.sqrt(rest))

    @property
    def least(self) -> float:
        if self.s == 0:
            return 12 * self.d**2 / self.T**3
        return 2 * self.u**2 * (self.s + (self.T / 2 - self.s) / 3)

    @property
    def scaling(self):
        return replace(super().scaling, time=self.T)

    @cached_property
    def equations(self) -> PointEquations:
        e, force = super().equations, self.u
        return replace(e, rates={Running.EFFORT: ca.sumsqr(force * e.y[9:12])})

    @property
    def guess(self) -> Trajectory:
        return super().guess.slowed(self.T / super().guess.duration)

    def effort(self, motion: Trajectory) -> float:
        nodes, weights = np.polynomial.legendre.leggauss(8)
        squares = (motion.inside_intervals((nodes + 1) / 2).a ** 2).sum(axis=1)
        return float(np.diff(motion.knots) / 2 @ (squares.reshape(-1, 8) @ weights))


FREE, HELD = Push(0.7, 30.0, None, 0.9), Push(0.7, 4.0, None, 0.9)


def pushed(push, mesh) -> Trajectory:
    """The least effort on a mesh."""
    found = solved_on(push.equations, push.scaling, mesh, push.guess, EFFORT)
    return Trajectory(found.position, UnitMass())


def test_a_free_push_is_linear():
    """Which lies in the space of cubics, whatever the mesh."""
    motion, t = pushed(FREE, np.array([0.2, 0.5, 0.3])), np.linspace(0, 0.9, 7)
    assert motion.duration == pytest.approx(0.9, rel=1e-14)
    assert FREE.effort(motion) == pytest.approx(12 * 0.7**2 / 0.9**3, rel=1e-9)
    force = 6 * 0.7 / 0.9**2 * (1 - 2 * t / 0.9)
    np.testing.assert_allclose(motion(t).a[:, 0], force, atol=1e-6)


def test_a_push_that_comes_to_its_limit():
    """Its force has kinks, between knots here: three times the intervals, an eighth of the error
    and less."""
    motions = [pushed(HELD, np.full(n, 1 / n)) for n in (7, 21)]
    errors = [abs(HELD.effort(motion) / HELD.least - 1) for motion in motions]
    assert errors[0] < 2e-3
    assert errors[1] < errors[0] / 8


@cache
def planned(scene, **settings):
    found = plan(scene, tolerance=1e-3, **settings)
    assert found.within_tolerance
    return found


def in_time(duration, scene=PICK):
    return scene.model_copy(update={"objective": Effort(duration=duration)})


def weighted(weight, scene=PICK):
    return scene.model_copy(update={"objective": TimeAndEffort(effort=weight)})


@pytest.mark.parametrize("scene", [GENTLY, MILD], ids=["effort", "both"])
def test_plans_are_verified_and_settled(scene):
    found = planned(scene)
    report = verify(scene, found.trajectory)
    assert report.ok, report.failures()
    assert report.torque_excess <= 0
    assert found.cost == pytest.approx(cost(problem_of(scene), found.trajectory), rel=1e-15)
    finer = plan(scene, tolerance=1e-4, intervals=32)
    assert abs(found.cost / finer.cost - 1) <= found.gap


def test_a_given_duration_is_kept():
    assert planned(GENTLY).duration == pytest.approx(0.28, rel=1e-14)
    report = verify(GENTLY, planned(GENTLY).trajectory.slowed(1.001))
    assert report.failures() == ["it takes 0.00028 s more or less than the scene says"]


def test_there_and_back_cost_the_same():
    """Without friction a motion backwards needs the same torques."""
    back = GENTLY.model_copy(update={"start": GENTLY.goal, "goal": GENTLY.start})
    assert planned(back).cost == pytest.approx(planned(GENTLY).cost, rel=1e-6)


def test_more_time_needs_less_effort():
    efforts = [planned(in_time(T)).cost for T in (0.145, 0.17, 0.28)]
    assert efforts == sorted(efforts, reverse=True)


@pytest.mark.parametrize("limits", [{"torque_rate": 5000.0}, {"jerk": 5000.0}], ids=list)
def test_a_long_motion_with_ramps_waits_too(limits):
    """It costs little more than without them, and no less."""
    empty = PICK.model_copy(update={"payload": None})
    ramped = planned(in_time(0.6, empty.model_copy(update={"limits": limits})))
    assert verify(ramped.scene, ramped.trajectory).failures() == []
    free = planned(in_time(0.6, empty))
    assert 1 - 1e-3 < ramped.cost / free.cost < 1.05


@pytest.mark.parametrize("payload", [0.547, (0.109, 0.547)], ids=["one", "range"])
@pytest.mark.parametrize(("duration", "most"), [(0.65, 2.2), (1.1, 1.9)])
def test_little_effort_is_not_lost_in_another_valley(payload, duration, most):
    """The arms swing aside, to where they are light: the other way round they need 5 N²m²s."""
    lengths, masses = (0.18476, 0.2765), (0.51147, 0.22352, 0.31884)
    torque = (3.682, 5.433, 2.707)
    robot = robot_of("short forearms", (0.19984, 0.10659), lengths, masses, (torque, None))
    start, goal = (0.16312, -0.06205, 0.04563), (0.24366, -0.16966, -0.12254)
    scene = Scene(robot=robot, payload=payload, start=start, goal=goal)
    found = plan(in_time(duration, scene), tolerance=5e-3)
    assert verify(found.scene, found.trajectory).failures() == []
    assert found.cost < most


def test_a_long_motion_waits_where_little_torque_holds_it():
    """It is settled, keeps its limits, and costs little more than a shorter one."""
    empty, duration, less = PICK.model_copy(update={"payload": None}), 6, 1
    found = planned(in_time(duration, empty))
    assert found.duration == pytest.approx(duration, rel=1e-14)
    assert found.cost == pytest.approx(
        running_cost(problem_of(found.scene), found.trajectory, Running.EFFORT), rel=1e-15
    )
    highest = highest_rows(problem_of(found.scene), found.trajectory)
    of_torque = limits_of(found.scene).constraints.is_control
    assert highest.values[of_torque].max() <= 1
    torque = found.trajectory(duration * np.linspace(0.3, 0.7, 400)).tau
    rest, place = np.zeros((1, 3)), np.array([found.scene.start])
    held = found.trajectory.model.inverse_dynamics(place, rest, rest)
    assert (torque**2).sum(axis=1).mean() < (held**2).sum() / 20
    assert found.cost <= planned(in_time(less, empty)).cost + (duration - less) * 0.05


def test_none_is_beaten_by_one_of_another_duration():
    """A plan for 0.55 s to 1.5 s, slowed or sped up to the duration of another, costs no less."""
    plans = [planned(in_time(T)) for T in (0.55, 0.8, 1.0, 1.5)]
    for found, other in permutations(plans, 2):
        same = other.trajectory.slowed(found.duration / other.duration)
        most = running_cost(problem_of(found.scene), same, Running.EFFORT) * (1 + 1e-3)
        assert found.cost <= most or not verify(found.scene, same).ok


@pytest.mark.parametrize(
    ("scene", "weight", "duration"),
    [
        (ACROSS, 0.015, 0.55),
        (ACROSS, 0.04, 0.55),
        (LONG, 0.4, 0.7),
        (LONG, 4.0, 0.71),
    ],
)
def test_a_weight_of_effort_leads_where_a_given_duration_does(scene, weight, duration):
    """Slow motions go by way of a place where little torque holds the arms."""
    found = planned(weighted(weight, scene))
    other = planned(in_time(duration, scene))
    assert found.cost <= (other.duration + weight * other.cost) * (1 + 1e-3)
    assert verify(found.scene, found.trajectory).ok


def test_where_ends_move_in_much_longer_than_the_fastest():
    """From one velocity to another, past bodies, in 2.5 times as long."""
    scene = past_obstacle(CROSS.robot, 1, 42)
    longer = scene.model_copy(update={"objective": Effort(duration=2.5 * plan(scene).duration)})
    found = planned(longer)
    assert found.duration == pytest.approx(longer.objective.duration)
    verified = verify(longer, found.trajectory)
    assert verified.ok, verified.failures()


def test_nothing_needs_less_effort():
    """Neither the straight line nor the fastest motion slowed down, in the same time."""
    fastest = plan(PICK)
    others = [deltaopt.baseline(GENTLY), fastest.trajectory.slowed(0.28 / fastest.duration)]
    costs = [running_cost(problem_of(GENTLY), other, Running.EFFORT) for other in others]
    assert min(costs) > 1.1 * planned(GENTLY).cost


@pytest.mark.parametrize(
    ("scene", "pose"),
    [(in_time(0.2, LIGHT), deltaopt.forward), (GENTLY, deltaopt.explicit)],
    ids=["forward", "explicit"],
)
def test_poses_agree(scene, pose):
    """Scenes for which other tests compile these poses too."""
    other = plan(scene, formulation=pose, intervals=8)
    assert other.cost == pytest.approx(planned(scene).cost, rel=2e-5)
    assert verify(scene, other.trajectory).ok


def test_without_weight_on_effort_it_is_the_fastest():
    fastest = plan(PICK, tolerance=1e-5)
    heavy, light = (planned(weighted(weight)) for weight in (1e-3, 3e-5))
    assert fastest.duration < light.duration < heavy.duration
    assert light.duration == pytest.approx(fastest.duration, rel=1e-3)
    for found in (heavy, light):  # better in its own objective than the other is
        assert found.cost < cost(problem_of(found.scene), fastest.trajectory)


def test_only_the_ratio_of_the_weights_counts():
    scene = PICK.model_copy(update={"objective": TimeAndEffort(time=3.0, effort=3e-3)})
    assert planned(scene).cost == pytest.approx(3 * planned(weighted(1e-3)).cost, rel=1e-9)


def test_a_duration_shorter_than_the_fastest():
    with pytest.raises(Infeasible, match=r"^duration is 0.14 s, but the fastest motion .* 0.1409"):
        plan(in_time(0.14))
    with pytest.raises(Infeasible, match=r"^duration is 0.19 s, but the straight line .* 0.1965"):
        deltaopt.baseline(in_time(0.19))


def test_starts_are_compared_by_cost():
    found = plan(GENTLY, tolerance=1e-2, starts=2)
    assert sum(o.starts for o in found.optima) == 2
    assert found.cost == found.optima[0].cost


def smooth(objective, scene=PICK):
    scene = scene.model_copy(update={"objective": objective})
    found = planned(scene)
    report = verify(scene, found.trajectory)
    assert report.ok, report.failures()
    return found


def test_least_jerk_in_a_long_time_is_a_quintic():
    """On the straight line, whatever the robot is: ∫ ‖jerk‖² dt is 720 d² / T⁵."""
    start, goal, T = np.array(PICK.start), np.array(PICK.goal), 0.8
    found = smooth(SmoothMotion(duration=T))
    d = float(np.linalg.norm(goal - start))
    assert found.cost == pytest.approx(720 * d**2 / T**5, rel=1e-3)
    s = np.linspace(0, 1, 50)
    line = start + (s**3 * (10 - 15 * s + 6 * s**2))[:, None] * (goal - start)
    np.testing.assert_allclose(found.trajectory(T * s).x, line, atol=1e-3 * d)


def test_time_and_jerk_without_limits_that_count():
    """T + w 720 d² / T⁵ is least at T⁶ = 3600 w d²."""
    d, w = float(np.linalg.norm(np.subtract(PICK.goal, PICK.start))), 1e-4
    found = smooth(TimeAndJerk(jerk=w))
    assert found.duration == pytest.approx((3600 * w * d**2) ** (1 / 6), rel=1e-3)
    assert found.cost == pytest.approx(1.2 * found.duration, rel=1e-3)  # w 720 d² / T⁵ is T / 5


def torque_rates_squared(motion, bumps=()):
    """∫ ‖dτ/dt‖² dt of a motion that polynomials are added to, one for each coordinate, by
    differences of torques, N²m²/s."""
    t = np.linspace(0, motion.duration, 20_001)
    at = motion(t)
    x, v, a = at.x.copy(), at.v.copy(), at.a.copy()
    for i, bump in enumerate(bumps):
        for order, own in enumerate((x, v, a)):
            own[:, i] += (bump if order == 0 else bump.deriv(order))(t)
    torques = motion.model.inverse_dynamics(x, v, a)
    return float((np.diff(torques, axis=0) ** 2).sum() / (t[1] - t[0]))


def test_least_torque_rates_are_least():
    """Motions beside it that begin and end as smoothly ask for more."""
    found = smooth(SmoothTorque(duration=0.4))
    motion, rng = found.trajectory, np.random.default_rng(5)
    least = torque_rates_squared(motion)
    assert found.cost == pytest.approx(least, rel=1e-3)
    ends = Polynomial.fromroots([0, 0, 0, 0.4, 0.4, 0.4]) / 0.2**6
    for _ in range(12):
        along = [Polynomial(rng.uniform(-2e-3, 2e-3, 3)) for _ in range(3)]
        bumps = [ends * each(Polynomial([-1, 5])) for each in along]
        more = torque_rates_squared(motion, bumps) - least
        less = torque_rates_squared(motion, [-bump for bump in bumps]) - least
        assert more > 0
        assert less > 0
        assert abs(more - less) < 0.5 * (more + less)  # mostly of second order


def test_one_percent_more_time():
    """A tenth of the jumps and less: torques turn back no faster than ramps of a millisecond."""
    found, fastest = smooth(SmoothTorque(of_fastest=1.01)), planned(PICK)
    assert found.duration == pytest.approx(1.01 * fastest.duration, rel=1e-3)
    assert found.trajectory.acceleration_jump < 1e-6 * fastest.trajectory.acceleration_jump


def test_a_smooth_motion_through_a_point_past_a_wall():
    wall = [{"box": {"from": (0.8, -0.01, -1.0), "to": (2.0, 0.01, 1.0)}}]
    via, tool = [(0.77, 0.0, 0.02)], {"radius": 0.01}
    scene = CROSS.model_dump() | {"via": via, "keep_out": wall, "tool": tool}
    for objective in (SmoothTorque(of_fastest=1.1), TimeAndTorqueRate(torque_rate=1e-9)):
        found = smooth(objective, deltaopt.Scene.model_validate(scene))
        assert found.trajectory.acceleration_jump < 1e-6


def test_a_share_of_the_fastest_duration_holds_past_a_body():
    """Ways past bodies were planned in the duration of their first guess instead."""
    wall = load_scene("problems/keep_out/wall_25_305_25.yaml")
    found = plan(wall.model_copy(update={"objective": Effort(of_fastest=1.1)}), tolerance=1e-2)
    assert found.duration == pytest.approx(1.1 * plan(wall).duration, rel=3e-3)
    assert verify(found.scene, found.trajectory).ok


def test_a_share_of_the_fastest_is_one_of_the_fastest_over_a_sheet():
    """From other first motions the fastest over a thin sheet takes up to 1.44 times as long."""
    half = 0.0005 / 2
    sheet = deltaopt.Body(box={"from": (0.78, -half, -0.6), "to": (1.3, half, 0.6)})
    ends = {"start": (0.85, -0.15, 0.0), "goal": (0.83, 0.15, 0.05)}
    over = CROSS.model_copy(update={"keep_out": (sheet,), **ends})
    gently = over.model_copy(update={"objective": Effort(of_fastest=1.05)})
    found, fastest = plan(gently, starts=2), plan(over)
    assert found.duration == pytest.approx(1.05 * fastest.duration, rel=2e-3)
    assert verify(gently, found.trajectory).ok
