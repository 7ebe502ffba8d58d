"""Find the best design of a file: lengths, gears and motors that make scenes fastest, or cheapest.

The file names scenes, numbers of theirs and their robot's that may be changed between bounds, and
tables of makers of which a row is chosen (docs/design.md). DIR receives

  designs.csv   the best of each choice of rows: what it costs, durations, values
  robot.yaml    the robot of the best design; one of your own is not overwritten

Exit code: 0 found; 1 no design keeps all limits, or a file exists; 2 bad input.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from time import process_time

from deltaopt.cli.arguments import add_flag, add_json, add_output, optimality_gap, output_directory
from deltaopt.cli.streams import present, print_json, print_written, say
from deltaopt.designs.design import TOLERANCE, Candidate, Designed, design
from deltaopt.files.atomic_write import write_text
from deltaopt.files.csv_table import csv_text
from deltaopt.files.output_folder import all_or_none
from deltaopt.files.tables import text_table
from deltaopt.files.yaml_file import write_yaml
from deltaopt.output.starting_files import FilesExist
from deltaopt.sensitivity.keys import content_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", type=Path, metavar="DESIGN", help="a design file")
    add_output(parser)
    add_json(parser)
    add_flag(parser, "--no-derivatives", "optimise without those of plans")
    words = f"relative optimality gap of plans (default: {TOLERANCE:g})"
    parser.add_argument(
        "--tolerance", type=optimality_gap, metavar="GAP", default=TOLERANCE, help=words
    )


def run(arguments: argparse.Namespace) -> int:
    directory, begin = output_directory(arguments), process_time()
    files = [directory / "designs.csv", directory / "robot.yaml"]
    if files[1].exists() and not files[0].exists():  # somebody may have written in it
        raise FilesExist(f"{files[1]} exists and is not overwritten; name another folder")
    found = design(
        arguments.scene,
        derivatives=not arguments.no_derivatives,
        tolerance=arguments.tolerance,
        progress=say,
    )
    spent, before = process_time() - begin, present(directory)
    rows = [_row(found, each) for each in sorted(found.candidates, key=lambda each: each.value)]
    text = csv_text([*rows[0]], [[*row.values()] for row in rows])
    (job, *_) = found.design.jobs(found.best.choice, found.best.values)
    comment = f"the best design of {arguments.scene.name}"
    with all_or_none(directory) as folder:
        write_text(folder / files[0].name, text)
        write_yaml(folder / files[1].name, content_of(job)["robot"], comment)
    if arguments.json:
        counted = {"evaluations": found.evaluations, "files": [str(file) for file in files]}
        print_json({"best": _row(found, found.best), **counted})
        return 0
    told = ([x if isinstance(x, str) else f"{x:.6g}" for x in row.values()] for row in rows)
    print(*text_table([[*rows[0]], *told]), sep="\n")
    print(
        f"{found.evaluations} designs planned in {spent:.1f} s of a processor; "
        f"{found.passed_over} choices passed over, which cannot be better"
    )
    print_written(files, before)
    return 0


def _row(found: Designed, each: Candidate) -> dict[str, str | float]:
    """A design by the names of columns."""
    asked = found.design.asked
    stems = [Path(file).stem for file in asked.scenes]
    scenes = stems if len(set(stems)) == len(stems) else asked.scenes
    durations = [f"{scene} [s]" for scene in scenes]
    names = ["design", "value", *durations, *(change.key for change in asked.change)]
    values: list[str | float] = [each.choice.name, each.value, *each.durations, *each.values]
    return dict(zip(names, values, strict=True))
