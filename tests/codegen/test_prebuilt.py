"""Libraries of a wheel: used if made of the same source and for this processor, else not."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from deltaopt.codegen import compile as compiling
from deltaopt.codegen import prebuilt
from deltaopt.codegen.c_compiler import BASELINE, LEVELS, Compiler, Level, compiler
from deltaopt.codegen.compile import CACHE, describe, library, recording
from deltaopt.codegen.prebuilt import carried, level_here, prebuild
from deltaopt.codegen.vectorised import RowFunction
from deltaopt.errors import DeltaOptError

SOURCE = "#include <math.h>\ndouble answer(double x) { return log(x); }\n"
OTHER = SOURCE + "\n"
ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where a wheel would have its libraries; there are none yet."""
    monkeypatch.setattr(prebuilt, "FOLDER", tmp_path / "prebuilt")
    level_here.cache_clear()
    yield tmp_path / "prebuilt"
    level_here.cache_clear()


@pytest.fixture
def wheel(folder, tmp_path, monkeypatch):
    """The folder of a wheel that carries one library, and no compiler and no cache beside it."""
    prebuild([SOURCE], folder, compiler())
    monkeypatch.setattr(compiling, "compilers", list)
    monkeypatch.setattr(compiling, "_SAID", set())
    monkeypatch.setenv(CACHE, str(tmp_path / "cache"))
    return folder


def answer(path: Path, x: float) -> float:
    function = ctypes.CDLL(str(path)).answer
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double]
    return float(function(x))


def test_the_wheels_library_is_used_without_a_compiler(wheel):
    assert answer(library(SOURCE), 2.0) == np.log(2.0)
    assert library(SOURCE).is_relative_to(wheel)
    assert describe(lambda: SOURCE).startswith(f"from the wheel ({level_here().name}); what else")


def test_another_source_is_not_found(wheel, caplog):
    assert carried(OTHER) is None
    assert library(OTHER) is None
    assert len(caplog.messages) == 1
    assert describe(lambda: OTHER).startswith("none: CasADi interprets")


def test_without_a_wheel_no_source_is_asked_for(folder):
    """To derive it takes as long as a plan."""
    assert describe(lambda: pytest.fail("asked for")).startswith("compiled by ")


@pytest.mark.parametrize("content", [b"", b"not a library"])
def test_a_damaged_library_of_the_wheel_is_not_loaded(wheel, content):
    kept = carried(SOURCE)
    kept.unlink()  # this process has it loaded, and would read what is not there any more
    kept.write_bytes(content)
    assert carried(SOURCE) is None


def test_the_fastest_level_that_runs_here_is_taken(folder, monkeypatch):
    none_has = Level("newest", (), ("avx5124fmaps",) if len(LEVELS) > 1 else ())
    monkeypatch.setattr(prebuilt, "LEVELS", (none_has, BASELINE))
    prebuild([SOURCE], folder, compiler())
    if len(LEVELS) > 1:
        assert level_here() == BASELINE
    for probe in folder.glob("*/runs_here.*"):
        probe.unlink()
    level_here.cache_clear()
    assert level_here() is None


def test_numbers_are_those_of_code_compiled_here(folder, monkeypatch):
    """At every level; a product and a sum may be rounded together or one after the other."""
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p")
    r = ca.vertcat(ca.dot(x, x) * p, ca.sin(x[0]) / x[1], ca.sqrt(ca.sumsqr(x)))
    function = ca.Function("f", [x, p], [r])
    points, numbers = np.random.default_rng(1).normal(size=(9, 3)), np.array([0.3])
    (expected,) = RowFunction(function)(points, parameters=numbers)
    with recording() as asked:
        RowFunction(function)(points, parameters=numbers)
    prebuild(asked, folder, compiler())
    monkeypatch.setattr(compiling, "compilers", list)
    level_here.cache_clear()
    for level in LEVELS[LEVELS.index(level_here()) :]:
        monkeypatch.setattr(prebuilt, "LEVELS", (level,))
        level_here.cache_clear()
        carries = RowFunction(function)
        (found,) = carries(points, parameters=numbers)
        assert carries._code is not None
        np.testing.assert_allclose(found, expected, rtol=8 * np.finfo(float).eps)


def test_a_compiler_that_fails_is_an_error(tmp_path):
    with pytest.raises(DeltaOptError, match="does not compile"):
        prebuild(["not C"], tmp_path, compiler())
    with pytest.raises(DeltaOptError, match="does not compile"):
        prebuild([SOURCE], tmp_path, Compiler(str(tmp_path / "none")))


def test_a_wheel_carries_the_method_that_plans_a_shipped_scene():
    """In a process of its own: what is compiled stays so in this one, and is not asked for."""
    script = (
        "from default_model import sources; import deltaopt\n"
        "from deltaopt.cli.check import default_method\n"
        f"scene = deltaopt.load_scene({str(ROOT / 'problems' / 'pick_and_place.yaml')!r})\n"
        "asked = sources(scene)\n"
        "print(default_method(scene) in asked, sum(' rows(' in text for text in asked))\n"
    )
    path = os.pathsep.join([str(ROOT), str(ROOT / ".ci")])
    environment = {**os.environ, "PYTHONPATH": path}
    command = [sys.executable, "-c", script]
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    has_method, functions_of_many_points = ran.stdout.split()
    assert has_method == "True"
    assert int(functions_of_many_points) >= 4


def test_recording_ends():
    with recording():
        assert library(SOURCE) is None
    assert library(SOURCE) is not None
