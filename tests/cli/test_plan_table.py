"""What is printed of a verification."""

from __future__ import annotations

from deltaopt.output.in_words import singularities_table
from deltaopt.verify.measures import Distance


def test_a_singularity_that_is_passed_is_marked():
    """No limit says so where the platform can tilt: motors do not feel it."""
    near, beyond = (Distance("tilt", "volume", least, "robot", 0.0625) for least in (0.02, -0.1))
    kept, passed = singularities_table([near, beyond])[1:]
    assert kept == "  tilt: volume = 0.02, at t = 0.062500 s"
    assert passed.startswith("  tilt: volume = -0.1, at t = 0.062500 s, PASSED")
