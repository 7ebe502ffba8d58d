"""Print a script that lets a shell complete deltaopt's commands, options and files.

For bash, in this shell and in later ones:

  eval "$(deltaopt completion bash)"
  deltaopt completion bash > ~/.local/share/bash-completion/completions/deltaopt

for zsh, into a directory of $fpath:

  deltaopt completion zsh > ~/.zfunc/_deltaopt

for fish:

  deltaopt completion fish > ~/.config/fish/completions/deltaopt.fish

The package shtab writes it: pip install -e '.[completion]' in the clone.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from deltaopt.cli.arguments import folder
from deltaopt.errors import installed

SHELLS = ("bash", "zsh", "fish")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="%(choices)s")


def run(arguments: argparse.Namespace) -> int:
    shtab = installed("shtab", "completion")
    parser = arguments.command_line()
    for action in _actions(parser):
        if action.type in (Path, folder):
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    print(shtab.complete(parser, shell=arguments.shell))
    return 0


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """The arguments of a parser and of its subcommands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for subparser in set(action.choices.values()):
                yield from _actions(subparser)
