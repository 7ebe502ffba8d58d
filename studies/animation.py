"""The moving picture at the head of README.md: report.html of a plan, by a headless Chromium.

Takes `pip install -e '.[browser]'` and a Chromium. The robot of the page is photographed at
equal steps of the motion, which are written as animation.gif.
"""

from __future__ import annotations

import argparse
import io
import shutil
from pathlib import Path
from typing import Any

import deltaopt
from deltaopt.errors import MissingPackage, installed
from studies.problems import PROBLEMS, add_directory

SMALL = {"frames": 2}
SCENE = PROBLEMS / "smooth" / "into_a_box.yaml"
BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
_FRAMES = 36
"""Pictures of the motion."""
_STEP, _REST = 50, 600
"""Milliseconds that a frame is seen, and the first and the last one."""
_SIZE, _SHADES = 440, 32
"""Pixels of a side, and colours."""
_SHOW = """(share) => {
  const time = document.getElementById("time");
  time.value = Math.round(share * time.max);
  time.dispatchEvent(new Event("input"));
}"""


def frames(page: Path, number: int) -> list[Any]:
    """The robot of a page as so many pictures, from the start of its motion to its end.

    Raises MissingPackage without playwright or a Chromium.
    """
    from PIL import Image

    playwright = installed("playwright.sync_api", "browser")
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise MissingPackage(f"no browser: one of {', '.join(BROWSERS)} is needed")
    with playwright.sync_playwright() as started:
        chromium = started.chromium.launch(executable_path=browser, args=["--no-sandbox"])
        opened = chromium.new_page(viewport={"width": 1100, "height": 1400})
        opened.goto(page.resolve().as_uri())
        robot, found = opened.locator("#robot"), []
        for frame in range(number):
            opened.evaluate(_SHOW, frame / (number - 1))
            picture = Image.open(io.BytesIO(robot.screenshot())).convert("RGB")
            found.append(picture.resize((_SIZE, _SIZE)).quantize(_SHADES))
        chromium.close()
    return found


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_directory(parser, "animation", "animation.gif")
    parser.set_defaults(frames=_FRAMES)


def run(arguments: argparse.Namespace) -> int:
    folder = arguments.directory
    plan = deltaopt.plan(deltaopt.load_scene(SCENE))
    plan.save(folder, chart=False, report=True)
    first, *others = frames(folder / "report.html", arguments.frames)
    file, steps = folder / "animation.gif", len(others)
    seen = [_REST] + [_STEP] * (steps - 1) + [_REST]
    first.save(file, save_all=True, append_images=others, duration=seen, loop=0, optimize=True)
    slower = _STEP * steps / (1e3 * plan.duration)
    print(f"written: {file}, {file.stat().st_size / 1e3:.0f} kB, {slower:.0f} times slower")
    return 0
