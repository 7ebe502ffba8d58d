"""Write a robot's model for other programs.

deltaopt export c ROBOT    kinematics and dynamics in C, for a controller; with a test program
"""

from __future__ import annotations

import argparse
from pathlib import Path

from deltaopt.robot.robot import load_robot

HELP = "write a robot's kinematics and dynamics in C"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    targets = parser.add_subparsers(title="targets", metavar="TARGET", required=True)
    c = targets.add_parser("c", help="delta.h, delta.c and test_delta.c: self-contained C99")
    c.add_argument("robot", type=Path, metavar="ROBOT", help="robot file")
    c.add_argument(
        "-o", "--output", type=Path, default=Path("out/c"), metavar="DIR", help="default: out/c"
    )
    c.set_defaults(target=_c)


def run(arguments: argparse.Namespace) -> int:
    return int(arguments.target(arguments))


def _c(arguments: argparse.Namespace) -> int:
    from deltaopt.output.controller_c import export_c

    written = export_c(load_robot(arguments.robot), arguments.output)
    print("written:", ", ".join(map(str, written)))
    return 0
