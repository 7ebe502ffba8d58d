"""All C of deltaopt under the compiler's sanitizers, on what planning really computes.

Address and undefined: every array is a block of memory of its own, of exactly its size, and so is
every part of the interior-point method's workspace. New memory is filled with what is no number, so
that reading it shows in the results. Thread: eight threads compute everything at once.

Without --small the problems of the method's own tests are solved too.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import ArrayLike, NDArray

import deltaopt
from deltaopt.codegen import dense_solver, vectorised
from deltaopt.codegen.c_compiler import compiler
from deltaopt.codegen.vectorised import RowFunction
from deltaopt.curves.piecewise import Array
from deltaopt.output.controller_c import export_c
from deltaopt.planning.flat.interior_point import CompiledMethod, Settings
from deltaopt.planning.flat.method_source import source
from deltaopt.planning.path import on_mesh, sweep
from deltaopt.scene.task import given_points
from studies.bench.random_scenes import random_scenes
from studies.problems import INDUSTRIAL, ORSINO

SANITIZERS = ("address,undefined", "thread")
SMALL = {
    "robots": (ORSINO,),
    "moves": 1,
    "functions": 1,
    "own_tests": False,
    "sanitizers": SANITIZERS[:1],
}
_LEVEL = {"address,undefined": "-O0", "thread": "-O1"}
"""With which the large sources compile fastest."""
_FLAGS = ("-g", "-march=native", "-fno-sanitize-recover=all", "-pthread")
_NOT_A_NUMBER = "detect_leaks=0:max_malloc_fill_size=1073741824:malloc_fill_byte=255"
"""Options of the address sanitizer: a double of such bytes is not a number."""
_THREADS = {"address,undefined": 1, "thread": 8}
_CALLS = 40
"""Of one function, the first of which are computed again."""
_LONGEST = 600.0
_AGREE = 1e-3
"""Relative difference of results. Other flags round otherwise, and the interior-point method stops
at its tolerance: to so much it repeats itself."""

_RECORDED = Path(__file__).with_suffix(".c").read_text(encoding="utf-8")
_PARTS = "static void *part("
_OWN_PARTS = """\
static void *part(uintptr_t *address, int64_t bytes) {
  (void)address;
  return aligned_alloc(64, (size_t)(bytes + 63) / 64 * 64);
}
"""
_TAKEN = "static double *taken("
_OWN_TAKEN = """\
static double *taken(double **memory, int64_t numbers) {
  (void)memory;
  return malloc((size_t)numbers * sizeof(double));
}
"""
"""What gives out parts of one block of memory, and what takes its place: each by itself."""


class Finding(deltaopt.DeltaOptError):
    """What a sanitizer says, or a result that differs."""


@dataclass
class Program:
    """C text with a function ``compute``, and the calls that it computes again: arrays each."""

    name: str
    text: str
    calls: list[list[NDArray[np.generic]]] = field(default_factory=list)

    def write_calls(self, file: Path) -> None:
        """For the program to read: the number of calls, of each the number of arrays, of each
        array the number of its numbers of 8 bytes, and these."""
        with file.open("wb") as out:
            np.int64(len(self.calls)).tofile(out)
            for arrays in self.calls:
                np.int64(len(arrays)).tofile(out)
                for array in arrays:
                    np.int64(array.size).tofile(out)
                    array.tofile(out)

    def run(self, sanitizer: str) -> float:
        """Compile and run it; by how much results differ. Raises Finding."""
        with tempfile.TemporaryDirectory() as folder:
            text, data = Path(folder) / "a.c", Path(folder) / "calls"
            text.write_text(self.text)
            self.write_calls(data)
            arguments = [str(data), str(_THREADS[sanitizer])]
            printed = built_and_run(self.name, sanitizer, [text], arguments)
        worst = float(printed)
        if not worst <= _AGREE:
            raise Finding(f"{self.name} by {sanitizer}: results differ by {worst:.1e}")
        return worst


def built_and_run(
    name: str, sanitizer: str, sources: Sequence[Path], arguments: Sequence[str]
) -> str:
    """What a program prints that is compiled with a sanitizer. Raises Finding."""
    found, program = compiler(), sources[0].with_name("program")
    assert found is not None
    flags = [_LEVEL[sanitizer], *_FLAGS, f"-fsanitize={sanitizer}"]
    build = [found.command, *found.arguments, *flags, *map(str, sources), "-lm", "-o", str(program)]
    made = subprocess.run(build, capture_output=True, text=True, timeout=_LONGEST)
    if made.returncode:
        raise Finding(f"{name} does not compile with {sanitizer}: {made.stderr}")
    run = subprocess.run(
        [str(program), *arguments],
        capture_output=True,
        text=True,
        timeout=_LONGEST,
        env=os.environ | {"ASAN_OPTIONS": _NOT_A_NUMBER, "UBSAN_OPTIONS": "print_stacktrace=1"},
    )
    if run.returncode or run.stderr:
        raise Finding(f"{name} by {sanitizer} ended with {run.returncode}:\n{run.stderr}")
    return run.stdout


def missing(sanitizer: str) -> str | None:
    """A sentence that says why a sanitizer cannot be used here; None if it can."""
    if compiler() is None:
        return "there is no C compiler here"
    with tempfile.TemporaryDirectory() as folder:
        text = Path(folder) / "a.c"
        text.write_text("int main(void) { return 0; }\n")
        try:
            built_and_run("", sanitizer, [text], [])
        except Finding:
            return f"the C compiler here has no -fsanitize={sanitizer} that works"
    return None


@contextmanager
def recorded(programs: dict[str, Program]) -> Iterator[None]:
    """Record the calls of compiled functions that are made in the block, by C text."""
    run, rows, mesh = CompiledMethod.run, RowFunction.with_failures, on_mesh.run

    def run_recorded(
        method: CompiledMethod,
        phases: int,
        given: Sequence[NDArray[Any]],
        settings: Settings,
        *,
        is_warm: bool,
    ) -> object:
        flags, rule, numbers, motion, multipliers = given
        guess, known = motion.copy(), multipliers.copy() if is_warm else np.zeros_like(multipliers)
        result = run(method, phases, given, settings, is_warm=is_warm)
        start = [settings.tolerance, settings.row_tolerance, settings.barrier, settings.closest]
        whole = np.array([phases, settings.iterations, is_warm], dtype=np.int64)
        arrays = [whole, flags, rule, numbers, guess, np.array(start), known]
        arrays += [np.array([float(result[0])]), motion.copy(), multipliers.copy()]
        _add(programs, _method_text(method), "interior-point method", arrays)
        return result

    def rows_recorded(
        function: RowFunction, *arguments: ArrayLike, parameters: Array
    ) -> vectorised.Checked:
        results, failed = rows(function, *arguments, parameters=parameters)
        if function.function.is_a("SXFunction"):
            points = [np.atleast_2d(np.asarray(a, dtype=float)) for a in arguments]
            number = max(len(each) for each in points)
            same = [np.broadcast_to(each, (number, each.shape[1])) for each in points]
            given = [np.ascontiguousarray(a, dtype=float) for a in (*same, parameters)]
            arrays = [*given, *(np.atleast_2d(each) for each in results)]
            _add(programs, _rows_text(function), function.function.name(), arrays)
        return results, failed

    def mesh_recorded(
        code: Any,
        function: RowFunction,
        sizes: tuple[int, ...],
        numbers: tuple[float, ...],
        given: Sequence[Array | None],
    ) -> tuple[int, Array]:
        status, results = mesh(code, function, sizes, numbers, given)
        arrays = [np.array(sizes, dtype=np.int64), np.array(numbers)]
        arrays += [np.zeros(0) if a is None else np.ascontiguousarray(a) for a in given]
        arrays += [np.array([float(status)]), results]
        for own_parts in (False, True):
            name = "mesh of a path" + (", parts of memory apart" if own_parts else "")
            _add(programs, _mesh_text(function, own_parts=own_parts), name, arrays)
        return status, results

    with (
        patch.object(CompiledMethod, "run", run_recorded),
        patch.object(on_mesh, "run", mesh_recorded),
        patch.object(RowFunction, "with_failures", rows_recorded),
    ):
        yield


def _add(
    programs: dict[str, Program], text: str, name: str, arrays: list[NDArray[np.generic]]
) -> None:
    program = programs.setdefault(text, Program(name, text))
    if len(program.calls) < _CALLS:
        program.calls.append(arrays)


def _method_text(method: CompiledMethod) -> str:
    text = source(method.problem, len(method.points.fractions))
    return f"{_replaced(text, _PARTS, _OWN_PARTS)}\n#define METHOD\n{_RECORDED}"


def _mesh_text(function: RowFunction, *, own_parts: bool) -> str:
    rows, text = vectorised.source(function.function), sweep.source()
    text = _replaced(text, _TAKEN, _OWN_TAKEN) if own_parts else text
    return f"{rows}{text}\n#define MESH\n{_RECORDED}"


def _replaced(text: str, declared: str, own: str) -> str:
    """C text with another function instead of one that is declared so."""
    assert text.count(declared) == 1
    unused = f"__attribute__((unused)) {declared.rstrip('(')}_as_it_was("
    return text.replace(declared, f"#include <stdlib.h>\n{own}{unused}")


def _rows_text(function: RowFunction) -> str:
    """N is the number of rows of the first array."""
    inputs = [function.function.size1_in(i) for i in range(function.function.n_in())]
    outputs = [
        function.times * function.function.size1_out(i) for i in range(function.function.n_out())
    ]
    outputs = outputs[:-1] if function.guarded else outputs
    first = len(inputs)
    addresses = [*(f"c->array[{i}]" for i in range(first)), *(f"r{i}" for i in range(len(outputs)))]
    words = ["n", *map(str, inputs[:-1]), *(f"(int64_t){each}" for each in (*addresses, "failed"))]
    lines = [
        "static void compute(const Call *c, double *worst) {",
        f"  const int64_t n = c->count[0] / {inputs[0]};",
        *(f"  double *r{i} = block(8 * n * {size});" for i, size in enumerate(outputs)),
        "  unsigned char *failed = block(n);",
        f"  const int64_t call[] = {{{', '.join(words)}}};",
        "  rows(call);",
        *(
            f"  compare(r{i}, c->array[{first + i}], n * {size}, worst);\n  free(r{i});"
            for i, size in enumerate(outputs)
        ),
        "  free(failed);",
        "}",
    ]
    return (
        vectorised.source(function.function, guarded=function.guarded, times=function.times)
        + _RECORDED
        + "\n".join(lines)
        + "\n"
    )


def dense_systems() -> Program:
    """Random systems of 1 to 40 unknowns, and singular ones."""
    rng, calls = np.random.default_rng(1), list[list[NDArray[np.generic]]]()
    for n in range(1, 41):
        width = (n + 4) // 4 * 4
        rows = np.zeros((n, width))
        rows[:, : n + 1] = rng.normal(size=(n, n + 1))
        if n % 5 == 0:
            rows[:, n // 2] = 0.0
        found = dense_solver.solve(rows[:, :n], rows[:, n])
        solution = np.full(n, np.nan) if found is None else found
        whole = np.array([n, width], dtype=np.int64)
        calls.append([whole, rows.ravel(), np.array([float(found is not None)]), solution])
    return Program("dense solver", f"{dense_solver.C_TEXT}\n#define GAUSS\n{_RECORDED}", calls)


def check_controller(robot: deltaopt.Robot, sanitizer: str) -> str:
    """The exported C with its own test program. Raises Finding."""
    with tempfile.TemporaryDirectory() as folder:
        files = [file for file in export_c(robot, Path(folder)) if file.suffix == ".c"]
        return built_and_run("controller", sanitizer, files, []).splitlines()[0]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(robots=(ORSINO, INDUSTRIAL), moves=5, functions=100, own_tests=True)
    parser.set_defaults(sanitizers=SANITIZERS)


def run(arguments: argparse.Namespace) -> int:
    usable = []
    for sanitizer in arguments.sanitizers:
        why = missing(sanitizer)
        print(f"{sanitizer}: {why or 'works here'}", flush=True)
        usable += [] if why else [sanitizer]
    programs: dict[str, Program] = {}
    robots = [deltaopt.load_robot(file) for file in arguments.robots]
    with recorded(programs):
        for robot in robots:
            _plan(robot, arguments.moves, resolved=arguments.own_tests)
        if arguments.own_tests:
            _tests_of_the_method()
    whole = ("interior-point method", "mesh of a path")
    rows = [p for p in programs.values() if not p.name.startswith(whole)]
    methods = [p for p in programs.values() if p.name.startswith(whole)]
    chosen = [*methods, *rows[: arguments.functions], dense_systems()]
    failed = 0
    for sanitizer in usable:
        for program in chosen:
            what = f"{sanitizer}: {program.name}, {len(program.calls)} calls"
            failed += _told(what, partial(_difference, program, sanitizer))
        for robot in robots:
            what = f"{sanitizer}: controller of {robot.name}"
            failed += _told(what, partial(check_controller, robot, sanitizer))
    print(f"{failed} findings")
    return 1 if failed else 0


def _difference(program: Program, sanitizer: str) -> str:
    return f"results differ by {program.run(sanitizer):.1e}"


def _told(what: str, work: Callable[[], str]) -> int:
    """Print what comes of it; 1 for a finding."""
    try:
        print(f"{what}: {work()}", flush=True)
    except Finding as finding:
        print(f"{what}: {finding}", flush=True)
        return 1
    return 0


def _plan(robot: deltaopt.Robot, moves: int, *, resolved: bool) -> None:
    """Plan moves with several limits, and verify them."""
    for i, scene in enumerate(random_scenes(robot, 1.0, moves, seed=1)):
        found = deltaopt.plan(scene)
        deltaopt.verify(scene, found.trajectory)
        if resolved and i == 0:
            deltaopt.plan(scene, tolerance=1e-6)
            limits = deltaopt.Limits(speed=8.0, acceleration=200.0)
            deltaopt.plan(scene.model_copy(update={"limits": limits}))
        _plan_on_paths(scene, i, affine=resolved)


def _plan_on_paths(scene: deltaopt.Scene, number: int, *, affine: bool) -> None:
    """The same move on a path under limits curved in s̈ and, if wanted, those that are affine."""
    start, goal = np.array(given_points(scene.task))
    way = goal - start
    across = float(np.linalg.norm(way[1:]))
    for limits in (deltaopt.Limits(acceleration=100.0), None)[: 1 + affine]:
        path: deltaopt.Line | deltaopt.PickAndPlace = deltaopt.Line()
        if number % 2:
            path = deltaopt.PickAndPlace(height=0.1 * across, blend=0.05 * across)
        with suppress(deltaopt.DeltaOptError):  # out of the workspace
            deltaopt.plan(scene.model_copy(update={"path": path, "limits": limits}))


def _tests_of_the_method() -> None:
    """Its tests solve problems of all kinds: phases, moving ends, running costs, quintics."""
    import pytest

    tests = Path(__file__).parents[1] / "tests/planning/flat/test_general_problems.py"
    pytest.main([str(tests)])
