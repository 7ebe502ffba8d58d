"""What tests of tables and cams share."""

from __future__ import annotations

from pathlib import Path

import pytest

import deltaopt


@pytest.fixture(scope="session")
def saved_otherwise(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a plan, of a robot whose controller counts motor 2 backwards."""
    folder = tmp_path_factory.mktemp("plan")
    scene = deltaopt.load_scene("problems/pick_and_place.yaml")
    robot = scene.robot.model_copy(update={"joints": {"zero": 0.0929912, "sign": [1, -1, 1]}})
    deltaopt.plan(scene.model_copy(update={"robot": robot})).save(folder, chart=False)
    return folder
