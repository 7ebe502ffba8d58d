"""The rounded path over bodies that plans past them are compared with."""

from __future__ import annotations

import numpy as np
import pytest

import deltaopt
from deltaopt.planning.comparisons import rounded_path_over, straight_lines
from studies.problems import PROBLEMS

WALL = deltaopt.load_scene(PROBLEMS / "keep_out/wall_25_305_25.yaml")


def test_path_clears_the_wall_and_is_the_lowest():
    """By the wall's own edges: the path is above its top wherever it is between its sides, and
    nearer than 20 µm to the edges."""
    path = rounded_path_over(WALL)
    assert path is not None
    curve = path.between(WALL.start, WALL.goal)
    x = curve(np.linspace(curve.knots[0], curve.knots[-1], 100_001))
    above = 0.825 - x[np.abs(x[:, 1]) <= 0.13, 0]  # x points down
    assert 0 < above.min() < 2e-5
    assert path.height == pytest.approx(0.025, abs=2e-5)


def test_it_is_what_a_plan_over_the_wall_is_compared_with():
    (duration,) = straight_lines(WALL).values()
    path = rounded_path_over(WALL)
    assert duration == deltaopt.plan(WALL.model_copy(update={"path": path})).duration
    assert duration == pytest.approx(0.1756, abs=2e-4)
