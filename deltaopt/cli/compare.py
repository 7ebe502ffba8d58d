"""``deltaopt compare``: studies that put methods side by side."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from deltaopt.cli.progress import ProgressBar

HELP = "compare formulations of the dynamics: their cost and accuracy, as a table and a chart"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("what", nargs="+", metavar="WHAT", help="dynamics: the models of the paper")
    parser.add_argument(
        "-o", dest="directory", type=Path, metavar="DIR", help="default: out/compare_WHAT"
    )
    parser.add_argument("--states", type=int, default=100, help="random states (default 100)")
    parser.add_argument("--rounds", type=int, default=200, help="timings of each (default 200)")


def run(arguments: argparse.Namespace) -> int:
    if arguments.what == ["dynamics"]:
        return _dynamics(arguments)
    print(f"deltaopt compare: {' '.join(arguments.what)} is no study; dynamics is", file=sys.stderr)
    return 2


def _dynamics(arguments: argparse.Namespace) -> int:
    """Measure, print, save."""
    from deltaopt.files import whole
    from deltaopt.machine_code import compiler
    from deltaopt.plots.dynamics import draw
    from deltaopt.studies.dynamics import compare_dynamics
    from deltaopt.studies.dynamics_report import csv, notes, table, verdict

    if arguments.states < 1 or arguments.rounds < 1:
        print("deltaopt compare: --states and --rounds must be at least 1", file=sys.stderr)
        return 2
    study = compare_dynamics(arguments.states, arguments.rounds, compiler(), progress=ProgressBar())
    directory = arguments.directory or Path("out/compare_dynamics")
    with whole(directory / "dynamics.csv") as path:
        path.write_text(csv(study))
    with whole(directory / "dynamics.png") as path:
        draw(study, path)
    print(table(study), notes(study), verdict(study), sep="\n\n")
    print(f"\n{directory}/dynamics.csv, {directory}/dynamics.png")
    return 0
