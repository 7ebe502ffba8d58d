"""Data flows left to right: what a module may import, read from the source."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MODULES = {
    ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): file
    for file in sorted((ROOT / "deltaopt").rglob("*.py"))
}

ORDER = (
    ("errors", "files"),
    ("machine_code", "lanes"),
    ("dynamics",),
    ("mechanisms",),
    ("yaml_file",),
    ("record",),
    ("robot",),
    ("objectives",),
    ("scene",),
    ("model",),
    ("rows",),
    ("trajectory",),
    ("peaks",),
    ("limits", "feasibility"),
    ("effort", "pontryagin"),
    ("planning",),
    ("arrival",),
    ("verify",),
    ("export_c",),
    ("studies",),
    ("plots",),
    ("export",),
    ("cli",),
)
"""From left to right; a folder is one place. A module imports from its left or its own place."""

MAY_IMPORT = {
    "dynamics": {"casadi", "numpy", "deltaopt.dynamics", "deltaopt.errors"},
    "mechanisms": {"casadi", "deltaopt.dynamics", "deltaopt.mechanisms"},
}
ONLY_IN = {
    "matplotlib": {"plots"},
    "yaml": {"yaml_file"},
    "pydantic": {"record", "robot", "objectives", "scene"},
}
NEVER = [(place, "planning") for place in ("verify", "arrival", "limits", "effort", "pontryagin")]
"""Not even through others: the verifier shares nothing with the planner but the model."""
CONVENIENCES = {
    ("deltaopt.planning.plan", "deltaopt.export"),
    ("deltaopt.planning.plan", "deltaopt.verify"),
}
"""Plan.save hands over to what lies to its right, once it is called."""


def place(module: str) -> str:
    """errors, dynamics, ...; empty for the package itself and what it does not have."""
    return module.split(".")[1] if module.startswith("deltaopt.") else ""


def rank(module: str) -> int:
    return next(i for i, names in enumerate(ORDER) if place(module) in names)


def imports(module: str) -> set[str]:
    """Modules named in import statements anywhere in a module, but for annotations only."""
    tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = []
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            inner = {f"{node.module}.{alias.name}" for alias in node.names} & set(MODULES)
            found |= inner or {str(node.module)}
    return found


def ours(module: str) -> set[str]:
    return {name for name in imports(module) if place(name)}


INSIDE = [module for module in MODULES if place(module) not in ("", "__main__")]


def test_every_module_has_a_place():
    known = {name for names in ORDER for name in names}
    assert {place(module) for module in INSIDE} == known


@pytest.mark.parametrize("module", INSIDE)
def test_imports_come_from_the_left(module):
    for name in ours(module):
        if place(name) != place(module) and (module, name) not in CONVENIENCES:
            assert rank(name) < rank(module), f"{module} imports {name}"


@pytest.mark.parametrize("module", INSIDE)
def test_imports_are_allowed_here(module):
    for name in imports(module):
        for outside, places in ONLY_IN.items():
            if name.split(".")[0] == outside:
                assert place(module) in places, f"{module} imports {name}"
        allowed = MAY_IMPORT.get(place(module))
        if allowed is not None and name.split(".")[0] not in sys.stdlib_module_names:
            packages = {name, name.split(".")[0], ".".join(name.split(".")[:2])}
            assert packages & allowed, f"{module} imports {name}"


@pytest.mark.parametrize(("place_of", "forbidden"), NEVER)
def test_never_even_indirectly(place_of, forbidden):
    seen: set[str] = set()
    todo = {module for module in INSIDE if place(module) == place_of}
    while todo:
        module = todo.pop()
        seen.add(module)
        todo |= (ours(module) & set(MODULES)) - seen
    assert not {module for module in seen if place(module) == forbidden}


def test_no_cycles():
    """Between modules of one place; between places the order forbids them."""
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, " -> ".join([*path, module])
        if module not in done:
            for name in ours(module) & set(MODULES):
                visit(name, (*path, module))
            done.add(module)

    for module in INSIDE:
        visit(module, ())


def test_command_line_starts_without_charts():
    """--help must be quick: matplotlib is imported when something is drawn."""
    code = "import sys, deltaopt.cli; print('matplotlib' in sys.modules)"
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert run.stdout.strip() == "False"
