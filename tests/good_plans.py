"""Plans that are good: they keep all that their scene asks for, within the tolerance."""

from __future__ import annotations

from typing import Any

from deltaopt import Plan, Scene, plan, verify


def good_plan(scene: Scene, **settings: Any) -> Plan:
    """The plan of a scene, which verification finds nothing wrong with, and which is as near the
    optimum as was asked for."""
    found = plan(scene, **settings)
    failures = verify(scene, found.trajectory).failures()
    assert not failures, failures
    assert found.within_tolerance
    return found
