"""Write a robot file and a scene file to start from, with every key explained.

DIR receives robot.yaml and scene.yaml, which can be planned as they are. Put in your own numbers:
lengths and masses from a data sheet, with their units. Files that exist are not overwritten.

Exit code: 0 written; 1 a file exists; 2 DIR cannot be written to.
"""

from __future__ import annotations

import argparse

from deltaopt.cli.arguments import folder
from deltaopt.cli.streams import print_written
from deltaopt.output.starting_files import write_starting_files


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("directory", type=folder, metavar="DIR", help="folder for both files")


def run(arguments: argparse.Namespace) -> int:
    robot, scene = write_starting_files(arguments.directory)
    print_written([robot, scene], ())
    print(f"next: put in your numbers, then deltaopt check {scene} and deltaopt plan {scene}")
    return 0
