"""The command line: arguments become values, errors one sentence and an exit code.

Exit codes: 0 done; 1 the problem has no (verified) solution; 2 bad input or usage, or output that
cannot be written; 130 stopped by Ctrl-C (by another signal 128 and its number); 141 nobody reads.
"""

from __future__ import annotations

import argparse
import logging
import os
import sys
from collections.abc import Callable
from typing import Any, Protocol

from deltaopt.cli import check, compare, completion, export, inverse, new, plan, verify, view
from deltaopt.cli.arguments import WrongUsage
from deltaopt.cli.streams import discard, flush, print_any_text, say
from deltaopt.errors import DeltaOptError, SceneError, on_one_line
from deltaopt.files.version import __version__
from deltaopt.interrupts.requests import Stopped, ignore_requests, requests_raised
from deltaopt.output.foreign_table import UnreadableTable
from deltaopt.output.saved_plan import UnreadablePlan


class Parser(argparse.ArgumentParser):
    """A parser, and those of its subcommands, that takes no abbreviated options: ``--start 1`` must
    not be taken for ``--starts 1``."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **{"allow_abbrev": False, **settings})


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
    "new": new,
    "plan": plan,
    "check": check,
    "inverse": inverse,
    "compare": compare,
    "verify": verify,
    "export": export,
    "view": view,
    "completion": completion,
}


class _OneLine(logging.Handler):
    """Writes to stderr what the package says: warnings, and to people at a terminal what is done
    that takes them seconds; with -vv the solver's iterations too."""

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno == logging.DEBUG:
            say(record.getMessage())
        elif record.levelno >= logging.WARNING or sys.stderr.isatty():
            say(f"deltaopt: {record.getMessage()}")


def _say_what_is_logged() -> None:
    log = logging.getLogger("deltaopt")
    if not log.handlers:
        log.addHandler(_OneLine())
        log.setLevel(logging.INFO)


def main(argv: list[str] | None = None) -> int:
    """Run the command that the arguments name and return its exit code.

    ``argv``: None for those of the process, which is to end afterwards. Raises SystemExit after
    ``--help`` and for arguments that are none.
    """
    if argv is not None:
        return exit_code(lambda: _run(argv))
    print_any_text()
    try:
        return exit_code(lambda: _run(sys.argv[1:]))
    finally:
        ignore_requests()


def _run(argv: list[str]) -> int:
    _say_what_is_logged()
    parser = command_line()
    if not argv:
        parser.print_help()
        return 0
    arguments = parser.parse_args(argv)
    return int(arguments.run(arguments))


def command_line() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = Parser(
        prog="deltaopt",
        description="Minimum-time motions of Delta robots under torque limits, verified.",
    )
    parser.add_argument("--version", action="version", version=f"deltaopt {__version__}")
    parser.set_defaults(command_line=parser)  # for the command that describes it to a shell
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name, command in COMMANDS.items():
        add_command(subparsers, name, command)
    return parser


def add_command(
    subparsers: argparse._SubParsersAction[Parser], name: str, command: Command
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
        with requests_raised():
            try:
                return run()
            finally:
                flush()
    except (SceneError, WrongUsage, UnreadablePlan, UnreadableTable) as error:
        return _failed(2, str(error))
    except DeltaOptError as error:
        return _failed(1, str(error))
    except BrokenPipeError:  # who reads the output has read enough: "deltaopt check ... | head"
        discard(sys.stdout)
        return 141
    except OSError as error:  # input errors are SceneErrors: this output cannot be written
        if error.filename is None:
            discard(sys.stdout)
        name = on_one_line(os.fsdecode(error.filename or "standard output"))
        return _failed(2, f"{name}: {error.strerror or error}")
    except Stopped as request:
        return _failed(128 + request.signal, "stopped")
    except KeyboardInterrupt:
        return _failed(130, "stopped")


def _failed(code: int, sentence: str) -> int:
    letters = (letter if letter.isprintable() else repr(letter)[1:-1] for letter in sentence)
    say(f"deltaopt: {''.join(letters)}")  # on one line, whatever a file is named
    return code
