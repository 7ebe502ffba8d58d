"""Run a study: ``python -m studies NAME``, in a clone of the repository.

Without arguments a study runs at its documented size; --small makes it a matter of seconds.
``all`` runs every one in turn and unattended: one that fails is named at the end, --after NAME goes
on behind the last that was done, and --into docs copies each chart as soon as it is drawn.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import traceback
from importlib import import_module
from pathlib import Path
from time import perf_counter

from deltaopt.cli import Parser, describe, exit_code
from deltaopt.cli.streams import print_any_text
from studies.problems import PROBLEMS

DOCS = PROBLEMS.parent / "docs"
STUDIES = {
    "animation": "the moving picture of README.md, from report.html by a headless Chromium",
    "attack": "hostile input of many kinds: nothing wrong, no traceback, no hang",
    "bench": "measure plans on this machine: how fast, how many succeed, beside other programs",
    "bodies": "random scenes with keep-out bodies: clearances, times, refusals",
    "continuity": "whether neighbouring problems have neighbouring plans",
    "conventions": "draw the order of the motors, their zero and sign, and the axes",
    "cycle": "the 25-305-25 mm cycle: trapezoid, S-curve, timed optimally, free",
    "first_motions": "how often the first attempt leads to a plan, and how good a straight line is",
    "friction": "what Coulomb friction costs in time",
    "frontier": "what accuracy costs: the default beside Ipopt in every formulation, and other "
    "programs",
    "frozen": "hold plans of scenes of every kind against those that are recorded",
    "gallery": "draw the gallery: the pictures of a dozen shipped scenes",
    "gap": "hold the gaps that plans tell against true ones, on moves of many robots",
    "keep_out": "keep-out bodies: clearances measured, refusals held against a grid, planted "
    "passages",
    "line": "the straight line timed optimally, beside the quintic law and the free path",
    "lower_bound": "hold the lower bound for every path against the durations of plans",
    "models": "which model of the Delta, when: error towards singularities beside cost",
    "multistart": "how often several first guesses lead to a faster motion than one",
    "mutations": "take each feature away once, and name the tests that notice",
    "numbers": "hold the numbers of the pages against what commands last printed",
    "ompl": "OMPL, TOPP-RA and Ipopt in a chain, past bodies",
    "parts": "parts a minute by what motors are rated for, and random cycles",
    "processors": "the same plans by several processors' code",
    "reference": "write the pages that list all keys of robot and scene files",
    "sanitize": "all C under the compiler's sanitizers",
    "size": "count code lines, and the calls of a warm plan",
    "smooth": "what smooth torques cost in time",
    "smoother": "torques smoothed by a limit, by a cost, or by a little more time",
    "tables": "what controllers' interpolation of joint tables asks for",
    "terms": "what a scene needs to be modelled: what leaving out each term does",
    "theory": "draw how a plan is found: bang-bang torques, meshes, slowing, gaps",
    "triples": "three features at once, against a crude planner",
    "tutorial": "draw the pictures of the tutorial, and print its numbers",
}
"""The modules of the studies, each with its line in ``--help``. One is read when it is named:
others may need what is not installed."""


def main(argv: list[str] | None = None) -> int:
    """Run one study, or all in turn, and return the exit code: the largest of them."""
    if argv is None:
        print_any_text()
    words = sys.argv[1:] if argv is None else argv
    arguments = _parser(words).parse_args(words)
    if arguments.study != "all":
        return exit_code(lambda: arguments.run(arguments))
    names = list(STUDIES)
    return _all(names[names.index(arguments.after) + 1 if arguments.after else 0 :], arguments)


def _all(names: list[str], arguments: argparse.Namespace) -> int:
    """Run these in turn, whatever becomes of each."""
    told, worst = [], 0
    for name in names:
        print(f"\n=== {name} ===", flush=True)
        begin = perf_counter()
        code = _unattended([name, "--small"] if arguments.small else [name])
        copied = _copied(name, arguments.into) if arguments.into and code == 0 else []
        drawn = "".join(f", {file}" for file in copied)
        told.append(f"{name}: {perf_counter() - begin:.0f} s, exit code {code}{drawn}")
        worst = max(worst, code)
    print("", *told, sep="\n")
    return worst


def _copied(study: str, into: Path) -> list[Path]:
    """Copy the pictures of docs/ that a study has drawn; return the copies."""
    drawn = sorted((Path("out") / study).glob("*.png"))
    return [Path(shutil.copy(file, into)) for file in drawn if (DOCS / file.name).exists()]


def _unattended(words: list[str]) -> int:
    """Run one; an error that nobody expected is printed as Python does, and the others go on."""
    try:
        return main(words)
    except Exception:
        traceback.print_exc()
        return 1


def _parser(words: list[str]) -> argparse.ArgumentParser:
    """The parser of all studies, with the arguments of those that are named; with --small among the
    words their defaults are the small sizes."""
    parser = Parser(
        prog="python -m studies",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    subparsers = parser.add_subparsers(title="studies", metavar="NAME", dest="study", required=True)
    for name, told in STUDIES.items():
        subparser = subparsers.add_parser(name, help=told)
        if name in words:
            study = import_module(f"studies.{name}")
            describe(subparser, study)
            subparser.set_defaults(**(getattr(study, "SMALL", {}) if "--small" in words else {}))
        _add_small(subparser)
    every = subparsers.add_parser("all", help="run all of them in turn")
    every.add_argument("--after", choices=list(STUDIES), metavar="NAME", help="begin behind it")
    every.add_argument("--into", type=Path, metavar="DIR", help="copy charts there, as for docs/")
    _add_small(every)
    return parser


def _add_small(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--small", action="store_true", help="in seconds, for a first look")


if __name__ == "__main__":
    sys.exit(main())
