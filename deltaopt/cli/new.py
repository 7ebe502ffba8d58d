"""Write a robot file and a scene file to start from, with every key explained.

DIR receives robot.yaml and scene.yaml, which can be planned as they are. Put in your own numbers:
lengths and masses from a data sheet, with their units. Files that exist are not overwritten.

With --cell the scene is a cycle: parts from a belt, over a wall and into a box, again and again.

Exit code: 0 written; 1 a file exists; 2 DIR cannot be written to.
"""

from __future__ import annotations

import argparse

from deltaopt.cli.arguments import add_flag, folder
from deltaopt.cli.streams import print_written
from deltaopt.output.starting_files import CELL_FILE, SCENE_FILE, write_starting_files


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("directory", type=folder, metavar="DIR", help="folder for both files")
    add_flag(parser, "--cell", "a cycle of a packaging cell")


def run(arguments: argparse.Namespace) -> int:
    text = CELL_FILE if arguments.cell else SCENE_FILE
    robot, scene = write_starting_files(arguments.directory, text)
    print_written([robot, scene], ())
    check = "" if arguments.cell else f"deltaopt check {scene} and "
    print(f"next: put in your numbers, then {check}deltaopt plan {scene}")
    return 0
