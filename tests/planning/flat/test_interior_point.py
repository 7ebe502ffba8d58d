"""Machine code: kept, shared, left out; plans with and without it; C for controllers."""

from __future__ import annotations

import shutil
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor

import casadi as ca
import numpy as np
import pytest

from deltaopt.cli import main
from deltaopt.codegen import c_compiler
from deltaopt.codegen.c_compiler import Compiler, compiler
from deltaopt.codegen.compile import CACHE, describe, in_machine_code, library
from deltaopt.codegen.simd_c import c_function
from deltaopt.codegen.vectorised import RowFunction
from deltaopt.dynamics.lagrange import Multiplier
from deltaopt.errors import DeltaOptError, Unreachable
from deltaopt.motion.time_scaling import safe_factor
from deltaopt.planning.flat import interior_point
from deltaopt.planning.formulations.choice import Flat
from deltaopt.planning.nlp.problem import InteriorPoint, Ipopt
from deltaopt.planning.plan import Plan
from deltaopt.planning.planner import Planner, plan
from deltaopt.problem.of_scene import problem_of
from deltaopt.robot.robot import load_robot
from deltaopt.scene.objective import TimeAndEffort
from deltaopt.scene.scene_file import load_scene
from studies.problems import PROBLEMS

ORSINO = load_robot(PROBLEMS / "robots" / "orsino.yaml")
PICK = load_scene(PROBLEMS / "pick_and_place.yaml")

WITH_FRICTION = PROBLEMS / "industrial_drive.yaml"
SCENES = [*sorted(PROBLEMS.glob("*.yaml")), *sorted(PROBLEMS.glob("objectives/*.yaml"))]
SCENES.remove(WITH_FRICTION)
SCENES.remove(PROBLEMS / "objectives" / "industrial_cross_smooth.yaml")  # not for Ipopt

needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")


@pytest.fixture
def empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv(CACHE, str(tmp_path / "cache"))
    return tmp_path / "cache"


def source(number: int) -> str:
    return f"int answer(void) {{ return {number}; }}\n"


# Kept libraries


@needs_compiler
def test_compiled_once(empty_cache, monkeypatch):
    first = library(source(1))
    assert first is not None
    monkeypatch.setattr(Compiler, "compile", lambda *_, **__: pytest.fail("built again"))
    assert library(source(1)) == first
    assert set(empty_cache.iterdir()) == {first, first.with_suffix(".sha256")}


@needs_compiler
def test_what_shapes_the_code_shapes_the_name(empty_cache, monkeypatch):
    names = {library(source(1)), library(source(2))}
    monkeypatch.setattr(c_compiler, "FLAGS", ("-O0",))
    c_compiler._compiler_at.cache_clear()
    names.add(library(source(1)))
    c_compiler._compiler_at.cache_clear()
    assert len(names) == 3


@needs_compiler
def test_two_processes_at_once(empty_cache):
    with ProcessPoolExecutor(2) as pool:
        paths = list(pool.map(library, [source(3)] * 4))
    assert len(set(paths)) == 1
    assert set(empty_cache.iterdir()) == {paths[0], paths[0].with_suffix(".sha256")}


@needs_compiler
def test_what_does_not_compile_is_no_library(empty_cache):
    assert library("this is not C") is None
    assert not list(empty_cache.iterdir())


@needs_compiler
def test_unwritable_cache_is_no_library(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(CACHE, str(tmp_path / "file"))
    assert library(source(1)) is None
    assert describe().startswith("none: ")


def test_without_compiler(empty_cache, monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert compiler() is None
    assert library(source(1)) is None
    assert "no C compiler found" in describe()
    x = ca.SX.sym("x")
    function = ca.Function("f", [x], [x**2])
    assert in_machine_code([function]) is None


# Four points at a time


@needs_compiler
@pytest.mark.parametrize("number", [1, 3, 4, 9])
def test_rows_are_those_of_casadi(number):
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p")
    values = [ca.atan2(x[0], x[1]) * p, ca.sqrt(ca.sumsqr(x)), ca.fmax(x[0], -x[1]), -x[0] / p]
    function = ca.Function("f", [x, p], [ca.vertcat(*values), ca.sin(x)])
    points = np.random.default_rng(number).normal(size=(number, 2))
    found = RowFunction(function)(points, parameters=np.array([0.7]))
    expected = function.map(number)(points.T, 0.7)
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours, theirs.full().T, rtol=1e-13)


def test_what_has_no_c_text_is_told():
    x = ca.SX.sym("x")
    with pytest.raises(DeltaOptError, match="has no C text"):
        c_function(ca.Function("f", [x], [ca.erf(x)]), "f")


# Plans


@needs_compiler
@pytest.mark.parametrize("scene", SCENES, ids=lambda file: file.stem)
def test_both_solvers_agree_on_shipped_scenes(scene):
    """To the tolerance, in what the scene's objective measures."""
    loaded = load_scene(scene)
    ours, theirs = (plan(loaded, solver=solver) for solver in (InteriorPoint(), Ipopt()))
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-3)
    assert ours.within_tolerance
    assert theirs.within_tolerance


@needs_compiler
def test_both_solvers_agree_with_friction():
    """One arm turns back: where more do, each place is a local optimum of its own, up to 2e-3
    apart, and which one is found depends on the first mesh and on rounding."""
    robot, start, goal = load_scene(WITH_FRICTION).robot, (0.75, 0.0, 0.0), (0.8, 0.1, 0.0)
    ours = Planner(robot, 0.75).plan(start, goal)
    theirs = Planner(robot, 0.75, solver=Ipopt()).plan(start, goal)
    assert ours.cost == pytest.approx(theirs.cost, rel=1e-3)
    assert ours.within_tolerance
    assert theirs.within_tolerance


def test_the_interior_point_method_is_for_the_flat_formulation():
    with pytest.raises(ValueError, match="solver is interior-point, which solves the flat"):
        Planner(ORSINO, formulation=Multiplier(), solver=InteriorPoint())


def test_same_plan_without_compiler():
    """In a process of its own: what is compiled stays so in this one."""
    script = (
        "from deltaopt.planning.planner import plan\n"
        "from deltaopt.scene.scene_file import load_scene\n"
        f"print(plan(load_scene({str(PROBLEMS / 'pick_and_place.yaml')!r})).duration)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", script],
        cwd=PROBLEMS.parent,
        env={"PATH": "", "PYTHONPATH": str(PROBLEMS.parent)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert float(ran.stdout) == pytest.approx(planned().duration, rel=1e-3)


def planned() -> Plan:
    return Planner(PICK.robot, PICK.payload, PICK.limits).plan(PICK.start, PICK.goal)


def test_another_payload_builds_nothing(monkeypatch):
    planner = Planner(ORSINO, 1.0)
    light = planner.plan(PICK.start, PICK.goal, payload=0.5)
    assert safe_factor(problem_of(light.scene), light.trajectory) <= 1 + 1e-9
    monkeypatch.setattr(Flat, "of", lambda *_, **__: pytest.fail("built again"))
    monkeypatch.setattr(interior_point, "library", lambda _: pytest.fail("compiled again"))
    monkeypatch.setattr(
        "deltaopt.codegen.vectorised.library", lambda _: pytest.fail("compiled again")
    )
    heavy = planner.plan(PICK.start, PICK.goal, payload=1.5)
    assert light.duration < heavy.duration
    assert heavy.scene.payload == 1.5
    assert safe_factor(problem_of(heavy.scene), heavy.trajectory) <= 1 + 1e-9


@needs_compiler
def test_another_weight_of_effort_writes_no_method(monkeypatch):
    """It is data to the method, which is the same for all weights."""

    def weighted(effort: float) -> Plan:
        return plan(PICK.model_copy(update={"objective": TimeAndEffort(effort=effort)}))

    light = weighted(3e-5)
    monkeypatch.setattr(interior_point, "library", lambda _: pytest.fail("written again"))
    assert light.duration < weighted(1e-3).duration


def test_many_plans_in_order():
    planner = Planner(ORSINO, 1.0)
    goals = [(0.45, 0.1, 0.0), (9.0, 0.0, 0.0), (0.46, 0.08, 0.03), (0.47, 0.0, 0.1)]
    pairs = [((0.45, -0.05, 0.0), goal) for goal in goals]
    alone, shared = planner.plan_many(pairs), planner.plan_many(pairs, workers=2)
    assert isinstance(alone[1], Unreachable)
    assert str(shared[1]) == str(alone[1])
    for mine, theirs, goal in zip(alone, shared, goals, strict=True):
        if isinstance(mine, Plan):
            assert isinstance(theirs, Plan)
            assert mine.duration == theirs.duration
            assert mine.scene.goal == goal


# C for controllers


@pytest.mark.parametrize("name", ["orsino", "industrial"])
def test_exported_c_gives_our_numbers(name, tmp_path, capsys):
    robot = PROBLEMS / "robots" / f"{name}.yaml"
    assert main(["export", "c", str(robot), "-o", str(tmp_path)]) == 0
    assert "delta.c" in capsys.readouterr().out
    command = shutil.which("gcc") or shutil.which("cc")
    if command is None:
        pytest.skip("no C compiler")
    strict = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O1"]
    files = ["delta.c", "test_delta.c", "-lm", "-o", "test_delta"]
    subprocess.run([command, *strict, *files], cwd=tmp_path, check=True)
    ran = subprocess.run([tmp_path / "test_delta"], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout
