"""The command line: words into values, errors into one sentence and an exit code.

Exit codes: 0 done; 1 the problem has no (verified) solution; 2 bad input or usage.
"""

from __future__ import annotations

import argparse
import sys
from typing import Protocol

from deltaopt.cli import bench, check, compare, export, inverse, plan, stability
from deltaopt.errors import DeltaOptError, SceneError


class Command(Protocol):
    """A module of this folder: one subcommand. ``HELP`` is its line in ``--help``."""

    HELP: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None: ...

    def run(self, arguments: argparse.Namespace) -> int:
        """The exit code."""
        ...


COMMANDS: dict[str, Command] = {
    "plan": plan,
    "check": check,
    "inverse": inverse,
    "compare": compare,
    "export": export,
    "bench": bench,
    "stability": stability,
}


def main(argv: list[str] | None = None) -> int:
    """Run one command."""
    parser = argparse.ArgumentParser(
        prog="deltaopt",
        description="Minimum-time motions of Delta robots under torque limits, verified.",
    )
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name, command in COMMANDS.items():
        subparser = subparsers.add_parser(
            name,
            help=command.HELP,
            description=command.__doc__,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.add_arguments(subparser)
        subparser.set_defaults(run=command.run)
    arguments = parser.parse_args(argv)
    try:
        return int(arguments.run(arguments))
    except SceneError as error:
        print(f"deltaopt: {error}", file=sys.stderr)
        return 2
    except DeltaOptError as error:
        print(f"deltaopt: {error}", file=sys.stderr)
        return 1
    except OSError as error:  # all input is read and checked: an output that cannot be written
        print(f"deltaopt: {error.filename}: {error.strerror}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("deltaopt: stopped", file=sys.stderr)
        return 130
