"""How near arms and forearms come to bodies."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest

from deltaopt.motion.sure_bounds import signed_distances
from deltaopt.planning.first_motions.initial_motion import curve_between, roughly_fastest
from deltaopt.problem.of_scene import problem_of
from deltaopt.scene.links import LinkGeometry
from deltaopt.verify.clearance import robot_clearance
from deltaopt.verify.verification import verify
from tests.limits.test_keep_out import with_bodies

BESIDE_AN_ARM = {"box": {"from": [-0.2, 0.2, -0.05], "to": [0.05, 0.3, 0.05]}}


@pytest.fixture
def motion():
    scene = with_bodies(BESIDE_AN_ARM)
    return scene, roughly_fastest(scene, curve_between(scene)).slowed(1.5)


def test_lines_are_as_long_as_the_links(motion):
    scene, line = motion
    found = line.inside_intervals(np.linspace(0, 1, 7))
    begins, ends = LinkGeometry(scene.robot, found.x, found.theta).links
    lengths = np.linalg.norm(ends - begins, axis=2)
    np.testing.assert_allclose(lengths[:, 0::2], scene.robot.upper_arm.length, rtol=1e-12)
    np.testing.assert_allclose(lengths[:, 1::2], scene.robot.forearm.length, rtol=1e-9)


def test_the_least_distance_is_that_of_dense_samples(motion):
    scene, line = motion
    found = line.inside_intervals(np.linspace(0, 1, 5))
    begins, ends = LinkGeometry(scene.robot, found.x, found.theta).links
    share = np.linspace(0, 1, 2001)[:, None, None, None]
    places = (begins + share * (ends - begins)).reshape(-1, 3)
    expected = signed_distances(problem_of(scene), places)[0].min()
    assert robot_clearance(scene, line) == pytest.approx(expected, abs=2e-4)
    assert robot_clearance(scene, line) <= expected + 1e-12


def test_an_arm_in_a_body_is_told_and_fails_only_where_that_is_asked_for(motion):
    scene, line = motion
    told = verify(scene, line)
    assert told.robot_clearance == robot_clearance(scene, line)
    assert told.robot_clearance < 0
    assert told.ok, told.failures()
    (sentence,) = verify(with_bodies(BESIDE_AN_ARM, robot_keeps_clear=True), line).failures()
    assert sentence.startswith("an arm or a forearm is up to ")


def test_an_arm_in_a_body_that_samples_do_not_see_is_told(motion, monkeypatch):
    _, line = motion
    verification = import_module("deltaopt.verify.verification")
    monkeypatch.setattr(verification, "robot_clearance", lambda *_: 1.0)
    (sentence,) = verify(with_bodies(BESIDE_AN_ARM, robot_keeps_clear=True), line).failures()
    assert sentence.startswith("an arm or a forearm is up to ")
