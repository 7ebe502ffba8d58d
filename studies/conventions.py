"""The drawing of docs/your-robot.md: order, zero and sign of the motors, and where x points."""

from __future__ import annotations

import argparse

import numpy as np

from deltaopt.robot.robot import load_robot
from studies.problems import PROBLEMS, add_directory

ROBOT = PROBLEMS / "robots" / "hornet_565.yaml"
PLATFORM = (0.75, 0.0, 0.0)
"""Where the platform is drawn, m: in the middle of the robot's workspace."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_directory(parser, "conventions", "conventions.png")


def run(arguments: argparse.Namespace) -> int:
    from studies.plots.conventions import draw  # slow to import

    file = arguments.directory / "conventions.png"
    draw(load_robot(ROBOT), np.array(PLATFORM), file)
    print("written:", file)
    return 0
