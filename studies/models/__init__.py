"""Which model of the Delta, when: errors on the way into singularities beside what each costs.

Torques and accelerations of the paper's Delta from a regular state to 1e-12 before its four kinds
of singularity, against fifty digits; operations, counted, and nanoseconds, interpreted and
compiled. Writes models.csv and draws digits.png, the digits that are left a millionth before;
--drawn-again draws it from the file.
"""

from __future__ import annotations

import argparse

from deltaopt.cli.arguments import one_or_more
from deltaopt.files.progress_bar import ProgressBar
from studies.kept_rows import read_rows, rewrite_rows
from studies.problems import add_directory, add_drawn_again

SMALL = {"motions": 1, "digits": 30, "states": 2, "rounds": 2, "distances": (1e-2,)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    for name, default, what in (
        ("motions", 3, "random motions at each state near a singularity"),
        ("digits", 50, "of the arithmetic they are held against"),
        ("states", 100, "regular states at which models are timed"),
        ("rounds", 100, "in which each model is timed once"),
    ):
        parser.add_argument(
            f"--{name}", type=one_or_more, default=default, help=f"{what} ({default})"
        )
    add_directory(parser, "models")
    add_drawn_again(parser)
    parser.set_defaults(distances=tuple(10.0**-k for k in range(1, 13)))


def run(arguments: argparse.Namespace) -> int:
    from studies.models.measure import (
        Error,
        digits_table,
        errors_of,
        measure,
        table_of,
        verdict,
    )
    from studies.plots.digits import draw

    a = arguments
    file = a.directory / "models.csv"
    if not a.drawn_again:
        sizes = a.motions, a.digits, a.states, a.rounds
        found = measure(ProgressBar(), *sizes, a.distances)
        print(table_of(found), digits_table(found), verdict(found), sep="\n\n")
        rewrite_rows(file, errors_of(found))
    draw(read_rows(file, Error), a.directory / "digits.png")
    return 0
