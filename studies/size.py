"""How big the program is, and how much of it a warm plan calls.

Code lines are those without docstrings, comments and blanks. A warm plan is the third of
problems/pick_and_place.yaml in a process: everything is compiled and loaded then. What is counted
are calls of Python functions of deltaopt, generators once for each value, and frames above the
compiled method.
"""

from __future__ import annotations

import argparse
import ast
import sys
from collections import Counter
from pathlib import Path
from types import FrameType

import deltaopt
from studies.problems import PROBLEMS

ROOT = Path(__file__).parents[1]
_PACKAGE = str(ROOT / "deltaopt")
_LONG = 400
_METHOD = "CompiledMethod.run"
"""What calls the compiled method."""


def code_lines(text: str) -> int:
    """The lines of Python source without docstrings, comments and blanks."""
    documented = set[int]()
    for node in ast.walk(ast.parse(text)):
        body = getattr(node, "body", None)
        for each in body if isinstance(body, list) else []:
            constant = isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant)
            if constant and isinstance(each.value.value, str):
                documented.update(range(each.lineno, each.end_lineno + 1))
    lines = enumerate(map(str.strip, text.splitlines()), 1)
    return sum(
        bool(line) and not line.startswith("#") and number not in documented
        for number, line in lines
    )


def protocols(text: str) -> int:
    """How many protocols a source defines."""
    classes = (node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ClassDef))
    return sum(any("Protocol" in ast.unparse(base) for base in each.bases) for each in classes)


class Calls:
    """Counts the calls of deltaopt's functions while it is the profile of a thread."""

    def __init__(self) -> None:
        self.counts = Counter[str]()
        self.deepest = 0

    def __call__(self, frame: FrameType, event: str, argument: object) -> None:
        """One event of ``sys.setprofile``."""
        if event != "call" or not frame.f_code.co_filename.startswith(_PACKAGE):
            return
        name = frame.f_code.co_qualname
        self.counts[f"{Path(frame.f_code.co_filename).stem}.{name}"] += 1
        if name == _METHOD:
            self.deepest = max(self.deepest, _ours(frame))


def _ours(frame: FrameType | None) -> int:
    """How many frames from this one outwards are deltaopt's."""
    found = 0
    while frame is not None:
        found += frame.f_code.co_filename.startswith(_PACKAGE)
        frame = frame.f_back
    return found


def calls_of_a_warm_plan() -> Calls:
    """The calls of the third plan of pick_and_place in this process."""
    scene = deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml")
    for _ in range(2):
        deltaopt.plan(scene)
    calls = Calls()
    sys.setprofile(calls)
    try:
        deltaopt.plan(scene)
    finally:
        sys.setprofile(None)
    return calls


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--most", type=int, default=0, metavar="N", help="print the N functions called most often"
    )


def run(arguments: argparse.Namespace) -> int:
    print(f"{'':<12}{'files':>7}{'code lines':>12}{'above ' + str(_LONG):>12}{'protocols':>11}")
    for folder in ("deltaopt", "studies", "tests"):
        texts = [file.read_text(encoding="utf-8") for file in (ROOT / folder).rglob("*.py")]
        long = sum(len(text.splitlines()) > _LONG for text in texts)
        total, declared = sum(map(code_lines, texts)), sum(map(protocols, texts))
        print(f"{folder:<12}{len(texts):>7}{total:>12,}{long:>12}{declared:>11}")
    calls = calls_of_a_warm_plan()
    print(
        f"a warm plan of pick_and_place: {calls.counts.total()} calls of {len(calls.counts)} "
        f"functions, {calls.deepest} frames above the compiled method"
    )
    for name, number in calls.counts.most_common(arguments.most):
        print(f"{number:>6}  {name}")
    return 0
