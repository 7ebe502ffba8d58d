"""The benchmarks of multibody dynamics: published numbers beside ours, integrators, cost against N.

published    A01 to A05 of the IFToMM library, Andrews' squeezer of the IVP test set, a slider-crank
             through its singularity, a Gough-Stewart platform
integrators  error against counted work of Adams, BDF, an index-2 system and Gauss collocation
windows      operations of a right-hand side of N four-bars against N
spread       perturbed starts through singularities: who ends near the reference

Each part writes a CSV of every number, and charts; counts are the same in every run.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from deltaopt.cli.arguments import WrongUsage, positive
from deltaopt.files.progress_bar import ProgressBar
from studies.problems import add_directory

HELP = "published benchmarks of multibody dynamics, integrators, cost against size"
NAMES = ("published", "integrators", "windows", "spread")
SMALL = {"share": 0.02, "windows": (1, 2, 3), "settings": 1, "starts": 2}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("parts", nargs="*", default=NAMES, metavar="PART", help=", ".join(NAMES))
    add_directory(parser, "benchmarks")
    parser.add_argument(
        "--share", type=positive, default=1.0, metavar="X", help="of each duration (1)"
    )
    parser.set_defaults(windows=(1, 2, 4, 8, 16), settings=7, starts=20)


def run(arguments: argparse.Namespace) -> int:
    unknown = [name for name in arguments.parts if name not in NAMES]
    if unknown:
        raise WrongUsage(f"{unknown[0]} is no part; {', '.join(NAMES)} are")
    parts = {
        "published": _published,
        "integrators": _integrators,
        "windows": _windows,
        "spread": _spread,
    }
    for name in arguments.parts:
        parts[name](arguments)
    return 0


def _published(arguments: argparse.Namespace) -> None:
    from studies.benchmarks import published, stewart
    from studies.text_table import paragraph

    found = published.measure(ProgressBar(), arguments.share)
    platform = stewart.agreement(max(1, round(20 * arguments.share)))
    told = paragraph(
        "Gough-Stewart platform: L_I, L_E (null space, partition) and virtual work agree on the"
        f" drives' forces to {platform.forces:.0e} of the largest, and the drives' power with the"
        f" change of energy to {platform.power:.0e}; no published numbers were found.",
    )
    print(published.table_of(found), published.verdict(found), told, "", sep="\n\n")
    _write(arguments.directory / "published.csv", published.csv_of(found))


def _integrators(arguments: argparse.Namespace) -> None:
    from studies.benchmarks import integrators
    from studies.plots.benchmarks import draw_integrators

    runs = integrators.measure(ProgressBar(), arguments.share, arguments.settings)
    print(integrators.table_of(runs), integrators.verdict(runs), "", sep="\n\n")
    _write(arguments.directory / "integrators.csv", integrators.csv_of(runs))
    draw_integrators(runs, arguments.directory / "integrators.png")


def _windows(arguments: argparse.Namespace) -> None:
    from studies.benchmarks import windows
    from studies.plots.benchmarks import draw_windows

    costs = windows.measure(ProgressBar(), arguments.windows)
    print(windows.table_of(costs), windows.verdict(costs), "", sep="\n\n")
    _write(arguments.directory / "windows.csv", windows.csv_of(costs))
    draw_windows(costs, arguments.directory / "windows.png")


def _spread(arguments: argparse.Namespace) -> None:
    from studies.benchmarks import spread

    found = spread.measure(ProgressBar(), arguments.starts, arguments.share)
    print(spread.table_of(found), spread.verdict(found), "", sep="\n\n")


def _write(file: Path, text: str) -> None:
    from deltaopt.files.atomic_write import atomic_write

    with atomic_write(file) as temporary:
        temporary.write_text(text, encoding="utf-8")
