"""Moves along the edge of the workspace, planned and verified once for all tests of a process."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from deltaopt import Plan, Scene, Verification, load_scene, plan, verify

_FOLDER = Path(__file__).parent / "data/hard_scenes"


def hard_scene(name: str) -> Scene:
    return load_scene(_FOLDER / f"{name}.yaml")


@cache
def planned_and_verified(name: str) -> tuple[Plan, Verification]:
    found = plan(hard_scene(name))
    return found, verify(found.scene, found.trajectory)
