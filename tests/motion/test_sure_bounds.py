"""Bounds of convex limits between samples: never below what dense samples show, and close to it."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.motion.sure_bounds import are_crossed, signed_distances, sure_excess
from deltaopt.motion.time_scaling import needed_slowing
from deltaopt.planning.first_motions.initial_motion import curve_between
from deltaopt.problem.of_scene import problem_of
from tests.limits.test_keep_out import BODIES, HULL, SPHERE, with_bodies

SCALE = 0.25 * 0.15
"""Natural size of distances in these scenes: a quarter of the way."""


def random_motion(rng: np.random.Generator, pieces: int, degree: int) -> PiecewisePolynomial:
    """Through the bodies and around them, in s."""
    knots = np.append(0.0, np.cumsum(rng.uniform(0.01, 0.05, pieces)))
    coefficients = rng.normal(size=(pieces, degree + 1, 3)) * 0.03
    coefficients /= np.diff(knots)[:, None, None] ** np.arange(degree + 1)[:, None]
    coefficients[:, 0] += [0.45, 0.0, 0.0]
    return PiecewisePolynomial(knots, coefficients)


@pytest.mark.parametrize("degree", [3, 5, 15])
def test_the_bound_holds_and_is_close(degree):
    """Where a motion is too near, the bound is within a tenth of the excess; where it is clear,
    that is what is said."""
    rng, scene = np.random.default_rng(degree), with_bodies(*BODIES, HULL)
    motion = random_motion(rng, 40, degree)
    found = sure_excess(problem_of(scene), motion) * SCALE
    share = np.linspace(0, 1, 2001)
    pieces = np.repeat(np.arange(40), len(share))
    x = motion.inside(pieces, np.diff(motion.knots)[pieces] * np.tile(share, 40))
    least = signed_distances(problem_of(scene), x)[0].reshape(40, len(share), -1).min(axis=1)
    assert (found >= -least - 1e-12).all()
    assert ((found <= 0) == (least >= 0)).mean() > 0.99  # but for grazes that samples miss
    inside = least < 0
    assert inside.any()
    assert (found[inside] <= 1.2 * -least[inside] + 1e-6).all()


def test_slowing_does_not_help():
    """A line through the middle of a sphere is as far inside of it as its radius, at any speed."""
    scene = with_bodies(SPHERE, goal=[0.45, 0.12, 0.01], start=[0.45, -0.05, 0.01])
    line = curve_between(scene)
    assert sure_excess(problem_of(scene), line.position).max() * 0.25 * 0.17 == pytest.approx(
        0.03, rel=0.1
    )
    needed = needed_slowing(problem_of(scene), line)
    assert not needed.keeps_places
    assert needed.misplaced > 0.5


@pytest.mark.parametrize("gap", [1e-7, -1e-7])
def test_a_graze_is_told_from_a_touch(gap):
    """A parabola whose top is a ten-millionth of a metre beside a plane, or beyond it."""
    plane = {"half_space": {"point": [0.5, 0.0, 0.0], "normal": [1.0, 0.0, 0.0]}}
    scene = with_bodies(plane)
    top = 0.31234567
    coefficients = np.zeros((1, 3, 3))
    coefficients[0, :, 0] = [0.5 - gap - 4 * top**2, 8 * top, -4]
    motion = PiecewisePolynomial(np.array([0.0, 1.0]), coefficients)
    excess = float(sure_excess(problem_of(scene), motion).max()) * SCALE
    assert (excess <= 0) == (gap > 0)
    if gap < 0:
        assert -gap <= excess <= -1.11 * gap


def test_straight_lines_that_lead_through_a_body_are_found():
    """Whether lines through bodies and around them are within each, as dense samples show it."""
    rng, problem = np.random.default_rng(3), problem_of(with_bodies(*BODIES, HULL))
    begin = rng.normal(size=(400, 3)) * 0.06 + [0.45, 0.0, 0.0]
    along = rng.normal(size=(400, 3)) * 0.05
    x = begin[:, None] + np.linspace(0, 1, 4001)[:, None] * along[:, None]
    least = signed_distances(problem, x.reshape(-1, 3))[0].reshape(*x.shape[:2], -1).min(axis=1)
    lines, bodies = np.indices(least.shape).reshape(2, -1)
    found = are_crossed(problem, begin[lines], along[lines], bodies).reshape(least.shape)
    assert (found == (least < 0))[np.abs(least) > 1e-7].all()
    assert 200 < found.sum() < 800


@pytest.mark.parametrize("gap", [1e-9, -1e-7])
def test_a_line_that_touches_a_sphere_is_told_from_one_that_leads_into_it(gap):
    """A tangent of a sphere, moved by a nanometre away from it, or by a tenth of a micrometre
    into it."""
    problem = problem_of(with_bodies(SPHERE))
    x, y, z = SPHERE["sphere"]["centre"]
    begin = np.array([[x, y + SPHERE["sphere"]["radius"] + gap, z - 0.0123456]])
    found = are_crossed(problem, begin, np.array([[0.0, 0.0, 0.04]]), np.array([0]))
    assert found[0] == (gap < 0)
