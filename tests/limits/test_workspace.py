"""The limit of an approach against its regions, place by place."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca
import numpy as np
from numpy.polynomial import Polynomial

from deltaopt import load_scene
from deltaopt.scene.known_limits import limits_of

SCENE = load_scene("problems/approach/25_305_25.yaml").model_copy(update={"goal": (0.80, 0.15, 0)})
PHASED = limits_of(SCENE).phased
NUMBERS = limits_of(SCENE).numbers[PHASED.numbers]
POINTS = np.random.default_rng(1).uniform([0.7, -0.16, -0.006], [0.9, 0.16, 0.006], (2000, 3))


def rows(numbers):
    x = ca.SX.sym("x", 3)
    function = ca.Function(
        "f", [x], [PHASED.limit.rows(SimpleNamespace(x=x), ca.SX(ca.DM(numbers)))]
    )
    return np.array(function.map(len(POINTS))(POINTS.T)).T


def test_places_are_allowed_where_they_are_in_one_of_the_regions():
    in_start, in_goal = (
        np.hypot(*(POINTS - end).T[1:]) <= 0.005 for end in (SCENE.start, SCENE.goal)
    )
    allowed = in_start | in_goal | (POINTS[:, 0] <= 0.85 - 0.025)
    assert 0 < np.count_nonzero(in_start & (POINTS[:, 0] > 0.825)) < np.count_nonzero(allowed)
    np.testing.assert_array_equal((rows(NUMBERS) <= 1).all(axis=1), allowed)


def test_each_phase_has_its_own_region():
    regions = (
        np.hypot(*(POINTS - SCENE.start).T[1:]) <= 0.005,
        POINTS[:, 0] <= 0.85 - 0.025,
        np.hypot(*(POINTS - SCENE.goal).T[1:]) <= 0.005,
    )
    for numbers, region in zip(PHASED.limit.numbers_in_phases(NUMBERS), regions, strict=True):
        np.testing.assert_array_equal((rows(numbers) <= 1).all(axis=1), region)
        at_points = PHASED.limit.along([Polynomial([0, 1])] * 3, numbers)[1](POINTS[:, 0])
        np.testing.assert_allclose(np.maximum(at_points, -0.5), rows(numbers)[:, 1], atol=1e-9)
