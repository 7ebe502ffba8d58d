"""The least clearance of motions, by verification's own distances and bound."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.motion.sure_bounds import signed_distances
from deltaopt.planning.first_motions.initial_motion import curve_between, roughly_fastest
from deltaopt.problem.of_scene import problem_of
from deltaopt.verify.clearance import clearance_excess, least_clearance
from deltaopt.verify.verification import verify
from tests.limits.test_keep_out import BODIES, HULL, SPHERE, with_bodies
from tests.motion.test_sure_bounds import random_motion


def test_no_dense_sample_is_nearer():
    scene = with_bodies(*BODIES, HULL)
    motion = random_motion(np.random.default_rng(8), 6, 3)
    dense = np.linspace(*motion.knots[[0, -1]], 100_001)
    distances = signed_distances(problem_of(scene), motion.at(dense))[0]
    for (_, body), least in zip(scene.obstacles, distances.min(axis=0), strict=True):
        found, t = least_clearance(body, motion, asked=-1.0)
        asked, _ = least_clearance(body, motion, asked=float(least) + 1e-3)
        assert asked <= least + 1e-10
        assert asked >= least - 1e-5
        assert found >= asked - 1e-10
        assert motion.knots[0] <= t <= motion.knots[-1]


@pytest.mark.parametrize("by", [1e-8, -1e-8])
def test_a_hundredth_of_a_micrometre_is_told(by):
    """A motion on an arc about a sphere, a cubic that is nearest at an instant of its own."""
    scene = with_bodies(SPHERE, clearance=0.004)
    (_, body) = scene.obstacles[0]
    rng = np.random.default_rng(2)
    coefficients = np.zeros((1, 4, 3))
    coefficients[0, 1:] = rng.normal(size=(3, 3)) * 0.1
    path = PiecewisePolynomial(np.array([0.0, 1.0]), coefficients)
    centre = np.array(SPHERE["sphere"]["centre"])
    at = path.at(np.array([0.4]))[0]
    v = path.derivative().at(np.array([0.4]))[0]
    across = np.cross(v, [0.0, 0.0, 1.0])
    across /= -np.linalg.norm(across)
    away = 0.034 + by
    coefficients[0, 0] = centre + away * across - at
    found, _ = least_clearance(body, path, asked=0.004)
    dense = path.at(np.linspace(0.39, 0.41, 200_001))
    least = np.linalg.norm(dense - centre, axis=1).min() - 0.03
    assert found <= least + 1e-9  # to which it is looked for where the motion is clear
    assert (found >= 0.004 - 1e-9) == (least >= 0.004)


def test_a_motion_through_a_body_fails_with_a_sentence():
    scene = with_bodies(SPHERE, start=[0.45, -0.05, 0.01], goal=[0.45, 0.12, 0.01])
    line = roughly_fastest(scene, curve_between(scene)).slowed(1.5)
    found = verify(scene, line)
    assert not found.ok
    assert found.clearance_excess == pytest.approx(0.03, abs=1e-6)
    sentence, helpless = found.failures()
    assert "clearance of tool from keep_out[0] is 0.03 m below its limit at t = " in sentence
    assert helpless.startswith("slowing it down does not help")
    assert found.safe_duration == np.inf
    (told,) = (e for e in found.as_dict()["limits"].values() if e["unit"] == "m")
    assert told["subject"] == "tool from keep_out[0]"


def test_without_bodies_there_is_no_clearance():
    scene = with_bodies(SPHERE).model_copy(update={"keep_out": None})
    motion = roughly_fastest(scene, curve_between(scene)).slowed(1.5)
    assert clearance_excess(scene, motion) is None
    assert verify(scene, motion).clearance_excess is None
