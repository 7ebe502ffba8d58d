"""docs/dev/equations.md: every equation of the paper once, and every name there."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROWS = re.findall(
    r"^\| ([\d–]+) \| .+? \| (.+) \|$", (ROOT / "docs/dev/equations.md").read_text(), re.M
)
NAMES = sorted({name for _, where in ROWS for name in re.findall(r"`([^`]+)`", where)})


def test_each_equation_has_its_row():
    numbers = []
    for equations, _ in ROWS:
        first, _, last = equations.partition("–")
        numbers += range(int(first), int(last or first) + 1)
    assert numbers == list(range(1, 88))


def test_each_row_names_something():
    assert all("::" in where for _, where in ROWS)


@pytest.mark.parametrize("name", NAMES)
def test_name_exists(name):
    file, _, path = name.partition("::")
    scope = ast.parse((ROOT / file).read_text()).body
    for part in path.split("."):
        scope = next(getattr(node, "body", []) for node in scope if part in defined(node))


def defined(node):
    """Names a statement gives to its scope."""
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = getattr(node, "targets", [getattr(node, "target", None)])
    return [target.id for target in targets if isinstance(target, ast.Name)]
