"""Reference durations by other means."""

from __future__ import annotations

import numpy as np
import pytest

from deltaopt import load_scene
from deltaopt.errors import NotConverged
from deltaopt.planning.flat.constraint_rows import ByOrder
from deltaopt.planning.switching.detection import detect_structure
from studies.agreement import agreement, table
from tests.oracles.shooting import shoot

LIGHT = load_scene("problems/light_and_fast.yaml")


def test_other_means_find_the_same():
    """Polynomials of two degrees and shooting to 1e-8; forward dynamics, on a mesh that knows the
    switches, to 1e-7, on one that does not to 1e-5."""
    study = agreement(LIGHT, lambda done: None, intervals=80)
    differ = [abs(study.differs(answer)) for answer in study.answers]
    assert max(differ[:3]) < 1e-8
    assert differ[4] < 1e-7 < differ[3] < 1e-5
    assert len(table("light_and_fast", study).splitlines()) == 6


def test_shooting_needs_motors_that_are_held():
    free = np.zeros((20, 3, 3))
    free[:10], free[10:, :, 1:] = 1.0, -1.0
    structure = detect_structure(np.full(20, 0.05), ByOrder(free))
    with pytest.raises(NotConverged, match="at no limit"):
        shoot(LIGHT, structure, 0.1)
