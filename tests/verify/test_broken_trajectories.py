"""Verification says what is wrong with a motion, and never raises."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from deltaopt import baseline, load_scene, verify
from deltaopt.curves.piecewise import PiecewisePolynomial
from tests.verify.broken_trajectories import broken

SCENES = ("pick_and_place", "paths/glue_line")
SCENE = load_scene("problems/pick_and_place.yaml")
LINE = baseline(SCENE)


@pytest.mark.parametrize("name", SCENES)
def test_broken_trajectories_are_told_and_not_raised(name):
    """Against scenes of every kind of task, whose measures differ."""
    scene = load_scene(f"problems/{name}.yaml")
    for what, bad in broken(LINE, seed=1):
        found = verify(scene, bad)
        assert not found.ok, what
        assert found.failures(), what
        assert not json.loads(json.dumps(found.as_dict(), allow_nan=False))["ok"]
        assert "failed" in found._repr_html_() or found.obstacles


@pytest.mark.parametrize("factor", [1e-30, 1e30])
def test_motions_of_any_duration_are_judged(factor):
    """As slow as a motion can be made it is followed in pieces; as fast it asks for too much."""
    assert verify(SCENE, LINE.slowed(factor)).ok == (factor > 1)


def test_coordinates_have_the_knots_of_the_position():
    q, dq, ddq = LINE.coordinates_inside([0.0])
    own = PiecewisePolynomial(2 * LINE.knots, np.stack([q, dq, ddq / 2], axis=1))
    said = verify(SCENE, replace(LINE, coordinates=own)).failures()
    assert "other knots" in said[0]
