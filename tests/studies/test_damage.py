"""The verifier's own campaign tells damages that are found from those that are missed."""

from __future__ import annotations

from dataclasses import replace

import deltaopt
from studies import damage

EXCHANGED = 3
"""The number of a motion whose damage is one of order."""


def test_a_damage_is_found():
    row = damage.damaged(EXCHANGED, 1)
    assert (row.damage, row.verdict) == ("order", "found")
    assert row.ratio > 1e3


def test_a_verifier_that_finds_nothing_misses_it(monkeypatch):
    good = deltaopt.verify

    def blind(scene, trajectory):
        found = good(scene, trajectory)
        return replace(found, obstacles=()) if found.ok else _Ok()

    monkeypatch.setattr(deltaopt, "verify", blind)
    assert damage.damaged(EXCHANGED, 1).verdict == "missed"


class _Ok:
    ok = True
