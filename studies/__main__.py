"""Run a study: ``python -m studies NAME``, in a clone of the repository.

Without arguments a study runs at its documented size; --small makes it a matter of seconds.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from typing import Protocol

from deltaopt.cli import Command, Parser, add_command, exit_code
from deltaopt.cli.streams import print_any_text
from studies import (
    agreement,
    basin,
    benchmarks,
    bodies,
    claims,
    conventions,
    cycle,
    first_motions,
    driven,
    frontier,
    frozen,
    gap,
    given_paths,
    interruptions,
    interrupts,
    inverse,
    keep_out,
    limits,
    line,
    lower_bound,
    models,
    mujoco_replay,
    multistart,
    objectives,
    open_loop,
    proportions,
    reference,
    sanitize,
    scaling,
    stability,
    tables,
    tilt,
    tolerances,
    tutorial,
    via,
)


class Study(Command, Protocol):
    """A module of this folder: a command whose arguments have the documented sizes as defaults."""

    @property
    def SMALL(self) -> Mapping[str, object]:
        """Defaults with which it takes seconds instead."""
        ...


STUDIES: dict[str, Study] = {
    "agreement": agreement,
    "basin": basin,
    "benchmarks": benchmarks,
    "claims": claims,
    "bodies": bodies,
    "conventions": conventions,
    "cycle": cycle,
    "first_motions": first_motions,
    "driven": driven,
    "frontier": frontier,
    "frozen": frozen,
    "gap": gap,
    "given_paths": given_paths,
    "interruptions": interruptions,
    "interrupts": interrupts,
    "inverse": inverse,
    "keep_out": keep_out,
    "limits": limits,
    "line": line,
    "lower_bound": lower_bound,
    "models": models,
    "mujoco": mujoco_replay,
    "multistart": multistart,
    "objectives": objectives,
    "open_loop": open_loop,
    "proportions": proportions,
    "reference": reference,
    "sanitize": sanitize,
    "scaling": scaling,
    "stability": stability,
    "tables": tables,
    "tilt": tilt,
    "tolerances": tolerances,
    "tutorial": tutorial,
    "via": via,
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
    codes = []
    for name in STUDIES:
        print(f"\n=== {name} ===", flush=True)
        own = parser.parse_args([name])
        codes.append(exit_code(lambda own=own: own.run(own)))  # type: ignore[misc]
    return max(codes)


def _parser(*, small: bool) -> argparse.ArgumentParser:
    """``small``: whether defaults are the small sizes."""
    parser = Parser(
        prog="python -m studies",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    subparsers = parser.add_subparsers(title="studies", metavar="NAME", dest="study", required=True)
    parsers = [(add_command(subparsers, name, study), study) for name, study in STUDIES.items()]
    for subparser, study in parsers:
        subparser.set_defaults(**(study.SMALL if small else {}))
    every = subparsers.add_parser("all", help="run all of them in turn")
    for subparser in (every, *(subparser for subparser, _ in parsers)):
        subparser.add_argument("--small", action="store_true", help="in seconds, for a first look")
    return parser


if __name__ == "__main__":
    sys.exit(main())
