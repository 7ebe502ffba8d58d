"""Where methods fail: each part writes a CSV of every number and charts, and prints what they say.

singularities  errors of every formulation on the way into singularities, against many digits
drift          a Delta that swings for 100 s: constraints and energy by every stabilisation
benchmarks     published mechanisms that defeat solvers
edge           planning scenes whose ends, ways or limits lie at the edge of what is possible
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from deltaopt.cli.arguments import WrongUsage, positive
from deltaopt.files.progress_bar import ProgressBar
from studies.problems import add_directory

HELP = "where formulations fail: near singularities, over long times, on benchmarks, at the edge"
NAMES = ("singularities", "drift", "benchmarks", "edge")
SMALL = {"motions": 1, "digits": 30, "swing": 0.2, "fall": 0.1, "every": 6}


@dataclass(frozen=True)
class Part:
    """A part of the study: how it is measured, and what is made of what was found."""

    measure: Callable[[ProgressBar], Any]
    csv: Callable[[Any], str]
    charts: Mapping[str, Callable[[Any, Path], None]]
    table: Callable[[Any], str]
    verdict: Callable[[Any], str]

    def run(self, name: str, directory: Path) -> None:
        """Measure, write the files, print the table, the verdict and where the files are."""
        from deltaopt.files.atomic_write import atomic_write

        found = self.measure(ProgressBar())
        files = [directory / file for file in (f"{name}.csv", *self.charts)]
        with atomic_write(files[0]) as path:
            path.write_text(self.csv(found), encoding="utf-8")
        for file, draw in zip(files[1:], self.charts.values(), strict=True):
            with atomic_write(file) as path:
                draw(found, path)
        print(self.table(found), self.verdict(found), "", sep="\n\n", end="")
        print(", ".join(map(str, files)), end="\n\n", flush=True)


def parts(arguments: argparse.Namespace) -> dict[str, Part]:
    """Return the parts at the sizes that were asked for, by name.

    Raises MissingPackage without mpmath.
    """
    from studies.plots import stability as charts
    from studies.stability import benchmarks, drift, edge, report, singularities

    found = (
        Part(
            lambda progress: singularities.measure(progress, arguments.motions, arguments.digits),
            report.singularities_csv,
            {
                "singularities_delta.png": charts.draw_delta_singularities,
                "singularities_pendulum.png": charts.draw_pendulum_singularities,
            },
            report.singularities_table,
            report.singularities_verdict,
        ),
        Part(
            lambda progress: drift.measure(progress, arguments.swing),
            report.drift_csv,
            {"drift.png": charts.draw_drift},
            report.drift_table,
            report.drift_verdict,
        ),
        Part(
            lambda progress: benchmarks.measure(progress, arguments.fall),
            report.benchmarks_csv,
            {"benchmarks.png": charts.draw_benchmarks},
            report.benchmarks_table,
            report.benchmarks_verdict,
        ),
        Part(
            lambda progress: edge.measure(progress, arguments.every),
            report.edge_csv,
            {"edge.png": charts.draw_edge},
            report.edge_table,
            report.edge_verdict,
        ),
    )
    return dict(zip(NAMES, found, strict=True))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "parts",
        nargs="*",
        default=NAMES,
        metavar="PART",
        help=f"of {', '.join(NAMES)} (default: all)",
    )
    add_directory(parser, "stability")
    for name, default, kind, what in (
        ("motions", 3, int, "random motions at each state near a singularity"),
        ("digits", 50, int, "of the arithmetic they are held against"),
        ("swing", 100.0, positive, "seconds that the Delta swings"),
        ("fall", 10.0, positive, "seconds of each benchmark"),
        ("every", 1, int, "plan each N-th scene at the edge only"),
    ):
        parser.add_argument(
            f"--{name}", type=kind, default=default, metavar="N", help=f"{what} ({default})"
        )


def run(arguments: argparse.Namespace) -> int:
    unknown = [name for name in arguments.parts if name not in NAMES]
    if unknown:
        raise WrongUsage(f"{unknown[0]} is no part; {', '.join(NAMES)} are")
    every = parts(arguments)
    for name in arguments.parts:
        every[name].run(name, arguments.directory)
    return 0
