"""Write a robot's model for other programs.

deltaopt export c ROBOT       kinematics and dynamics in C, for a controller; with a test program
deltaopt export mjcf ROBOT    bodies, joints and motors in MuJoCo's format, for a simulation
"""

from __future__ import annotations

import argparse
from pathlib import Path

from deltaopt.cli.arguments import folder, positive
from deltaopt.files.atomic_write import atomic_write
from deltaopt.robot.robot import load_robot

HELP = "write a robot's model in C or for MuJoCo"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    targets = parser.add_subparsers(title="targets", metavar="TARGET", required=True)
    c = targets.add_parser("c", help="delta.h, delta.c and test_delta.c: self-contained C99")
    c.add_argument("robot", type=Path, metavar="ROBOT", help="robot file")
    c.add_argument(
        "-o", "--output", type=folder, default=Path("out/c"), metavar="DIR", help="default: out/c"
    )
    c.set_defaults(target=_c)
    mjcf = targets.add_parser("mjcf", help="one file in MuJoCo's format, without Coulomb friction")
    mjcf.add_argument("robot", type=Path, metavar="ROBOT", help="robot file")
    mjcf.add_argument("--payload", type=positive, metavar="KG", help="at the tool (default: none)")
    mjcf.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("out/robot.xml"),
        metavar="FILE",
        help="default: out/robot.xml",
    )
    mjcf.set_defaults(target=_mjcf)


def run(arguments: argparse.Namespace) -> int:
    return int(arguments.target(arguments))


def _c(arguments: argparse.Namespace) -> int:
    from deltaopt.output.controller_c import export_c

    written = export_c(load_robot(arguments.robot), arguments.output)
    print("written:", ", ".join(map(str, written)))
    return 0


def _mjcf(arguments: argparse.Namespace) -> int:
    from deltaopt.output.mjcf import mjcf

    text = mjcf(load_robot(arguments.robot), arguments.payload)
    with atomic_write(arguments.output) as file:
        file.write_text(text, encoding="utf-8")
    print("written:", arguments.output)
    return 0
