"""The command line: arguments become values, errors one sentence and an exit code.

Exit codes: 0 done; 1 the problem has no (verified) solution; 2 bad input or usage, or output that
cannot be written; 130 stopped by Ctrl-C (by another signal 128 and its number); 141 nobody reads.
"""

from __future__ import annotations

import argparse
import logging
import os
import sys
from collections.abc import Callable, Container
from importlib import import_module
from types import ModuleType
from typing import Any

from deltaopt.cli.streams import discard, flush, print_any_text, say
from deltaopt.errors import DeltaOptError, Unusable, on_one_line
from deltaopt.interrupts.requests import Stopped, ignore_requests, requests_raised


class Parser(argparse.ArgumentParser):
    """A parser, and those of its subcommands, that takes no abbreviated options: ``--start 1`` must
    not be taken for ``--starts 1``."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **{"allow_abbrev": False, **settings})


class _Version(argparse.Action):
    """Says the version, which is looked up for this alone: that takes as long as all else."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(nargs=0, **settings)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from deltaopt.files.version import __version__

        print(f"deltaopt {__version__}")
        parser.exit()


COMMANDS = {
    "new": "write a commented robot file and scene file to start from",
    "plan": "find the best motion of a scene, the fastest as a rule, and verify it",
    "map": "plan a move at many places of the cell: how fast is the robot where",
    "sweep": "plan many variants of scenes and robots, a row of a table each",
    "check": "check a scene or a robot and say what is modelled",
    "inverse": "compute the torques along a straight line (the paper's Figs. 4 and 5)",
    "compare": "compare formulations, of the dynamics or of plans, as tables and charts",
    "verify": "verify a saved plan, or measure a table of motor angles",
    "design": "find the lengths, gears and motors that make scenes fastest, or cheapest",
    "export": "write a plan for a controller, or a robot's model in C or for MuJoCo",
    "view": "look at a saved plan in a browser, in three dimensions",
    "completion": "print a script with which a shell completes commands, options and files",
}
"""The modules of the commands, each with its line in ``--help``. One is read when it is named."""


class _OneLine(logging.Handler):
    """Writes to stderr what the package says: warnings, and to people at a terminal what is done
    that takes them seconds; with -vv the solver's iterations too."""

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno == logging.DEBUG:
            say(record.getMessage())
        elif record.levelno >= logging.WARNING or sys.stderr.isatty():
            say(f"deltaopt: {record.getMessage()}")


def main(argv: list[str] | None = None) -> int:
    """Run the command that the arguments name and return its exit code.

    ``argv``: None for those of the process, which is to end afterwards. Raises SystemExit after
    ``--help`` and for arguments that are none.
    """
    if argv is not None:
        return _run(argv)
    print_any_text()
    try:
        return _run(sys.argv[1:])
    finally:
        ignore_requests()


def _run(argv: list[str]) -> int:
    """Run what the arguments ask for."""
    log = logging.getLogger("deltaopt")
    if not log.handlers:
        log.addHandler(_OneLine())
        log.setLevel(logging.INFO)
    parser = command_line(argv)  # reads modules: requests to stop are heeded afterwards

    def run() -> int:
        if not argv:
            parser.print_help()
            return 0
        arguments = parser.parse_args(argv)
        return int(arguments.run(arguments))

    return exit_code(run)


def command_line(named: Container[str] = frozenset(COMMANDS)) -> argparse.ArgumentParser:
    """The parser of all commands; arguments are known of those that are ``named``."""
    parser = Parser(
        prog="deltaopt",
        description="Minimum-time motions of Delta robots under torque limits, verified.",
    )
    parser.add_argument("--version", action=_Version, help="show program's version number and exit")
    parser.set_defaults(command_line=command_line)  # for the command that describes it to a shell
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for name, words in COMMANDS.items():
        subparser = subparsers.add_parser(name, help=words)
        if name in named:
            describe(subparser, import_module(f"deltaopt.cli.{name}"))
    return parser


def describe(parser: argparse.ArgumentParser, command: ModuleType) -> None:
    """Let the module of a command ``add_arguments``; the parsed ones then carry its ``run``, which
    returns the exit code."""
    parser.description = command.__doc__
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    command.add_arguments(parser)
    parser.set_defaults(run=command.run)


def exit_code(run: Callable[[], int]) -> int:
    """Run a command and return its exit code; an error becomes one sentence on stderr."""
    try:
        with requests_raised():
            try:
                return run()
            finally:
                flush()
    except Unusable as error:
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
