"""Peaks of curves and slowing factors, as planning finds them."""

from __future__ import annotations

from math import inf, pi

import numpy as np
import pytest
from numpy.polynomial import Chebyshev

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.errors import Unreachable
from deltaopt.motion.extrema import (
    everywhere,
    narrow_valleys,
    peaks,
    ridges,
    sample_fractions,
)
from deltaopt.motion.time_scaling import highest_rows, safe_factor
from deltaopt.motion.trajectory import Trajectory
from deltaopt.planning.first_motions.initial_motion import baseline
from deltaopt.planning.planner import plan
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.drive import Friction
from deltaopt.robot.model import delta_model
from deltaopt.scene.known_limits import Limits
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import load_scene
from deltaopt.verify.measures import MeasuredMotion
from studies.problems import PROBLEMS

SCENE = load_scene(PROBLEMS / "pick_and_place.yaml")
LINE = baseline(SCENE)


def scene_with(**changes: object):
    return SCENE.model_copy(update=changes)


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


def test_errors_of_a_polynomial_peak_near_its_end():
    """A Chebyshev polynomial of one more than its degree, weighed so that its last hill is highest,
    which is narrower than those in the middle."""
    degree, pieces = 10, 23

    def curves(intervals, fractions):
        error = Chebyshev.basis(degree + 1)(2 * fractions - 1)
        return -(fractions**2 * error + 0 * intervals)[:, None]

    dense = np.linspace(0.9, 1.0, 100_001)
    fractions = sample_fractions(pieces, degree)
    highest = peaks(curves, fractions, curves(*everywhere(pieces, fractions)))
    assert highest.values[0] == pytest.approx(curves(0 * dense, dense).max(), rel=1e-8)


def test_ridges_between_samples():
    """Known kinks that rise and fall at different slopes, none at a sample: at the edge of an
    interval, one that bends on both sides, and one that a higher sample stands near."""
    tops = np.array([0.512345, 1.0003, 1.987654, 2.7771])
    heights = np.array([1.0, 2.0, 3.0, 4.0])
    rises, falls = np.array([0.1, 30.0, 2.0, 5.0]), np.array([3.0, 0.2, 2.5, 5.0])

    def curves(intervals, fractions):
        since = (intervals + fractions)[:, None] - tops
        ridge = heights + np.where(since < 0, rises, -falls) * since - [0, 0, 4.0, 0] * since**2
        hill = 3.999 - 100 * ((intervals + fractions) - 1.4) ** 2
        ridge[:, 3] = np.maximum(ridge[:, 3], hill)
        return ridge

    fractions = sample_fractions(3)
    sampled = curves(*everywhere(3, fractions))
    found = ridges(curves, fractions, sampled)
    np.testing.assert_allclose(found.values, heights, rtol=1e-9)
    np.testing.assert_allclose(found.intervals + found.fractions, tops, atol=1e-8)
    assert (peaks(curves, fractions, sampled).values < heights * (1 - 1e-7)).any()


@pytest.mark.parametrize("least", [1e-4, 1e-8, 1e-12])
@pytest.mark.parametrize("bottom", [0.3137, 0.5, 0.0041])
def test_peaks_in_valleys_that_samples_miss(least, bottom):
    """Of d^(-3/2), where d = least + 10 (t - bottom)²: known in closed form."""

    def valley(intervals, fractions):
        return (least + 10 * (fractions - bottom) ** 2)[:, None]

    def curves(intervals, fractions):
        return valley(intervals, fractions) ** -1.5

    fractions = sample_fractions(1)
    where = everywhere(1, fractions)
    highest = peaks(curves, fractions, curves(*where))
    windows = narrow_valleys(valley, fractions, valley(*where))
    windows.let_see(highest, curves)
    assert highest.values[0] == pytest.approx(least**-1.5, rel=1e-6)
    assert highest.fractions[0] == pytest.approx(bottom, abs=1e-6)


def grazing(distance: float) -> Scene:
    """Along a line on which chain 1 comes so near to being folded: sin² = 6 per m of distance."""
    x = 0.3 + distance
    return Scene(robot=SCENE.robot, payload=1.0, start=(x, 0.041, 0.0), goal=(x, 0.162, 0.0))


def test_the_nearer_to_the_singularity_the_slower():
    """The speed at the fold turns into torque as distance^(-1/2) times speed²."""
    durations = [baseline(grazing(10.0**-power)).duration for power in range(3, 11)]
    assert (np.diff(durations) > 0).all()
    np.testing.assert_allclose(np.array(durations[5:]) / durations[4:-1], 10**0.25, rtol=2e-3)


def test_a_line_that_leaves_the_workspace_between_samples():
    with pytest.raises(Unreachable, match="arm and bars of chain 1 cannot close"):
        baseline(grazing(-1e-9))


@pytest.mark.parametrize("limits", [Limits(torque=(9.0, 4.0, 10.0)), Limits(speed=3.0)])
def test_safe_factor_is_the_smallest(limits):
    """By bisection of the excesses, which know nothing of how torques scale with time."""
    scene = scene_with(limits=limits)
    fast = LINE.slowed(0.3)
    low, high = 0.1, 100.0
    for _ in range(60):
        middle = (low * high) ** 0.5
        slowed = fast.slowed(middle)
        found = MeasuredMotion(scene, slowed).excesses()
        excess = max(each.value for each in found.values())
        low, high = (low, middle) if excess <= 1e-13 else (middle, high)
    assert safe_factor(problem_of(scene), fast, at_least=0) == pytest.approx(high, rel=1e-9)
    assert safe_factor(problem_of(scene), fast.slowed(2 * high)) == 1


def test_safe_factor_is_infinite_where_gravity_alone_is_too_much():
    weak = scene_with(limits=Limits(torque=1.4))
    assert safe_factor(problem_of(weak), LINE) == inf


def test_motion_may_help_against_gravity():
    """A platform that drops freely needs little torque where it could not be held."""
    drop = PiecewisePolynomial(
        np.array([0.0, 0.05]), np.array([[[0.45, 0, 0], [0, 0, 0], [4.9, 0, 0]]])
    )
    falling = Trajectory(drop, LINE.model)
    scene = scene_with(limits=Limits(torque=1.5))
    assert MeasuredMotion(scene, falling).excesses()["torque_excess"].value < 0
    assert safe_factor(problem_of(scene), falling) == 1
    assert safe_factor(problem_of(scene), falling, at_least=10) == inf


def test_torques_peak_where_an_arm_turns_back_under_friction():
    """Coulomb friction changes sign within 0.4 ms, between samples: the largest torque of each
    motor is that of two million samples, and some of them are missed by less. The motion is planned
    with softer friction, so that no knots lie where arms turn back."""
    robot = load_scene(PROBLEMS / "industrial_cross.yaml").robot
    friction = {"viscous": 0.3, "coulomb": 2.0, "speed": 0.05}
    drive = robot.drive.model_copy(update={"friction": Friction(**friction)})
    soft = robot.drive.model_copy(update={"friction": Friction(**friction | {"speed": 2.0})})
    softer = robot.model_copy(update={"drive": soft})
    robot = robot.model_copy(update={"drive": drive})
    start = (0.7837085478432734, -0.3880897772689248, -0.2873463324706963)
    goal = (0.2807061266321203, 0.2622415211193392, 0.6269738006701839)
    scene = Scene(robot=robot, payload=0.7, start=start, goal=goal)
    position = plan(scene.model_copy(update={"robot": softer}), tolerance=1e-2).trajectory.position
    trajectory = Trajectory(position, delta_model(robot, 0.7))
    peaks_of_rows = highest_rows(problem_of(scene), trajectory).values[:3]

    def largest(samples: int):
        count = samples // (len(trajectory.knots) - 1)
        shares = [
            np.abs(trajectory.inside_intervals(part).tau).max(axis=0) / robot.torque_limits
            for part in np.array_split(np.linspace(0.0, 1.0, count), 20)
        ]
        return np.max(shares, axis=0)

    np.testing.assert_allclose(peaks_of_rows, largest(2_000_000), rtol=1e-7)
    fractions = sample_fractions(len(trajectory.knots) - 1)
    assert (largest(len(fractions) * len(trajectory.knots)) < peaks_of_rows - 1e-5).any()


INSIDE = [(begun, 2 / 24, 3.5) for begun in np.linspace(0.3, 0.5, 21)]
BEFORE = [(-share * 0.95 / 24, 0.95 / 24, 4.3) for share in (0.1, 0.5, 1.5, 2.5)]


@pytest.mark.parametrize(("begun", "w", "u"), INSIDE + BEFORE)
def test_a_peak_some_half_widths_beside_a_reversal_is_found(begun, w, u):
    """Of c tanh u - k t, u = (t - t₀) / w: it is highest where cosh² u = c / (k w), some
    half-widths w beside the reversal at t₀. That may lie before the interval too: so a campaign
    found a torque 9e-8 above its limit."""
    c = 0.05
    k = c / (w * np.cosh(u) ** 2)

    def curve(_, t: np.ndarray) -> np.ndarray:
        return (c * np.tanh((t - begun) / w) - k * t)[:, None]

    def valley(_, t: np.ndarray) -> np.ndarray:
        return 1 + (((t - begun) / w) ** 2)[:, None]

    fractions = np.linspace(0.0, 1.0, 25)
    where = everywhere(1, fractions)
    highest = peaks(curve, fractions, curve(*where))
    narrow_valleys(valley, fractions, valley(*where)).let_see(highest, curve)
    expected = c * np.tanh(u) - k * (begun + u * w)
    assert highest.values[0] == pytest.approx(expected, abs=1e-12)
