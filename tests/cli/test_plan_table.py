"""What is printed of a verification."""

from __future__ import annotations

from deltaopt.output.in_words import singularities_table, table
from deltaopt.verify.measures import Distance, Excess
from deltaopt.verify.verification import Verification


def test_table_has_every_limit_and_every_distance():
    """Whatever their names are: nothing in the table names a limit."""
    excess = Excess("heat", "K", "motor 2", t=0.125, value=1e-3, amount=0.04)
    distance = Distance("fold", "sin² q", 0.25, "chain 3", 0.0625)
    found = Verification(1.0, 0.1, excesses={excess.key: excess}, distances=(distance,))
    lines = table(found).splitlines()
    (told,) = (line for line in lines if line.startswith("heat excess "))
    assert told.split()[2:] == ["1.0e-03", "1e-09", "1", "FAILED"]
    assert "  fold: sin² q = 0.25, chain 3 at t = 0.062500 s" in lines
    columns = {line.index(" m ") for line in lines if line.endswith((" m  ok", " m  FAILED"))}
    assert len(columns) <= 1


def test_a_singularity_that_is_passed_is_marked():
    """No limit says so where the platform can tilt: motors do not feel it."""
    near, beyond = (Distance("tilt", "volume", least, "robot", 0.0625) for least in (0.02, -0.1))
    kept, passed = singularities_table([near, beyond])[1:]
    assert kept == "  tilt: volume = 0.02, at t = 0.062500 s"
    assert passed.startswith("  tilt: volume = -0.1, at t = 0.062500 s, PASSED")
