"""Reference durations by other means."""

from __future__ import annotations

from deltaopt import load_scene
from studies.agreement import agreement, table

LIGHT = load_scene("problems/light_and_fast.yaml")


def test_other_means_find_the_same():
    """Polynomials of two degrees and shooting to 1e-8; forward dynamics, on a mesh that knows the
    switches, to 1e-7, on one that does not to 1e-5."""
    study = agreement(LIGHT, 80, lambda done: None)
    differ = [abs(study.differs(answer)) for answer in study.answers]
    assert max(differ[:3]) < 1e-8
    assert differ[4] < 1e-7 < differ[3] < 1e-5
    assert len(table("light_and_fast", study).splitlines()) == 6
