"""Look at a saved plan in a browser: the robot in three dimensions, with a slider for the time.

A small server runs until Ctrl-C, which only this machine reaches; its address is printed. It needs
the package viser: pip install -e '.[view]' in the clone. The page that "deltaopt plan --report"
writes needs neither, and says more.
"""

from __future__ import annotations

import argparse
from itertools import repeat
from pathlib import Path
from time import sleep

from deltaopt.cli.arguments import one_or_more
from deltaopt.errors import installed
from deltaopt.output.saved_plan import load_plan
from deltaopt.robot.robot import as_delta

_FRAME = 1 / 30
"""Seconds between pictures while the motion plays."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("plan", type=Path, metavar="PLAN", help="folder of a plan")
    words = "of the server; the next free one if it is taken (default: %(default)s)"
    parser.add_argument("--port", type=one_or_more, default=8080, metavar="N", help=words)


def run(arguments: argparse.Namespace) -> int:
    installed("viser", "view")
    from deltaopt.report.viewer import Viewer  # slow to import

    plan = load_plan(arguments.plan)
    viewer = Viewer(as_delta(plan.scene.robot), plan.trajectory, arguments.port)
    print(f"http://localhost:{viewer.server.get_port()} (Ctrl-C ends it)", flush=True)
    try:
        for seconds in repeat(_FRAME):
            sleep(seconds)
            viewer.advance(seconds)
    finally:
        viewer.server.stop()
    return 0
