"""Meshes that begin with the knots of a motion."""

from __future__ import annotations

import numpy as np
import pytest

import deltaopt
from deltaopt.planning.nlp.phases import own_mesh

SCENE = deltaopt.load_scene("problems/pick_and_place.yaml")


def test_thirds_are_not_divided_into_thirds_again():
    """Motions under limits of jerk were improved on six times their mesh, not on twice."""
    limited = SCENE.model_copy(update={"limits": {"jerk": 1e4}})
    thirds = deltaopt.plan(limited).trajectory
    assert own_mesh(thirds, 2, 3) == pytest.approx(np.repeat(thirds.shares / 2, 2))
    others = deltaopt.plan(SCENE).trajectory
    assert own_mesh(others, 2, 1) == pytest.approx(np.repeat(others.shares / 2, 2))
    assert own_mesh(others, 1, 3) == pytest.approx(np.repeat(others.shares / 3, 3))
