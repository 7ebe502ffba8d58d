"""The command line: arguments become values, errors one sentence and an exit code.

Exit codes: 0 done; 1 the problem has no (verified) solution; 2 bad input or usage.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from typing import Protocol

from deltaopt.cli import bench, check, compare, export, inverse, plan
from deltaopt.cli.arguments import WrongUsage
from deltaopt.errors import DeltaOptError, SceneError


class Command(Protocol):
    """A subcommand, which is a module of this folder. ``HELP`` is its line in ``--help``."""

    HELP: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare its arguments."""
        ...

    def run(self, arguments: argparse.Namespace) -> int:
        """Run it and return the exit code."""
        ...


COMMANDS: dict[str, Command] = {
    "plan": plan,
    "check": check,
    "inverse": inverse,
    "compare": compare,
    "export": export,
    "bench": bench,
}


def main(argv: list[str] | None = None) -> int:
    """Run the command that the arguments name and return its exit code."""
    parser = argparse.ArgumentParser(
        prog="deltaopt",
        description="Minimum-time motions of Delta robots under torque limits, verified.",
    )
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name, command in COMMANDS.items():
        add_command(subparsers, name, command)
    arguments = parser.parse_args(argv)
    return exit_code(lambda: arguments.run(arguments))


def add_command(
    subparsers: argparse._SubParsersAction[argparse.ArgumentParser], name: str, command: Command
) -> argparse.ArgumentParser:
    """Add the parser of a command, whose ``run`` the parsed arguments then carry."""
    parser = subparsers.add_parser(
        name,
        help=command.HELP,
        description=command.__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_arguments(parser)
    parser.set_defaults(run=command.run)
    return parser


def exit_code(run: Callable[[], int]) -> int:
    """Run a command and return its exit code; an error becomes one sentence on stderr."""
    try:
        return run()
    except (SceneError, WrongUsage) as error:
        print(f"deltaopt: {error}", file=sys.stderr)
        return 2
    except DeltaOptError as error:
        print(f"deltaopt: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:  # who reads the output has read enough: "deltaopt check ... | head"
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except OSError as error:  # input errors are SceneErrors: this output cannot be written
        print(f"deltaopt: {error.filename}: {error.strerror}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("deltaopt: stopped", file=sys.stderr)
        return 130
