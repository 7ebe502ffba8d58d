"""Plan many variants of scenes and robots: a row of a table each, and a picture.

A sweep file names a scene, or several, and what is changed in it and its robot, by key:

  scene: ../pick_and_place.yaml
  grid: {robot.drive.torque times: {from: 0.8, to: 1.2, steps: 5}}

FILE receives a row for each point as soon as it is planned. A sweep that was stopped goes on where
it was when it is started again. A point without a plan is a row that says why.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from deltaopt.cli.arguments import WrongUsage, add_flag, add_output, one_or_more
from deltaopt.files.progress_bar import ProgressBar
from deltaopt.sweeps.findings import best_compromises, message, told, varied
from deltaopt.sweeps.points import SweepPoints
from deltaopt.sweeps.run import cluster, processes
from deltaopt.sweeps.sweep import PARQUET, fill
from deltaopt.sweeps.sweep_file import load_sweep


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("sweep", type=Path, metavar="SWEEP", help="sweep file, see problems/sweeps")
    add_how(parser)


def add_how(parser: argparse.ArgumentParser) -> None:
    """Declare where rows go and what plans them."""
    words = "table to add rows to, .csv or .parquet (default: out/ and the name of the file)"
    add_output(parser, kind="FILE", words=words)
    words = "processes on this machine (default: one for each processor)"
    parser.add_argument("--workers", type=one_or_more, metavar="N", help=words)
    words = "of a Dask cluster, such as tcp://host:8786, whose workers plan instead"
    parser.add_argument("--scheduler", metavar="ADDRESS", help=words)
    add_flag(parser, "--no-plot", "draw no picture")


def filled(arguments: argparse.Namespace, name: str, points: SweepPoints) -> tuple[Path, Any]:
    """The table of all points, planned now where they are not there: its file and its rows."""
    file = arguments.output or Path("out") / f"{name}.csv"
    if file.suffix not in (".csv", PARQUET):  # another one may be that of its pictures
        raise WrongUsage(f"{file} is no name of a table; it is to end in .csv or {PARQUET}")
    there = partial(cluster, arguments.scheduler)
    start = there if arguments.scheduler else partial(processes, arguments.workers)
    return file, fill(file, points, start, ProgressBar())


def run(arguments: argparse.Namespace) -> int:
    sweep, points = load_sweep(arguments.sweep)
    file, table = filled(arguments, arguments.sweep.stem, points)
    keys, series = varied(table, [*points.bases[0].name, *points.keys])
    print("\n".join(told(table, keys, sweep.column, series)))
    if table["duration"].isna().all():
        return 1
    shown = (sweep.column, *(sweep.pareto or ()))
    unknown = next((column for column in shown if table[column].isna().all()), None)
    if unknown is not None:
        print(f"no picture: {unknown} is not known of any plan")
    elif not arguments.no_plot and keys:
        from deltaopt.plots.sweeps import draw_pareto, draw_sweep

        title = message(table, [*series, *keys], sweep.column)
        draw_sweep(file.with_suffix(".png"), title, table, keys, sweep.column, series)
        if sweep.pareto:
            best = best_compromises(table, sweep.pareto)
            title = f"{len(best)} of {len(table)} plans are best compromises"
            draw_pareto(file.with_suffix(".pareto.png"), title, table, sweep.pareto, best)
    print(f"rows and pictures: {file.with_suffix('')}.*")
    return 0
