"""What controllers' interpolation of joint tables asks for, as a share of the limits.

Rows at the plan's own knots and at equal steps, interpolated by cubic polynomials from angles and
speeds, or by quintic ones from accelerations too. In brackets by what share the motion has to be
slowed until its interpolated table exceeds no limit.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping

import deltaopt
from deltaopt.cli.arguments import positive
from deltaopt.output.joint_table import (
    CUBIC,
    QUINTIC,
    Rows,
    checked_table,
    table_within_limits,
)
from studies.problems import PICK_AND_PLACE, add_scenes

SMALL: Mapping[str, object] = {"scenes": (PICK_AND_PLACE,), "cycles": (4e-3,)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scenes(parser)
    parser.add_argument(
        "--cycles",
        nargs="+",
        type=positive,
        default=(5e-4, 1e-3, 2e-3, 4e-3),
        metavar="S",
        help="steps between rows, s (default: %(default)s)",
    )


def run(arguments: argparse.Namespace) -> int:
    rows = [Rows(), *(Rows(cycle) for cycle in arguments.cycles)]
    names = ["own knots", *(f"{1e3 * cycle:g} ms" for cycle in arguments.cycles)]
    print(f"| scene | interpolation | {' | '.join(names)} |")
    print("|---" * (2 + len(names)) + "|")
    for file in arguments.scenes:
        scene = deltaopt.load_scene(file)
        trajectory = deltaopt.plan(scene).trajectory
        for interpolation in (CUBIC, QUINTIC):
            cells = []
            for each in rows:
                found = checked_table(scene, trajectory, each, interpolation)
                kept = table_within_limits(
                    scene, trajectory, each, interpolation, in_time=not scene.task.is_at_rest
                )
                cells.append(f"{found.demand.share:.4f} ({kept.slowed - 1:.2%})")
            print(f"| {file.stem} | {interpolation.name} | {' | '.join(cells)} |", flush=True)
    return 0
