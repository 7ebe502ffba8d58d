"""The moving picture of README.md is made, where there is a browser."""

import shutil

import pytest
from PIL import Image

from studies.__main__ import main
from studies.animation import BROWSERS


def test_animation_in_small(tmp_path):
    pytest.importorskip("playwright.sync_api")
    if not any(map(shutil.which, BROWSERS)):
        pytest.skip("no Chromium on this machine")
    assert main(["animation", "--small", "-o", str(tmp_path)]) == 0
    with Image.open(tmp_path / "animation.gif") as picture:
        assert picture.n_frames == 2
        assert picture.width == picture.height
