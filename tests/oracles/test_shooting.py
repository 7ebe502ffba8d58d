"""What shooting cannot solve, it says."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import load_scene
from deltaopt.errors import NotConverged
from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.switching.detection import detect_structure
from tests.oracles.shooting import shoot

LIGHT = load_scene("problems/light_and_fast.yaml")


def test_shooting_needs_motors_that_are_held():
    free = np.zeros((20, 3, 3))
    free[:10], free[10:, :, 1:] = 1.0, -1.0
    structure = detect_structure(np.full(20, 0.05), ByOrder(free))
    with pytest.raises(NotConverged, match="at no limit"):
        shoot(LIGHT, structure, 0.1)
