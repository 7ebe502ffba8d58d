"""Cycles: legs and pauses together, against another transcription of all of them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import deltaopt
from deltaopt import (
    Belt,
    Cycle,
    Effort,
    Infeasible,
    Robot,
    Scene,
    SceneError,
    State,
    TimeAndEffort,
    TimeAndEfforts,
    load_robot,
    plan,
    plan_cycle,
)
from deltaopt.motion.running_cost import squared_torques
from deltaopt.output.cycle_files import verified
from deltaopt.robot.drive import Friction
from deltaopt.scene.bodies import Body
from deltaopt.scene.path import Line
from studies.bench.hard_moves import robot_of
from studies.problems import PROBLEMS
from tests.oracles.cycle import Asked, Leg, best_cycle

INDUSTRIAL, HORNET = (
    load_robot(PROBLEMS / "robots" / f"{name}.yaml") for name in ("industrial", "hornet_565")
)
WEIGHT = 5e-4
"""Of the effort beside the duration, 1/(N²m²)."""
LIGHT = (0.8, -0.1525, 0.0), (0.8, 0.1525, 0.0)
HERE, THERE = (0.85, -0.1525, 0.0), (0.85, 0.1525, 0.0)


def cycle(robot=INDUSTRIAL, dwells=(0.05, 0.0), **more):
    """There with 1 kg and back without."""
    there = Scene(robot=robot, payload=1.0, start=HERE, goal=THERE)
    return Cycle(legs=(there, Scene(robot=robot, start=THERE, goal=HERE)), dwells=dwells, **more)


@cache
def planned(asked: Cycle, tolerance: float = 5e-3) -> deltaopt.CyclePlan:
    """The plan of a cycle that several tests look at."""
    return plan_cycle(asked, tolerance=tolerance)


def dense_rms(found):
    """Of the whole period, by Simpson's rule on 100,001 instants: torques that jump between two of
    them are missed by 1e-5, about."""
    t = np.linspace(0, found.period, 100_001)
    weights = np.ones(len(t))
    weights[1:-1:2], weights[2:-1:2] = 4, 2
    return np.sqrt(weights @ found.trajectory(t).tau ** 2 / (3 * (len(t) - 1)))


def belt_cycle():
    at, belt = (0.85, 0.15, -0.05), (0.0, 0.0, 0.3)
    onto = Scene(robot=INDUSTRIAL, start=HERE, goal=Belt(at=at, belt=belt))
    off = Scene(robot=INDUSTRIAL, payload=1.0, start=State(at=at, velocity=belt), goal=HERE)
    asked = Asked(INDUSTRIAL, HERE, (Leg(at, None, 0.04, belt), Leg(HERE, 1.0, 0.03)), rated=22.0)
    return Cycle(legs=(onto, off), dwells=(0.04, 0.03), rms_torque=22.0), asked


def rated_cycle():
    """By default motors may be as warm as they are rated for."""
    rated = HORNET.rms_torque
    legs = Leg(THERE, 1.0, 0.03), Leg(HERE, dwell=0.03)
    return cycle(HORNET, (0.03, 0.03)), Asked(HORNET, HERE, legs, rated=rated)


@pytest.mark.parametrize("asked", [belt_cycle, rated_cycle])
def test_periods_are_those_of_a_program_over_all_legs(asked):
    ours, theirs = asked()
    found, other = planned(ours, 1e-4), best_cycle(theirs, 16, 1)
    assert found.gap <= 1e-4
    assert found.period == pytest.approx(other.period, rel=1e-4)
    assert (dense_rms(found) <= (1 + 5e-5) * np.array(ours.rms_limits)).all()
    assert verified(found).ok


def test_the_least_heat_in_a_period_is_that_of_a_program_over_all_legs():
    """The motors are as warm as they may be: the period is 2 % above the least, and what the
    oracle's durations are too long by takes more heat."""
    period = 0.343
    found = plan_cycle(cycle(rms_torque=22.0, period=period), tolerance=1e-4)
    legs = Leg(THERE, 1.0, 0.05), Leg(HERE)
    other = best_cycle(Asked(INDUSTRIAL, HERE, legs, rated=22.0, period=period), 16, 1)
    assert found.period == pytest.approx(period, rel=1e-12)
    heat = period * (np.array(found.rms_torque) ** 2).sum() / 22.0**2
    assert heat == pytest.approx(other.heat, rel=3e-4)


@pytest.mark.parametrize(
    ("ends", "factor"), [(HERE, 1.02), (Belt(at=HERE, belt=(0.0, 0.0, 0.05)), 1.001)]
)
def test_a_period_just_above_the_least_is_kept_with_no_more_heat_than_by_waiting(ends, factor):
    """The cycle of least period, which waits for the rest, keeps it too."""
    there = Scene(robot=INDUSTRIAL, payload=1.0, start=THERE, goal=ends)
    leaves = State(at=HERE, velocity=ends.belt) if isinstance(ends, Belt) else ends
    legs = there, Scene(robot=INDUSTRIAL, start=leaves, goal=THERE)
    least = plan_cycle(Cycle(legs=legs, rms_torque=22.0))
    period = factor * least.period
    found = plan_cycle(least.cycle.model_copy(update={"period": period}))
    waits = replace(least, dwells=(0.0, period - least.period))
    assert found.squares.sum() <= (1 + 1e-9) * waits.squares.sum()
    assert found.period == pytest.approx(period, rel=1e-9)
    assert found.gap <= 5e-3
    assert verified(found).ok
    with pytest.raises(Infeasible, match=f"the least .* is {least.period:.9g}"):
        plan_cycle(least.cycle.model_copy(update={"period": 0.99 * least.period}))


def test_more_rated_torque_saves_the_heat_in_a_period_that_its_price_says():
    colder, warmer = (
        plan_cycle(cycle(rms_torque=r, period=0.34), tolerance=1e-4) for r in (21.9, 22.1)
    )
    seen = -np.log(warmer.squares.sum() / colder.squares.sum()) / np.log(22.1 / 21.9)
    told = (sum(colder.prices) + sum(warmer.prices)) / 2
    assert told == pytest.approx(seen, rel=0.1)


def test_legs_of_motors_that_stay_cool_are_single_plans():
    found = plan_cycle(cycle())
    alone = [plan(scene).duration for scene in found.cycle.legs]
    assert [leg.duration for leg in found.legs] == pytest.approx(alone, rel=1e-3)
    assert found.period == pytest.approx(sum(alone) + 0.05, rel=1e-3)


def test_a_dwell_cools_both_legs():
    short, long = (planned(cycle(dwells=(d, 0.0), rms_torque=22.0)) for d in (0.02, 0.05))
    assert all(
        one.duration > other.duration for one, other in zip(short.legs, long.legs, strict=True)
    )
    assert short.period < long.period


def test_more_rated_torque_saves_what_its_price_says():
    colder, warmer = (plan_cycle(cycle(rms_torque=r), tolerance=1e-4) for r in (21.9, 22.1))
    seen = -np.log(warmer.period / colder.period) / np.log(22.1 / 21.9)
    assert sum(warmer.prices) == pytest.approx(seen, rel=0.05)


def test_bodies_via_points_and_ramps_go_into_legs():
    wall = [{"box": {"from": [0.825, -0.13, -0.5], "to": [1.5, 0.13, 0.5]}}]
    there = Scene(robot=INDUSTRIAL, payload=1.0, start=HERE, goal=THERE, keep_out=wall)
    back = Scene(robot=INDUSTRIAL, start=THERE, goal=HERE, via=[(0.8, 0.0, 0.03)])
    found = plan_cycle(Cycle(legs=(there, back), dwells=(0.03, 0.03), rms_torque=20.0))
    assert verified(found).ok
    assert found.gap < 5e-3
    assert (dense_rms(found) <= (1 + 5e-5) * 20.0).all()
    assert found.parts_per_minute == pytest.approx(60 / found.period)


def test_no_leg_is_left_at_a_poor_optimum():
    """Over a wall the motions near the fastest are 3 % dearer than others: at the prices that are
    told, legs planned alone sum up to no less than the period and its gap allow."""
    there = deltaopt.load_scene(PROBLEMS / "keep_out" / "wall_25_305_25.yaml")
    ends = {"start": there.goal, "goal": there.start, "payload": None}
    legs = (there, there.model_copy(update=ends))
    found = plan_cycle(Cycle(legs=legs, rms_torque=18.0), tolerance=5e-3)
    assert found.within_tolerance
    prices = np.array(found.prices) / 2
    time = 1 - prices.sum()
    priced = TimeAndEfforts(effort=tuple((prices / 18.0**2 / time).tolist()))
    alone = [plan(leg.scene.model_copy(update={"objective": priced})) for leg in found.legs]
    assert time * sum(each.cost for each in alone) >= found.period / 1.005


def test_verification_sees_what_is_wrong():
    found = planned(cycle(rms_torque=22.0))
    hotter = found.cycle.model_copy(update={"rms_torque": 21.5})
    told = verified(deltaopt.CyclePlan(hotter, found.legs, found.dwells)).failures()
    assert "the RMS torque of motor 1 is" in told[0]
    away = deltaopt.CyclePlan(found.cycle, found.legs[:1] * 2, found.dwells)
    assert any("from where the one before ends" in each for each in verified(away).failures())
    onto = plan_cycle(belt_cycle()[0], tolerance=1e-2)
    assert verified(onto).ok
    goal = Belt(at=(0.85, 0.15, -0.051), belt=(0.0, 0.0, 0.3))
    leg, off = onto.cycle.legs
    late = onto.cycle.model_copy(update={"legs": (leg.model_copy(update={"goal": goal}), off)})
    told = verified(deltaopt.CyclePlan(late, onto.legs, onto.dwells)).failures()
    assert told == ["a leg ends 1.00e-03 m from where the belt has brought its part"]


def test_what_cannot_be_is_said():
    with pytest.raises(Infeasible, match="no speed and no wait were found with which motors keep"):
        plan_cycle(cycle(rms_torque=0.5))
    with pytest.raises(Infeasible, match=r"period is 0\.1 s, but the fastest legs"):
        plan_cycle(cycle(period=0.1))
    path = Scene(robot=INDUSTRIAL, payload=1.0, start=HERE, goal=THERE, path="line")
    with pytest.raises(SceneError, match=r"cycle\[0\]\.path is 'on the .* a tube beside"):
        plan_cycle(
            Cycle(legs=(path, Scene(robot=INDUSTRIAL, start=THERE, goal=HERE)), rms_torque=9)
        )
    ends_fast = path.model_copy(update={"path": Line(speeds=(0.0, 0.3))})
    for others in ((0.0, 0.0), (0.3, 0.0)):  # the second goes on along the way back
        back = Scene(robot=INDUSTRIAL, start=THERE, goal=HERE, path=Line(speeds=others))
        with pytest.raises(SceneError, match=r"cycle\[.\]\.path\.speeds is .* begin and end at"):
            Cycle(legs=(ends_fast, back))
    with pytest.raises(SceneError, match=r"cycle\[1\]\.robot is 'A Delta of the .*; expected that"):
        Cycle(legs=(cycle().legs[0], cycle(HORNET).legs[1]))
    with pytest.raises(SceneError, match="a cycle ends where it begins"):
        Cycle(legs=(path, Scene(robot=INDUSTRIAL, start=THERE, goal=LIGHT[0])))


def test_equal_weights_of_motors_are_an_effort():
    scene = Scene(robot=INDUSTRIAL, payload=1.0, start=HERE, goal=THERE)
    one, three = (
        plan(scene.model_copy(update={"objective": objective}), tolerance=1e-5)
        for objective in (TimeAndEffort(effort=WEIGHT), TimeAndEfforts(effort=(WEIGHT,) * 3))
    )
    assert three.cost == pytest.approx(one.cost, rel=1e-6)
    assert three.duration == pytest.approx(one.duration, rel=1e-4)


def test_work_and_gears_of_a_period_by_dense_samples():
    """By every motor alone and by all together, and the mean of gears' torques, with the dwells."""
    found = plan_cycle(cycle(HORNET, rms_torque=0.8 * np.array(HORNET.rms_torque)))
    t, duty = np.linspace(0, found.period, 100_001), verified(found).duty
    motion = found.trajectory(t)
    power = motion.tau * motion.dtheta
    done = np.trapezoid(power.clip(min=0), t, axis=0)
    assert [each.work_done for each in duty.motors] == pytest.approx(done, rel=1e-4)
    drawn = np.trapezoid(power.sum(axis=1).clip(min=0), t)
    assert duty.work_drawn == pytest.approx(drawn, rel=1e-4)
    assert duty.work_drawn < 0.95 * done.sum()
    passed = motion.tau - (HORNET.drive.inertia or 0.0) * motion.ddtheta
    cubes = np.trapezoid(np.abs(passed) ** 3 * np.abs(motion.dtheta), t, axis=0)
    mean = np.cbrt(cubes / np.trapezoid(np.abs(motion.dtheta), t, axis=0))
    assert [each.gear_torque for each in duty.motors] == pytest.approx(mean, rel=1e-4)
    assert [each.rms_torque for each in duty.motors] == pytest.approx(dense_rms(found), rel=1e-4)


def test_a_cycle_that_starts_on_a_belt_is_the_one_that_starts_off_it():
    """In other words: the same legs in another order. The part of the second period is met where
    that of the first was."""
    asked, _ = belt_cycle()
    (onto, off), dwells, from_rest = asked.legs, asked.dwells, planned(asked, 1e-4)
    moving, v = onto.goal, np.array(onto.goal.belt)
    leaves = from_rest.legs[0].reached + 0.04 * v
    start = State(at=tuple(leaves), velocity=moving.belt)
    legs = (
        off.model_copy(update={"start": start}),
        Scene(robot=INDUSTRIAL, start=HERE, goal=Belt(at=start.at, belt=moving.belt)),
    )
    found = plan_cycle(Cycle(legs=legs, dwells=dwells[::-1], rms_torque=22.0), tolerance=1e-4)
    assert found.period == pytest.approx(from_rest.period, rel=2e-4)
    assert found.legs[1].reached == pytest.approx(leaves - 0.04 * v, abs=1e-9)
    assert verified(found).ok
    with pytest.raises(SceneError, match=r"period is 0\.5; expected none"):
        Cycle(legs=legs, period=0.5)


def test_what_is_left_of_a_period_is_waited_where_it_is_cool():
    """Held beside the middle two motors carry more than in it. Legs that pass a point at a velocity
    are not slowed to what is left of a period, which is waited."""
    beside, middle = (0.8, -0.4, 0.0), (0.8, 0.0, 0.0)
    passed = State(at=(0.8, -0.2, 0.0), velocity=(0.0, 1.0, 0.0))
    ends = [beside, passed, middle]
    legs = tuple(
        Scene(robot=INDUSTRIAL, start=a, goal=b, payload=1.0)
        for a, b in zip(ends, ends[1:] + ends[:1], strict=True)
    )
    found = plan_cycle(Cycle(legs=legs, dwells=(0.0, "free", "free"), period=3.0), tolerance=0.5)
    assert found.dwells[1] > 0.01
    assert found.dwells[2] == 0
    assert found.period == pytest.approx(3.0, rel=1e-12)
    assert verified(found).ok


@pytest.mark.parametrize(("period", "gap"), [(1.0, 1e-3), (2.0, 0.3)])
def test_legs_of_a_long_period_go_where_little_torque_holds_the_arms(period, gap):
    """As the motion of least effort in half of the period does: in the longer one as no price of
    time has it, so that the bound is that of a shorter one."""
    out = Scene(robot=INDUSTRIAL, start=HERE, goal=THERE, payload=1.0)
    back = Scene(robot=INDUSTRIAL, start=THERE, goal=HERE, payload=1.0)
    found = plan_cycle(Cycle(legs=(out, back), period=period))
    alone = plan(out.model_copy(update={"objective": Effort(duration=period / 2)}))
    assert found.squares.sum() == pytest.approx(2 * alone.cost, rel=1e-3)
    assert found.gap <= gap
    assert verified(found).ok


def test_a_dwell_on_a_belt_is_verified_as_a_motion():
    """Here a plate is in the way of the dwell alone."""
    onto, off = belt_cycle()[0].legs
    found = planned(Cycle(legs=(onto, off), dwells=(0.3, 0.0), rms_torque="none"))
    assert verified(found).ok
    x, _, z = found.legs[0].reached + 0.15 * np.array(onto.goal.belt)
    plate = {"box": {"from": (x - 0.01, 0.1, z - 1e-3), "to": (x + 0.01, 0.2, z + 1e-3)}}
    legs = [
        replace(leg, scene=leg.scene.model_copy(update={"keep_out": (Body.model_validate(plate),)}))
        for leg in found.legs
    ]
    failures = verified(replace(found, legs=tuple(legs))).failures()
    assert any(each.startswith("dwell after leg 1: ") and "clearance" in each for each in failures)


def test_a_dwell_on_a_belt_through_a_body_is_refused():
    onto, off = belt_cycle()[0].legs
    whole = planned(Cycle(legs=(onto, off), dwells=(0.3, 0.0), rms_torque="none"))
    x, _, z = whole.legs[0].reached + 0.15 * np.array(onto.goal.belt)
    for half, told in ((1e-3, ".* the clearance of tool is -"), (2e-5, "the tool is not clear of")):
        plate = {"box": {"from": (x - 0.01, 0.1, z - half), "to": (x + 0.01, 0.2, z + half)}}
        past = {"keep_out": (Body.model_validate(plate),)}
        legs = tuple(leg.model_copy(update=past) for leg in (onto, off))
        with pytest.raises(Infeasible, match=f"the dwell after leg 1: {told}"):
            plan_cycle(Cycle(legs=legs, dwells=(0.3, 0.0), rms_torque="none"))


def test_motors_cool_in_a_wait_where_no_speed_keeps_them_cool():
    """In the first dwell one motor holds more than its limit. With a second dwell of 0.6 s that is
    given the limit is kept in 1.3775 s; without it the robot may wait as long."""
    out = Scene(robot=INDUSTRIAL, start=(0.75, 0.0, 0.0), goal=(0.85, 0.1, 0.0), payload=1.0)
    back = Scene(robot=INDUSTRIAL, start=(0.85, 0.1, 0.0), goal=(0.75, 0.0, 0.0))
    found = plan_cycle(Cycle(legs=(out, back), dwells=(0.3, 0.3), rms_torque=3.3))
    assert verified(found).ok
    assert max(found.rms_torque) <= 3.3 + 1e-9
    assert found.dwells[1] > 0.3
    assert found.period < 1.01 * 1.3775


def test_slow_legs_cool_motors_sooner_than_a_wait_near_their_limits():
    """No prices lead to these legs, for longer ones are hotter: the cycle waited 6.6 s of 8.2 s."""
    lengths, masses = (0.74572, 2.50095), (2.0317, 2.6752, 7.412)
    torque = (106.92, 119.8, 175.84)
    robot = robot_of("long arms", (0.38054, 0.019215), lengths, masses, (torque, None))
    here, there = (2.17683, -0.26165, -0.77922), (2.66329, 0.09588, -0.74486)
    legs = (
        Scene(robot=robot, payload=(2.6228, 13.1139), start=here, goal=there),
        Scene(robot=robot, start=there, goal=here),
    )
    found = plan_cycle(Cycle(legs=legs, rms_torque=(55.4, 53.43, 89.31)), tolerance=3e-2)
    assert verified(found).failures() == []
    assert found.period < 2.6
    assert found.dwells == (0.0, 0.0)


def test_legs_that_end_moving_and_hardly_keep_their_limits_are_planned():
    """Under friction both legs leap from one motion to another as prices change, to and fro about
    the limits, which no round kept by a thousandth, and the cycle was refused."""
    friction = Friction(viscous=0.8, coulomb=4.0, speed=0.05)
    drive = INDUSTRIAL.drive.model_copy(update={"friction": friction})
    robot = INDUSTRIAL.model_copy(update={"drive": drive})
    slow = State(
        at=(0.7567446582750361, -0.1614436759557476, -0.31387129943508374),
        velocity=(0.1232284328824792, -0.06892021592421498, 0.03769090331550445),
    )
    fast = State(
        at=(0.6190197688000134, 0.04527044914703904, -0.2203866825667372),
        velocity=(-0.9886530530669071, -1.353976532190008, -0.3374542817651709),
    )
    ends = ((slow, fast), (fast, slow))
    legs = tuple(
        Scene(robot=robot, payload=0.4622392543828292, start=start, goal=goal)
        for start, goal in ends
    )
    found = plan_cycle(Cycle(legs=legs, rms_torque=24.0))
    assert verified(found).ok
    assert max(found.rms_torque) <= 24.0 + 1e-9


def test_what_rules_a_leg_out_has_its_number():
    onto, off = belt_cycle()[0].legs
    with pytest.raises(Infeasible, match="leg 2: start: the platform cannot be at"):
        plan_cycle(Cycle(legs=(onto, off), dwells=(9.0, 0.0), rms_torque=22.0))


def test_a_looser_limit_of_rms_torque_makes_no_cycle_with_a_belt_longer():
    """About the looser one the motors leap from round to round, of which few keep it."""
    robot = Robot(
        name="small",
        base_radius=0.0546,
        platform_radius=0.0097,
        upper_arm={"length": 0.0943, "mass": 0.1121, "radius": 0.0094},
        forearm={"length": 0.2843, "mass": 0.0593, "radius": 0.0066},
        platform={"mass": 0.1078},
        drive={"torque": 1.9644, "speed": 5.097},
    )
    at, start = (0.2928927, 0.0433412, -0.00943), (0.2947787, -0.0433412, 0.004715)
    goal = Belt(at=at, belt=(0.0, 0.0, 0.01886))
    onto = Scene(robot=robot, payload=0.0539, start=start, goal=goal)
    off = Scene(robot=robot, start=State(at=at, velocity=goal.belt), goal=start)
    tight, loose = (
        plan_cycle(Cycle(legs=(onto, off), dwells=(0.02, 0.01), rms_torque=r))
        for r in (0.864336, 0.903624)
    )
    assert loose.period < tight.period


def test_a_limit_that_the_fastest_cycle_hardly_breaks_costs_hardly_more():
    """Legs leap between two motions there; with a tighter limit they do not."""
    back, at = (0.85, 0.1, 0.0), (0.85, -0.1, 0.0)
    goal = Belt(at=at, belt=(0.0, 0.0, 0.3))
    onto = Scene(robot=INDUSTRIAL, start=back, goal=goal)
    off = Scene(robot=INDUSTRIAL, start=State(at=at, velocity=goal.belt), goal=back, payload=0.5)
    tight, loose = (
        plan_cycle(Cycle(legs=(onto, off), dwells=(0.02, 0.02), rms_torque=r), tolerance=1e-5)
        for r in (34.0, 35.5)
    )
    assert loose.gap <= 1e-5
    assert loose.period <= tight.period


def test_rms_torques_are_kept_with_every_mass_of_a_range():
    """Counterweights hold the arms of a robot that carries a part: without it its motors are the
    hotter ones. Squared torques are convex in the mass, so that no mass in between is worse."""
    robot = Robot(
        name="counterweights",
        base_radius=0.2,
        platform_radius=0.045,
        upper_arm={"length": 0.235, "mass": 8.0, "centre": (-0.15, 0.0), "inertia": 0.05},
        forearm={"length": 0.8, "mass": 0.2},
        platform={"mass": 0.3},
        drive={"torque": 60.0, "speed": 8.0},
    )
    there = Scene(robot=robot, payload=(0.0, 2.0), start=HERE, goal=THERE)
    back = there.model_copy(update={"start": THERE, "goal": HERE})
    found = plan_cycle(Cycle(legs=(there, back), dwells=(1.0, 0.0), rms_torque=9.0), tolerance=0.1)
    rms = {}
    for mass in (0.0, 1.0, 2.0):
        model = deltaopt.DeltaModel(robot, mass or None)
        parts = (replace(part, model=model) for part in found.trajectory.parts)
        rms[mass] = np.sqrt(sum(map(squared_torques, parts)) / found.period)
        assert rms[mass].max() < 9.0 * (1 + 1e-6)
    assert rms[0.0].max() > rms[2.0].max()
    verification = verified(found)
    assert verification.ok
    assert max(verification.rms_torque) >= rms[0.0].max() * (1 - 1e-9)
