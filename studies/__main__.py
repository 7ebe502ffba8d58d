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
from pathlib import Path
from time import perf_counter
from types import ModuleType

from deltaopt.cli import Parser, describe, exit_code
from deltaopt.cli.streams import print_any_text
from studies import (
    animation,
    attack,
    bench,
    bodies,
    continuity,
    conventions,
    cycle,
    first_motions,
    friction,
    frontier,
    frozen,
    gallery,
    gap,
    keep_out,
    line,
    lower_bound,
    models,
    multistart,
    mutations,
    numbers,
    parts,
    processors,
    reference,
    sampling,
    sanitize,
    size,
    smooth,
    smoother,
    tables,
    terms,
    theory,
    triples,
    tutorial,
)
from studies.problems import PROBLEMS

DOCS = PROBLEMS.parent / "docs"


STUDIES: dict[str, ModuleType] = {
    "animation": animation,
    "attack": attack,
    "bench": bench,
    "bodies": bodies,
    "continuity": continuity,
    "conventions": conventions,
    "cycle": cycle,
    "first_motions": first_motions,
    "friction": friction,
    "frontier": frontier,
    "frozen": frozen,
    "gallery": gallery,
    "gap": gap,
    "keep_out": keep_out,
    "line": line,
    "lower_bound": lower_bound,
    "models": models,
    "multistart": multistart,
    "mutations": mutations,
    "numbers": numbers,
    "ompl": sampling,
    "parts": parts,
    "processors": processors,
    "reference": reference,
    "sanitize": sanitize,
    "size": size,
    "smooth": smooth,
    "smoother": smoother,
    "tables": tables,
    "terms": terms,
    "theory": theory,
    "triples": triples,
    "tutorial": tutorial,
}


def main(argv: list[str] | None = None) -> int:
    """Run one study, or all in turn, and return the exit code: the largest of them."""
    if argv is None:
        print_any_text()
    words = sys.argv[1:] if argv is None else argv
    parser = _parser(small="--small" in words)
    arguments = parser.parse_args(words)
    if arguments.study != "all":
        return exit_code(lambda: arguments.run(arguments))
    names = list(STUDIES)
    return _all(
        parser, names[names.index(arguments.after) + 1 if arguments.after else 0 :], arguments
    )


def _all(parser: argparse.ArgumentParser, names: list[str], arguments: argparse.Namespace) -> int:
    """Run these in turn, whatever becomes of each."""
    told, worst = [], 0
    for name in names:
        print(f"\n=== {name} ===", flush=True)
        begin = perf_counter()
        code = _unattended(parser.parse_args([name]))
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


def _unattended(arguments: argparse.Namespace) -> int:
    """Run one; an error that nobody expected is printed as Python does, and the others go on."""
    try:
        return exit_code(lambda: int(arguments.run(arguments)))
    except Exception:
        traceback.print_exc()
        return 1


def _parser(*, small: bool) -> argparse.ArgumentParser:
    """``small``: whether defaults are the small sizes."""
    parser = Parser(
        prog="python -m studies",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    subparsers = parser.add_subparsers(title="studies", metavar="NAME", dest="study", required=True)
    parsers = [
        (subparsers.add_parser(name, help=study.HELP), study) for name, study in STUDIES.items()
    ]
    for subparser, study in parsers:
        describe(subparser, study)
        subparser.set_defaults(**(study.SMALL if small else {}))
    every = subparsers.add_parser("all", help="run all of them in turn")
    every.add_argument("--after", choices=list(STUDIES), metavar="NAME", help="begin behind it")
    every.add_argument("--into", type=Path, metavar="DIR", help="copy charts there, as for docs/")
    for subparser in (every, *(subparser for subparser, _ in parsers)):
        subparser.add_argument("--small", action="store_true", help="in seconds, for a first look")
    return parser


if __name__ == "__main__":
    sys.exit(main())
