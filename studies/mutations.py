"""What notices a feature that does not run: each is taken away once, and its tests must fail.

This module is also the plugin of pytest that takes one away, before any test is collected.
"""

from __future__ import annotations

import argparse
import csv
import inspect
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from deltaopt.limits.limit import Limit

SMALL: Mapping[str, object] = {"names": ("jumps at knots are measured",)}

_ROOT = Path(__file__).parents[1]
_NAME = "DELTAOPT_TAKEN_AWAY"
"""The variable of the environment by which the plugin is told what to take away."""
_OPTIONS = ("-p", "studies.mutations", "-p", "no:cacheprovider", "-n", "0", "-x", "-q", "-rfE")

Change = Callable[[Any], Any]
"""A function or property of the package -> what it is replaced by."""


@dataclass(frozen=True)
class Mutation:
    """A feature that is taken away: ``target``, a module and a name in it, is replaced as
    ``change`` says. ``tests``: a file of the feature's, and ``named`` those of it, by -k."""

    target: str
    change: str
    tests: str
    named: str

    def found(self) -> tuple[Any, str]:
        """What has the target, and by which name. Raises AttributeError where nothing has it."""
        module, _, path = self.target.partition(":")
        owner: Any = import_module(f"deltaopt.{module}")
        *outer, last = path.split(".")
        for name in outer:
            owner = getattr(owner, name)
        inspect.getattr_static(owner, last)
        return owner, last


def _always(value: object) -> Change:
    """To what returns a value, whatever it is asked."""

    def change(original: Any) -> Any:
        def instead(*_: object, **__: object) -> object:
            return value

        return property(instead) if isinstance(original, property) else instead

    return change


def _zeros(original: Any) -> Any:
    """To what returns the same measures, all of them zero."""
    return lambda *given, **options: dict.fromkeys(original(*given, **options), 0.0)


def _the(number: int) -> Change:
    """To what returns what it is given as one of its arguments."""
    return lambda original: lambda *given, **options: given[number]


CHANGES: dict[str, Change] = {
    "none": _always(None),
    "empty": _always(()),
    "empty mapping": _always({}),
    "0": _always(0.0),
    "1": _always(1.0),
    "a gap of 1e-9": lambda _: lambda last, _before: replace(last, gap=1e-9),
    "zeros": _zeros,
    "first argument": _the(0),
    "second argument": _the(1),
    "untightened": lambda _: lambda last, *_: replace(last.scaling, share=1.0),
    "one start": lambda _: lambda self, scene, usual, search: usual(scene),
    "followed": _always({"amplification": 1.0, "arrival_distance": 0.0, "arrival_speed": 0.0}),
    "links as they come": lambda _: lambda scene, planned, *_: planned(scene),
}
"""What a function or property is replaced by: what it returns then, in words."""


def _table() -> dict[str, Mutation]:
    with (_ROOT / "studies" / "mutations.csv").open(encoding="utf-8", newline="") as file:
        return {row.pop("feature"): Mutation(**row) for row in csv.DictReader(file)}


MUTATIONS = _table()
"""Every feature by what it is: without the change these tests pass."""


def pytest_configure() -> None:
    """Take away what the environment names, in every module that has it by name."""
    mutation = MUTATIONS[os.environ[_NAME]]
    owner, last = mutation.found()
    original = inspect.getattr_static(owner, last)
    changed = CHANGES[mutation.change](original)
    if isinstance(owner, Limit):  # a value: its class has other limits too
        object.__setattr__(owner, last, changed)
    else:
        setattr(owner, last, changed)
    for each in [each for name, each in sys.modules.items() if name.startswith("deltaopt.")]:
        for name in [name for name, value in vars(each).items() if value is original]:
            setattr(each, name, changed)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--names",
        nargs="+",
        choices=sorted(MUTATIONS),
        default=tuple(MUTATIONS),
        metavar="FEATURE",
        help="take these away alone (default: each in turn)",
    )


def run(arguments: argparse.Namespace) -> int:
    unnoticed = 0
    for name in arguments.names:
        noticed = noticed_by(name)
        unnoticed += noticed is None
        print(f"{name}: {noticed or 'no test notices'}", flush=True)
    print(f"{len(arguments.names)} features taken away, {unnoticed} of them unnoticed")
    return int(unnoticed > 0)


def noticed_by(name: str) -> str | None:
    """The first test that fails without a feature; None if none does."""
    mutation = MUTATIONS[name]
    tests = [f"tests/{mutation.tests}", "-k", mutation.named]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *_OPTIONS, *tests],
        cwd=_ROOT,
        env={**os.environ, _NAME: name},
        capture_output=True,
        text=True,
    )
    if done.returncode not in (0, 1):  # none was run
        raise RuntimeError(f"{name}: {done.stdout}{done.stderr}")
    said = [line.partition(" ") for line in done.stdout.splitlines()]
    return next((what for word, _, what in said if word in ("FAILED", "ERROR")), None)
