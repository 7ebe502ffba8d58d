"""Data flows left to right: what a module may import, read from the source."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import deltaopt
from deltaopt.scene.known_limits import LIMITS

ROOT = Path(__file__).parents[1]
MODULES = {
    ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): file
    for file in sorted((ROOT / "deltaopt").rglob("*.py"))
}

ORDER = (
    "curves",
    "errors",
    "later",
    "interrupts",
    "settings",
    "files",
    "codegen",
    "dynamics",
    "mechanisms",
    "robot",
    "limits",
    "problem.boundary",
    "scene",
    "problem",
    "motion",
    "planning.journal",
    "planning.plan",
    "planning.nlp",
    "planning.flat",
    "planning.formulations",
    "planning.mesh",
    "planning.switching",
    "planning.path",
    "planning.first_motions",
    "planning",
    "sensitivity",
    "research",
    "designs",
    "verify",
    "output",
    "compare",
    "sweeps",
    "plots",
    "report",
    "cli",
)
"""Rooms from left to right. A module imports from its own room and from rooms to its left."""

MOST_FILES = 17
"""In a room: more than about a dozen, and nobody knows what is in it."""
LISTS_OF_VALUES = {"limits"}
"""Rooms in which each file is one more value of a kind: they are as long as they need to be."""
MOST_LINES = 400
"""Of a file, with docstrings and blanks."""

MAY_IMPORT = {
    "curves": {"numpy", "deltaopt.curves"},
    "dynamics": {"casadi", "numpy", "deltaopt.dynamics", "deltaopt.errors", "deltaopt.interrupts"},
    "mechanisms": {"casadi", "deltaopt.dynamics", "deltaopt.mechanisms"},
}
VERIFY_MAY_IMPORT = {
    "deltaopt.curves",
    "deltaopt.errors",
    "deltaopt.interrupts",
    "deltaopt.files",
    "deltaopt.codegen",
    "deltaopt.dynamics",
    "deltaopt.mechanisms",
    "deltaopt.robot",
    "deltaopt.limits",
    "deltaopt.scene",
    "deltaopt.problem",
    "deltaopt.verify",
    "deltaopt.motion.trajectory",
}
"""What verification may share with planning: pure mathematics, the model, what limits and scenes
say, and the trajectory, which is data. Peaks, time scaling and effort it computes by itself."""
KNOW_THE_DELTA = {
    "limits.links",
    "scene.links",
    "verify.clearance",
}
"""Modules between a robot and a verified plan that know arms and forearms: all else knows a
`Machine`, so that other robots are planned too. ``scene.scene`` and ``scene.scene_file`` read files
of Deltas."""
ONLY_IN = {
    "matplotlib": {"plots"},
    "yaml": {"files"},
    "pydantic": {"files", "robot", "scene", "sweeps", "designs"},
    "pint": {"files"},
}


def place(module: str) -> str:
    """The room of a module; empty for the package itself and what it does not have."""
    inner = module.removeprefix("deltaopt.") if module.startswith("deltaopt.") else ""
    return next((room for room in sorted(ORDER, key=len, reverse=True) if _inside(inner, room)), "")


def _inside(inner: str, room: str) -> bool:
    return inner == room or inner.startswith(room + ".")


def rank(module: str) -> int:
    return ORDER.index(place(module))


@cache
def imports(module: str) -> set[str]:
    """Modules named in import statements anywhere in a module, for annotations too."""
    tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
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


INSIDE = [m for m in MODULES if m not in ("deltaopt", "deltaopt.__main__")]


def test_every_module_has_a_room():
    assert not [module for module in INSIDE if not place(module)]


def test_rooms_are_small():
    rooms = [
        str(file.parent)
        for module, file in MODULES.items()
        if file.name != "__init__.py" and place(module) not in LISTS_OF_VALUES
    ]
    assert {room: n for room in rooms if (n := rooms.count(room)) > MOST_FILES} == {}


def test_files_are_short():
    texts = {module: file.read_text(encoding="utf-8") for module, file in MODULES.items()}
    longer = {module for module, text in texts.items() if len(text.splitlines()) > MOST_LINES}
    assert not longer


def test_imports_come_from_the_left():
    for module in INSIDE:
        for name in ours(module):
            if place(name) != place(module):
                assert rank(name) < rank(module), f"{module} imports {name}"


KNOW_THE_PROBLEM_ALONE = (
    "problem.boundary",
    "problem.problem",
    "motion",
    "planning.nlp",
    "planning.flat",
    "planning.formulations",
    "planning.mesh",
    "planning.switching",
    "planning.refinement",
)
"""Solvers, meshes, slowing and gaps read the problem, never a scene, a key or a task."""
OF_A_SCENE = {"deltaopt.motion.lower_bound", "deltaopt.motion.links"}
"""Facts of a scene's geometry, of whatever motion."""


def test_what_solves_knows_no_scene():
    for module in set(INSIDE) - OF_A_SCENE:
        inner = module.removeprefix("deltaopt.")
        if any(_inside(inner, room) for room in KNOW_THE_PROBLEM_ALONE):
            seen = {name for name in ours(module) if place(name) == "scene"}
            assert not seen | (ours(module) & {"deltaopt.problem.of_scene"}), module


def test_few_modules_of_planning_know_the_delta():
    rooms = ("limits", "scene", "problem", "motion", "planning", "verify")
    others = {m for m in INSIDE if place(m).split(".")[0] in rooms}
    known = {"deltaopt.robot.robot", *(m for m in INSIDE if ".mechanisms.delta" in m)}
    found = {module.removeprefix("deltaopt.") for module in others if imports(module) & known}
    assert found == KNOW_THE_DELTA | {"scene.scene", "scene.scene_file"}


def test_imports_are_allowed_here():
    for module, name in [(each, name) for each in INSIDE for name in imports(each)]:
        for outside, places in ONLY_IN.items():
            if name.split(".")[0] == outside:
                assert place(module) in places, f"{module} imports {name}"
        allowed = MAY_IMPORT.get(place(module))
        if allowed is not None and name.split(".")[0] not in sys.stdlib_module_names:
            packages = {name, name.split(".")[0], ".".join(name.split(".")[:2])}
            assert packages & allowed, f"{module} imports {name}"


def test_the_verifier_does_not_know_the_planner():
    """Not even through others: it shares mathematics, the model, limits and the scene, no more."""
    for module in (m for m in INSIDE if place(m) == "verify"):
        for name in ours(module):
            parts = name.split(".")
            prefixes = {".".join(parts[:n]) for n in range(1, len(parts) + 1)}
            assert prefixes & VERIFY_MAY_IMPORT, f"{module} imports {name}"
    seen: set[str] = set()
    todo = {module for module in INSIDE if place(module) == "verify"}
    while todo:
        module = todo.pop()
        seen.add(module)
        todo |= (ours(module) & set(MODULES)) - seen
    assert not {module for module in seen if place(module).startswith("planning")}
    of_motion = {module for module in seen if place(module) == "motion"}
    assert of_motion <= {"deltaopt.motion", "deltaopt.motion.trajectory"}


def test_the_page_of_verification_lists_the_mathematics_that_it_shares():
    """Each name that it takes from ``deltaopt.curves``, and nothing else of that room."""
    taken = {
        alias.name
        for module in INSIDE
        if place(module) == "verify"
        for node in ast.walk(ast.parse(MODULES[module].read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("deltaopt.curves")
        for alias in node.names
    } - {"Array", "Index", "Truths"}
    page = (ROOT / "docs/verification.md").read_text(encoding="utf-8")
    (listed,) = re.findall(r"^- pure mathematics of[^;]*;$", page, re.MULTILINE)
    assert set(re.findall(r"`(\w+)`", listed)) == taken


def test_only_the_reader_of_scenes_knows_which_limits_there_are():
    """A new limit is one file, or a value in one, and one line of registration."""
    single = {type(limit).__module__ for limit in LIMITS} - {"deltaopt.limits.norms_and_ranges"}
    know = {module for module in INSIDE if imports(module) & single}
    assert know <= single | {"deltaopt.scene.known_limits"}


def test_verification_names_no_limit():
    """A new limit is verified without a change there."""
    names = {word for limit in LIMITS if limit.key for word in (limit.key.name, limit.name)}
    for module in (m for m in INSIDE if place(m) == "verify"):
        tree = ast.parse(MODULES[module].read_text(encoding="utf-8"))
        docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and id(node) not in docstrings:
                assert not any(f"{name}_" in str(node.value) for name in names), module
                assert node.value not in names, module
            if isinstance(node, ast.Attribute):
                assert not any(f"{name}_limits" == node.attr for name in names), module


def test_no_cycles():
    """Not even of imports in functions or for types alone."""
    done: set[str] = set()

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, " -> ".join([*path, module])
        if module not in done:
            for name in ours(module) & set(MODULES):
                visit(name, (*path, module))
            done.add(module)

    for module in INSIDE:
        visit(module, ())


def test_the_door_is_for_others():
    """It names all rooms: to go through it would be a circle. Plans alone ask it for names."""
    plans = {"deltaopt.planning.plan", "deltaopt.planning.cycles.cycle_plan"}
    assert not [module for module in INSIDE if "deltaopt" in imports(module)]
    assert {module for module in INSIDE if "deltaopt.later" in imports(module)} <= plans


def test_type_checkers_are_told_what_is_loaded_on_first_use():
    stub = ast.parse(MODULES["deltaopt"].with_suffix(".pyi").read_text(encoding="utf-8"))
    places = {
        alias.asname: str(node.module)
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    of_research = {name for name in places if name not in deltaopt.__all__}
    assert set(places) - of_research == set(deltaopt.__all__)
    assert of_research == {name for name in places if hasattr(deltaopt.research, name)}
    assert places.items() <= deltaopt.later.PLACES.items()


def loaded_by(code: str) -> set[str]:
    """The modules that a program has loaded at its end."""
    run = subprocess.run(
        [sys.executable, "-c", f"import sys; {code}; print(*sys.modules, file=sys.stderr)"],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=True,
    )
    return set(run.stderr.split())


LARGE = {"numpy", "casadi", "pydantic", "pint", "matplotlib"}


@pytest.mark.parametrize(
    ("code", "most"),
    [
        ("import deltaopt", 6),
        ("from deltaopt.cli import command_line; command_line(()).print_help()", 15),
    ],
)
def test_what_is_not_needed_is_not_loaded(code, most):
    """``import deltaopt`` and ``deltaopt --help`` take no longer than Python itself."""
    found = loaded_by(code)
    assert not found & LARGE
    assert len({name for name in found if name.split(".")[0] == "deltaopt"}) <= most


def test_commands_start_without_charts():
    """matplotlib is imported when something is drawn."""
    assert "matplotlib" not in loaded_by("from deltaopt.cli import command_line; command_line()")


def test_rooms_are_found_from_the_door():
    code = "import deltaopt; assert issubclass(deltaopt.Infeasible, deltaopt.errors.DeltaOptError)"
    assert "deltaopt.planning.planner" not in loaded_by(code)
    with pytest.raises(AttributeError, match="'deltaopt' has no attribute 'nothing'"):
        deltaopt.nothing  # noqa: B018  # what is asked for is the error


def test_a_function_is_not_hidden_by_the_room_of_its_name():
    """Python names a package in its parent when it is first imported."""
    code = "import deltaopt.verify.verification; assert callable(deltaopt.verify)"
    assert "deltaopt.verify.verification" in loaded_by(code)
