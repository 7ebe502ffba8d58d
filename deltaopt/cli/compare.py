"""Put methods side by side, as tables and charts.

  deltaopt compare dynamics            the models of the paper: their cost and accuracy
  deltaopt compare SCENE... five-bar   formulations of the fastest motion: what accuracy costs

The latter solves each scene, and the planar five-bar where that word is among them, in every
formulation, with every loop closure and transcription, on a range of meshes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from deltaopt.cli.arguments import WrongUsage, folder, load_fastest, one_or_more
from deltaopt.cli.streams import new_files
from deltaopt.files.atomic_write import write_text
from deltaopt.files.output_folder import require_writable
from deltaopt.files.progress_bar import ProgressBar

FIVE_BAR = "five-bar"
SUFFIXES = (".yaml", ".yml")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("what", nargs="+", metavar="WHAT", help="dynamics, or scenes and five-bar")
    words = "default: out/compare_WHAT"
    parser.add_argument("-o", dest="directory", type=folder, metavar="DIR", help=words)
    words = "random states (default 100)"
    parser.add_argument("--states", type=one_or_more, default=100, help=words)
    words = "timings of each (default 200)"
    parser.add_argument("--rounds", type=one_or_more, default=200, help=words)


def run(arguments: argparse.Namespace) -> int:
    if arguments.what == ["dynamics"]:
        return _dynamics(arguments)
    unknown = [w for w in arguments.what if w != FIVE_BAR and Path(w).suffix not in SUFFIXES]
    if unknown:
        raise WrongUsage(
            f"{' '.join(arguments.what)} cannot be compared; give dynamics alone, or scene files "
            f"(.yaml) and {FIVE_BAR}"
        )
    return _plans(arguments)


def _plans(arguments: argparse.Namespace) -> int:
    """Solve the scenes in every formulation, print tables and save charts."""
    from deltaopt.compare.plans.cases import delta_case, five_bar_case
    from deltaopt.compare.plans.report import answer, csv, tables
    from deltaopt.compare.plans.study import compare_plans
    from deltaopt.plots.plans import draw

    cases = [
        five_bar_case() if what == FIVE_BAR else delta_case(file.stem, load_fastest(file))
        for what, file in ((what, Path(what)) for what in arguments.what)
    ]
    directory = arguments.directory or Path("out/compare_plans")
    require_writable(directory)
    study = compare_plans(cases, ProgressBar())
    with new_files(directory, "plans.csv", *(f"{case.name}.png" for case in cases)) as folder:
        write_text(folder / "plans.csv", csv(study))
        for case in cases:
            draw(study, case.name, folder / f"{case.name}.png")
        print(answer(study), tables(study), sep="\n\n")
        print(f"\n{study.seconds:.0f} s in all")
    return 0


def _dynamics(arguments: argparse.Namespace) -> int:
    """Measure the formulations of the dynamics, print tables and save a chart."""
    from deltaopt.codegen.c_compiler import compiler
    from deltaopt.compare.dynamics.report import answer, csv, notes, table, verdict
    from deltaopt.compare.dynamics.study import compare_dynamics
    from deltaopt.plots.dynamics import draw

    directory = arguments.directory or Path("out/compare_dynamics")
    require_writable(directory)
    study = compare_dynamics(arguments.states, arguments.rounds, compiler(), ProgressBar())
    with new_files(directory, "dynamics.csv", "dynamics.png") as folder:
        write_text(folder / "dynamics.csv", csv(study))
        draw(study, folder / "dynamics.png")
        print(answer(study), table(study), notes(study), verdict(study), sep="\n\n")
        print()
    return 0
