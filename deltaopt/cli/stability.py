"""``deltaopt stability``: where methods fail, each study a chart, a CSV and a sentence."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from deltaopt.cli.progress import ProgressBar

HELP = "measure where formulations fail: near singularities, over long times, on benchmarks"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "studies", nargs="*", metavar="STUDY", help=f"some of {', '.join(STUDIES)}; default: all"
    )
    parser.add_argument(
        "-o",
        dest="directory",
        type=Path,
        metavar="DIR",
        default=Path("out/stability"),
        help="default: out/stability",
    )


def run(arguments: argparse.Namespace) -> int:
    unknown = [name for name in arguments.studies if name not in STUDIES]
    if unknown:
        print(
            f"deltaopt stability: {unknown[0]} is no study; {', '.join(STUDIES)} are",
            file=sys.stderr,
        )
        return 2
    for name in arguments.studies or STUDIES:
        STUDIES[name](arguments.directory)
    return 0


def _singularities(directory: Path) -> None:
    from studies.plots.stability import draw_singularities
    from studies.stability import report
    from studies.stability.singularities import measure

    study = measure(ProgressBar())
    of_delta = [f for f in study.families if f.mechanism.name == "delta"]
    others = [f for f in study.families if f not in of_delta]
    _save(
        directory,
        {
            "singularities.csv": lambda path: path.write_text(report.singularities_csv(study)),
            "singularities_delta.png": lambda path: draw_singularities(study, of_delta, path),
            "singularities_pendulum.png": lambda path: draw_singularities(study, others, path),
        },
        [report.singularities_table(study), report.singularities_verdict(study)],
    )


def _drift(directory: Path) -> None:
    from studies.plots.stability import draw_drift
    from studies.stability import report
    from studies.stability.drift import measure

    study = measure(ProgressBar())
    _save(
        directory,
        {
            "drift.csv": lambda path: path.write_text(report.drift_csv(study)),
            "drift.png": lambda path: draw_drift(study, path),
        },
        [report.drift_table(study), report.drift_verdict(study)],
    )


def _benchmarks(directory: Path) -> None:
    from studies.plots.stability import draw_benchmarks
    from studies.stability import report
    from studies.stability.benchmarks import measure

    study = measure(ProgressBar())
    _save(
        directory,
        {
            "benchmarks.csv": lambda path: path.write_text(report.benchmarks_csv(study)),
            "benchmarks.png": lambda path: draw_benchmarks(study, path),
        },
        [report.benchmarks_table(study), report.benchmarks_verdict(study)],
    )


def _edge(directory: Path) -> None:
    from studies.plots.stability import draw_edge
    from studies.stability import report
    from studies.stability.edge import measure

    study = measure(ProgressBar())
    _save(
        directory,
        {
            "edge.csv": lambda path: path.write_text(report.edge_csv(study)),
            "edge.png": lambda path: draw_edge(study, path),
        },
        [report.edge_table(study), report.edge_verdict(study)],
    )


def _save(directory: Path, files: dict[str, Callable[[Path], object]], texts: list[str]) -> None:
    """Write the files, print the texts and where the files are."""
    from deltaopt.files.atomic_write import whole

    for name, write in files.items():
        with whole(directory / name) as path:
            write(path)
    print("\n\n".join(texts), f"\n\n{', '.join(str(directory / name) for name in files)}\n")


STUDIES: dict[str, Callable[[Path], None]] = {
    "singularities": _singularities,
    "drift": _drift,
    "benchmarks": _benchmarks,
    "edge": _edge,
}
"""What each word runs."""
