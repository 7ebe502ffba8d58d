"""Verification: measures against independent values, and bad motions that must not pass."""

from __future__ import annotations

import json
from dataclasses import replace
from math import factorial, inf, nan, pi
from pathlib import Path

import numpy as np
import pytest

from deltaopt.errors import Infeasible, Unreachable
from deltaopt.motion.extrema import everywhere, peaks, sample_fractions
from deltaopt.motion.time_scaling import safe_factor, speed_excess, torque_excess
from deltaopt.motion.trajectory import PiecewisePolynomial, Trajectory
from deltaopt.planning.initial_motion import baseline, straight_line
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene import Limits, load_scene
from deltaopt.verify.verification import Verification, verify

PROBLEMS = Path(__file__).parents[2] / "problems"
SCENE = load_scene(PROBLEMS / "pick_and_place.yaml")
INDUSTRIAL = load_scene(PROBLEMS / "industrial_cross.yaml")
LINE = baseline(SCENE)


def cut(trajectory: Trajectory, intervals: int) -> Trajectory:
    """The same motion of one polynomial, written as several."""
    whole = trajectory.position
    knots = np.linspace(whole.knots[0], whole.knots[-1], intervals + 1)
    pieces, derivative = [], whole
    for order in range(whole.coefficients.shape[1]):
        first = np.zeros(intervals, dtype=np.intp)
        pieces.append(derivative.inside(first, knots[:-1] - knots[0]) / factorial(order))
        derivative = derivative.derivative()
    return replace(trajectory, position=PiecewisePolynomial(knots, np.stack(pieces, axis=1)))


def changed(trajectory: Trajectory, power: int, by: object, interval: int = -1) -> Trajectory:
    """A motion with something added to the coefficients of a power of time in an interval."""
    coefficients = trajectory.position.coefficients.copy()
    coefficients[interval, power] += by
    return replace(trajectory, position=replace(trajectory.position, coefficients=coefficients))


def scene_with(**changes: object):
    return SCENE.model_copy(update=changes)


# What a good motion measures


@pytest.mark.parametrize("scene", [SCENE, INDUSTRIAL], ids=["orsino", "industrial"])
@pytest.mark.parametrize("intervals", [1, 40])
def test_good_motion_passes(scene, intervals):
    found = verify(scene, cut(baseline(scene), intervals))
    assert found.ok
    assert found.failures() == []
    assert abs(found.torque_excess) < 1e-12
    assert found.safe_duration == pytest.approx(found.duration, rel=1e-12)
    assert found.kinematic_error < 1e-14
    assert found.dynamic_error < 1e-11
    assert found.arrival_distance < 1e-10
    assert found.arrival_speed < 1e-9
    assert (found.speed_excess is None) == (scene.speed_limits is None)


def test_peaks_between_samples():
    """Known maxima of smooth functions, none at a sample, one hill at the very edge."""
    tops = np.array([0.512345, 1.987654, 0.001, 2.999])

    def curves(intervals, fractions):
        t = (intervals + fractions)[:, None]
        return np.cos(2 * pi * (t - tops) / 7) * np.array([1.0, 2.0, 3.0, 4.0])

    fractions = sample_fractions(3)
    highest = peaks(curves, fractions, curves(*everywhere(3, fractions)))
    np.testing.assert_allclose(highest.values, [1, 2, 3, 4], rtol=1e-12)
    np.testing.assert_allclose(highest.intervals + highest.fractions, tops, atol=1e-5)


def test_peaks_see_both_sides_of_a_knot():
    def curves(intervals, fractions):
        return np.where(intervals == 0, fractions, -1 - fractions)[:, None]

    fractions = sample_fractions(2)
    highest = peaks(curves, fractions, curves(*everywhere(2, fractions)))
    assert highest.values[0] == 1.0
    assert (highest.intervals[0], highest.fractions[0]) == (0, 1.0)


@pytest.mark.parametrize("intervals", [1, 7, 40, 500])
def test_sampled_as_densely_as_defined(intervals):
    fractions = sample_fractions(intervals)
    assert (fractions[0], fractions[-1]) == (0, 1)
    assert len(fractions) >= 22


def test_excess_is_the_largest_ratio():
    """Against samples a hundred times as dense, off the peak by their spacing squared."""
    fast = baseline(INDUSTRIAL).slowed(0.5)
    motion = fast(np.linspace(0, fast.duration, 20_001))
    torque = (np.abs(motion.tau) / INDUSTRIAL.torque_limits).max() - 1
    speed = (np.abs(motion.dtheta) / INDUSTRIAL.speed_limits).max() - 1
    assert 0 <= torque_excess(INDUSTRIAL, fast).value - torque < 1e-6
    assert 0 <= speed_excess(INDUSTRIAL, fast).value - speed < 1e-6


def test_excess_says_where():
    found = torque_excess(SCENE, LINE.slowed(0.9))
    ratio = np.abs(LINE.slowed(0.9)(found.t).tau[0]) / SCENE.torque_limits - 1
    assert np.argmax(ratio) == found.motor - 1
    assert ratio.max() == pytest.approx(found.value, rel=1e-9)


@pytest.mark.parametrize("limits", [Limits(torque=(9.0, 4.0, 10.0)), Limits(speed=3.0)])
def test_safe_factor_is_the_smallest(limits):
    """By bisection of the excesses, which know nothing of how torques scale with time."""
    scene = scene_with(limits=limits)
    fast = LINE.slowed(0.3)
    low, high = 0.1, 100.0
    for _ in range(60):
        middle = (low * high) ** 0.5
        slowed = fast.slowed(middle)
        speed = speed_excess(scene, slowed)
        excess = max(torque_excess(scene, slowed).value, -1 if speed is None else speed.value)
        low, high = (low, middle) if excess <= 0 else (middle, high)
    assert safe_factor(scene, fast, at_least=0) == pytest.approx(high, rel=1e-9)
    assert safe_factor(scene, fast.slowed(2 * high)) == 1


def test_safe_factor_is_infinite_where_gravity_alone_is_too_much():
    weak = scene_with(limits=Limits(torque=1.4))
    assert safe_factor(weak, LINE) == inf
    found = verify(weak, LINE)
    assert found.safe_duration == inf
    assert any("gravity alone" in sentence for sentence in found.failures())


def test_motion_may_help_against_gravity():
    """A platform that drops freely needs little torque where it could not be held."""
    drop = PiecewisePolynomial(
        np.array([0.0, 0.05]), np.array([[[0.45, 0, 0], [0, 0, 0], [4.9, 0, 0]]])
    )
    falling = Trajectory(drop, LINE.model)
    scene = scene_with(limits=Limits(torque=1.5))
    assert torque_excess(scene, falling).value < 0
    assert safe_factor(scene, falling) == 1
    assert safe_factor(scene, falling, at_least=10) == inf


# Motions that must fail, each with its sentence


def complaints(trajectory: Trajectory, scene=SCENE) -> str:
    found = verify(scene, trajectory)
    assert not found.ok
    return "; ".join(found.failures())


def test_sped_up():
    said = complaints(LINE.slowed(0.99))
    assert "a motor would need 1.7" in said
    assert f"slowed to {LINE.duration:.6g} s it would keep the limits" in said


def test_turns_too_fast():
    said = complaints(LINE, scene_with(limits=Limits(speed=3.0)))
    assert "% faster than its limit" in said


def test_another_goal():
    said = complaints(LINE, scene_with(goal=(0.45, 0.101, 0.0)))
    assert "it ends 0.001 m from the scene's goal" in said
    assert "its torques bring the platform to 0.001 m from the goal" in said


def test_another_start():
    said = complaints(LINE, scene_with(start=(0.451, -0.05, 0.0)))
    assert "it begins 0.001 m from the scene's start" in said


def test_wrong_payload():
    """The torques reported are those without the payload that the scene has."""
    light = replace(LINE, model=DeltaModel(SCENE.robot, payload=None)).slowed(1.5)
    said = complaints(light)
    assert "its torques give accelerations that differ by" in said
    assert "its torques bring the platform to" in said
    assert "more torque" not in said


def test_wrong_robot():
    """The coordinates reported are those of longer arms."""
    arm = SCENE.robot.upper_arm.model_copy(update={"length": 0.21})
    other = DeltaModel(SCENE.robot.model_copy(update={"upper_arm": arm}), SCENE.payload)
    assert "leave the loops open by" in complaints(replace(LINE, model=other).slowed(1.5))


def test_jumping_velocity():
    """The last piece starts 1 mm/s too fast and ends where it should."""
    whole = cut(LINE.slowed(1.5), 4)
    length = np.diff(whole.knots)[-1]
    v = np.array([0.001, 0, 0])
    bad = changed(changed(whole, 1, v), 2, -v / length)
    said = complaints(bad)
    assert "its velocity jumps by 0.001 m/s at a knot" in said
    assert "its position" not in said
    assert "it ends at 0.001 m/s instead of at rest" in said


def test_jumping_position():
    assert "its position jumps by 0.0005 m" in complaints(
        changed(cut(LINE.slowed(1.5), 4), 0, [0, 0.0005, 0], interval=1)
    )


def test_moving_start():
    bad = changed(LINE.slowed(1.5), 1, [0.002, 0, 0])
    assert "it begins at 0.002 m/s instead of at rest" in complaints(bad)


def test_excess_between_samples_of_a_coarse_grid():
    """A narrow peak of torque that a grid of knots and midpoints does not see."""
    whole = cut(LINE.slowed(1.2), 8)
    h = np.diff(whole.knots)[3]
    bump = np.poly(np.repeat([0.0, 0.5, 1.0], [3, 3, 3]))[::-1]  # s³ (s - ½)³ (s - 1)³
    coefficients = np.zeros((8, 10, 3))
    coefficients[:, :6] = whole.position.coefficients
    coefficients[3, :, 1] += 2.0 * bump / h ** np.arange(10)
    bad = replace(whole, position=PiecewisePolynomial(whole.knots, coefficients))
    coarse = bad.inside_intervals([0.0, 0.5, 1.0]).tau
    assert (np.abs(coarse) <= SCENE.torque_limits).all()
    assert "more torque than its limit" in complaints(bad)


def test_leaving_the_workspace():
    said = complaints(changed(LINE, 0, [1.0, 0, 0]))
    assert said.startswith("the platform cannot be at [1.45")
    assert "inf" not in said


@pytest.mark.parametrize("power", [0, 2])
def test_not_a_number(power):
    assert "the platform cannot be at" in complaints(changed(LINE, power, nan))


def test_time_that_stands_still():
    whole = cut(LINE, 3)
    knots = whole.knots.copy()
    knots[1] = knots[2]
    bad = replace(whole, position=replace(whole.position, knots=knots))
    assert complaints(bad) == "time does not increase from knot to knot"


def test_torques_that_cannot_be_followed():
    """Torques for a payload of 20 kg fling the lighter platform out of reach."""
    heavy = replace(LINE, model=DeltaModel(SCENE.robot, payload=20.0)).slowed(4.0)
    found = verify(SCENE, heavy)
    assert found.arrival_distance == inf
    assert any("CVODES failed" in sentence for sentence in found.failures())


def test_json_has_no_infinity():
    found = verify(SCENE, changed(LINE, 0, [1.0, 0, 0]))
    read = json.loads(json.dumps(found.as_dict(), allow_nan=False))
    assert read["ok"] is False
    assert read["arrival_distance"] is None
    assert read["failures"] == found.failures()


def test_nothing_measured_is_no_pass():
    assert not Verification(duration=1.0).ok
    assert Verification(duration=1.0).failures()
    assert not replace(verify(SCENE, LINE), torque_excess=nan).ok


# Scenes without a solution


def test_problems_are_feasible():
    for file in PROBLEMS.glob("*.yaml"):
        check_feasible(load_scene(file))


@pytest.mark.parametrize(
    ("changes", "error", "sentence"),
    [
        (
            {"start": (0.7, 0.0, 0.0)},
            Unreachable,
            r"start: the platform cannot be at \[0.7, 0, 0\] m: arm and bars of chain 1 cannot ",
        ),
        (
            {"goal": (0.45, 0.9, 0.0)},
            Unreachable,
            r"goal: the platform cannot be at \[0.45, 0.9, 0\] m: ",
        ),
        (
            {"goal": (-0.45, 0.05, 0.0)},
            Unreachable,
            r"goal: at \[-0.45, 0.05, 0\] m the platform is not below its elbows",
        ),
        (
            {"payload": 10.0},
            Infeasible,
            r"goal: motor 1 needs 13 N·m to hold .* at \[0.45, 0.1, 0\] m, more than its limit of"
            " 10 N·m",
        ),
    ],
)
def test_infeasible(changes, error, sentence):
    with pytest.raises(error, match=sentence):
        check_feasible(scene_with(**changes))


def test_straight_line_of_any_duration_is_checked():
    """A slow line is safe as it is; its safe duration is its own."""
    slow = straight_line(LINE.model, SCENE.start, SCENE.goal, 2.0)
    found = verify(SCENE, slow)
    assert found.ok
    assert found.safe_duration == 2.0
