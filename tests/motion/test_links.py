"""Sure bounds of how near links come to bodies, against dense samples, the planner's and the
verifier's, which are derived in different ways."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt.curves.halving import Parts
from deltaopt.curves.piecewise import PiecewisePolynomial
from deltaopt.motion.links import least_rooms, planned_distances
from deltaopt.motion.trajectory import Trajectory
from deltaopt.robot.model import delta_model
from deltaopt.scene.links import LinkGeometry
from deltaopt.verify.clearance import (
    FIRST,
    largest_accelerations,
    moving_links,
    sure_robot_clearance,
)
from studies.bench.hard_moves import move
from tests.limits.test_keep_out import BOX, CYLINDER, PLANE, SPHERE, of_box, of_cylinder
from tests.limits.test_links import densely, lines, of_plane, of_sphere, with_bodies


def motion(scene, seed: int) -> Trajectory:
    """Through random states, at speeds of robots."""
    rng = np.random.default_rng(seed)
    x = rng.uniform([0.42, -0.08, -0.08], [0.50, 0.08, 0.08], (4, 3))
    position = PiecewisePolynomial.hermite(
        np.array([0, 0.05, 0.1, 0.2]), x, rng.normal(size=(4, 3))
    )
    return Trajectory(position, delta_model(scene.robot, scene.payload))


@pytest.mark.parametrize("seed", range(2))
def test_what_is_known_to_be_clear_is_clear_at_dense_samples(seed):
    """And what is not is not."""
    scene = with_bodies(BOX, SPHERE, CYLINDER, PLANE)
    along = motion(scene, seed)
    places = along.position.at(np.linspace(0, 0.2, 101))
    of_bodies = (of_box, of_sphere, of_cylinder, of_plane)
    samples = np.stack([densely(scene, of, places).min(axis=0) for of in of_bodies], axis=1)
    assert (samples > 0).any()
    assert (samples < 0).any()
    for asked in (0.0, 0.8 * samples[samples > 0].min(), 0.9 * samples.max()):
        farther = scene.model_copy(update={"clearance": asked})
        found = least_rooms(farther, along)
        clear = found >= 0
        assert (found + asked <= samples + 1e-12)[clear].all()
        assert (clear == (samples >= asked))[np.abs(samples - asked) > 2e-3].all()


def lower(body: dict) -> dict:
    """A body 150 mm below, where the platform does not get to."""
    ((kind, keys),) = body.items()

    def moved(value):
        return [value[0] + 0.15, *value[1:]] if np.ndim(value) == 1 else list(map(moved, value))

    return {kind: {k: v if k in ("radius", "normal") else moved(v) for k, v in keys.items()}}


@pytest.mark.parametrize("body", list(map(lower, (BOX, SPHERE, CYLINDER, PLANE))))
def test_the_verifier_agrees_with_the_planner(body):
    """Where links keep half of the distance that they have, and where they do not."""
    bare = with_bodies(body)
    along = motion(bare, 1)
    least = 1 + least_rooms(with_bodies(body, clearance=1.0), along).min()  # at some instants
    assert least > 0.01
    for asked in (least / 2, least + 1e-3):
        scene = with_bodies(body, clearance=asked)
        assert (least_rooms(scene, along).min() >= 0) == (asked < least)
        is_kept = sure_robot_clearance(scene, along) >= asked - 1e-9
        assert is_kept == (asked < least)


def test_slopes_are_those_of_differences():
    links = tuple((link, body, 0.0) for link in range(6) for body in range(4))
    scene = with_bodies(BOX, SPHERE, CYLINDER, PLANE, planned_links=links)
    x = np.random.default_rng(5).uniform([0.42, -0.08, -0.08], [0.50, 0.08, 0.08], (20, 3))
    distances, slopes = planned_distances(scene, x)
    away = distances > 1e-3
    for k, step in enumerate(1e-6 * np.eye(3)):
        ahead, behind = (planned_distances(scene, x + sign * step)[0] for sign in (1, -1))
        difference = (ahead - behind) / 2e-6
        np.testing.assert_allclose(slopes[away][:, k], difference[away], atol=1e-6)


def test_ends_are_off_uniform_motion_by_less_than_the_verifier_says():
    scene = with_bodies(BOX)
    along = motion(scene, 2)
    parts = Parts.of(along.position, FIRST)
    largest = largest_accelerations(along.position)[parts.piece]
    middle, rates, off = moving_links(scene.robot, along.model, parts, largest)
    assert np.isfinite(off).all()
    for share in (-1.0, 0.5, 1.0):
        later = parts.middles + share * parts.half
        ends = np.stack(lines(scene, along.position.at(later)), axis=2)
        uniform = middle + share * parts.half[:, None, None, None] * rates
        assert (np.linalg.norm(ends - uniform, axis=3) <= off + 1e-12).all()


def test_places_to_which_bars_are_too_short_sideways_have_no_links():
    """There arm and bars seen from the side may well close."""
    scene = move(1, 0).scene
    model = delta_model(scene.robot, scene.payload)
    far = np.array([[0.3, 0.15, -1.9], [0.3, 3.0, 0.1], scene.start])
    assert model.closes(far).tolist() == [False, False, True]
    geometry = LinkGeometry.of(model, far)
    assert np.isnan(geometry.elbows[:2]).all()
    assert np.isfinite(geometry.elbows[2]).all()
