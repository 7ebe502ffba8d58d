"""The cache of compiled libraries: what is loaded is what was built, whatever happened since."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time

import casadi as ca
import numpy as np
import pytest

from deltaopt.codegen import c_compiler
from deltaopt.codegen import compile as compiling
from deltaopt.codegen.c_compiler import Compiler, compiler
from deltaopt.codegen.compile import CACHE, describe, in_machine_code, library, recording

SOURCE = "int answer(void) { return 42; }\n"
needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setenv(CACHE, str(folder))
    monkeypatch.setattr(compiling, "_SAID", set())
    return folder


def answer(path):
    return ctypes.CDLL(str(path)).answer()


def script(path, commands):
    """A program that does as the shell's commands say."""
    path.write_text(f"#!/bin/sh\n{commands}\n")
    path.chmod(0o755)


@needs_compiler
@pytest.mark.parametrize(
    "damage",
    [
        lambda content: content[: len(content) // 2],
        lambda content: b"",
        lambda content: content[:3000] + b"\0" + content[3001:] + b"\0",
        lambda content: b"not a library",
    ],
)
def test_a_damaged_library_is_built_again(damage):
    kept = library(SOURCE)
    content = kept.read_bytes()
    kept.unlink()  # this process has it loaded, and would read what is not there any more
    kept.write_bytes(damage(content))
    assert answer(library(SOURCE)) == 42


UNLOADABLE = """
import ctypes, hashlib, os, sys
from deltaopt.codegen.compile import library
whole = library(sys.argv[1]).read_bytes()
other_machine = whole[:18] + bytes([whole[18] ^ 0x55]) + whole[19:]
for content in (whole[: len(whole) // 2], whole[:4096], whole[:-1], whole[:60], other_machine):
    kept = library(sys.argv[1])
    kept.unlink()
    kept.write_bytes(content)
    kept.with_suffix(".sha256").write_text(hashlib.sha256(content).hexdigest())
    assert ctypes.CDLL(str(library(sys.argv[1]))).answer() == 42
kept.unlink()
os.mkfifo(kept)
assert ctypes.CDLL(str(library(sys.argv[1]))).answer() == 42
"""


@needs_compiler
@pytest.mark.skipif(sys.platform != "linux", reason="damages files as Linux has them")
def test_what_cannot_be_loaded_is_built_again_though_its_hash_is_right():
    """In a process of its own, which loading what is cut off would end; a pipe would stop it."""
    subprocess.run([sys.executable, "-c", UNLOADABLE, SOURCE], check=True, timeout=60)


@pytest.mark.skipif(not hasattr(os, "ST_NOEXEC"), reason="no such flag")
def test_a_folder_that_may_hold_no_programs_is_said_to_be_one(folder, monkeypatch, caplog):
    class Mounted:
        f_flag = os.ST_NOEXEC

    monkeypatch.setattr(os, "statvfs", lambda path: Mounted)
    monkeypatch.setattr(Compiler, "compile", lambda *_: pytest.fail("was compiled"))
    assert library(SOURCE) is None
    assert f"{folder} may hold no programs (mounted noexec); set {CACHE}" in caplog.text


@needs_compiler
@pytest.mark.parametrize("content", [None, b"", b"\xff\xfe", b"0" * 64])
def test_a_damaged_hash_is_built_again(content, folder):
    library(SOURCE)
    (hashed,) = folder.glob("*.sha256")
    if content is None:
        hashed.unlink()
    else:
        hashed.write_bytes(content)
    assert answer(library(SOURCE)) == 42
    assert len(hashed.read_text()) == 64


@needs_compiler
def test_an_intact_library_is_not_built_again(monkeypatch):
    first = library(SOURCE)
    monkeypatch.setattr(Compiler, "compile", lambda *_: pytest.fail("was compiled again"))
    assert library(SOURCE) == first


@needs_compiler
@pytest.mark.skipif(os.name != "posix", reason="other systems have other rights")
@pytest.mark.parametrize("mode", [0o770, 0o707])
def test_a_folder_that_others_can_write_to_is_refused(mode, folder):
    folder.mkdir()
    folder.chmod(mode)
    assert library(SOURCE) is None
    assert "not yours alone to write to" in describe()
    assert "some 100 times as slow" in describe()


@needs_compiler
def test_a_compiler_that_hangs_is_stopped_and_not_tried_again(tmp_path, monkeypatch):
    tried = tmp_path / "tried"
    script(tmp_path / "gcc", f"echo >> {tried}; /bin/sleep 60")
    monkeypatch.setattr(c_compiler, "_LONGEST", 0.2)
    monkeypatch.setattr(c_compiler, "_extra", lambda: None)
    monkeypatch.setenv("PATH", str(tmp_path))
    began = time.monotonic()
    assert library(SOURCE) is None
    assert library(SOURCE) is None
    assert time.monotonic() - began < 10
    assert tried.read_text() == "\n"


@needs_compiler
@pytest.mark.skipif(os.name != "posix", reason="a signal to a waiting process")
def test_a_request_to_stop_is_not_lost_where_the_compiler_ends_soon_after_it(tmp_path):
    """Python waits a moment for a child to end by itself before it raises KeyboardInterrupt."""
    script(tmp_path / "gcc", "sleep 0.3")
    compile_it = Compiler(str(tmp_path / "gcc")).compile
    main = threading.main_thread().ident
    threading.Timer(0.2, lambda: signal.pthread_kill(main, signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        compile_it("", tmp_path / "a.so", ())


def test_compilers_are_tried_in_order(tmp_path, monkeypatch):
    """gcc, cc, clang, then the extra's: the first that compiles is taken, each program once."""
    real = compiler()
    for name in ("clang", "cc", "gcc"):
        script(tmp_path / name, "exit 1")
    extra = Compiler(real.command, package="ziglang")
    monkeypatch.setattr(c_compiler, "_extra", lambda: extra)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    found = c_compiler.compilers()
    assert [each.command for each in found] == [
        *(str(tmp_path / name) for name in ("gcc", "cc", "clang")),
        real.command,
    ]
    assert answer(library(SOURCE)) == 42
    assert describe().startswith(f"compiled by {real.version} of the package ziglang")
    (tmp_path / "clang").unlink()
    (tmp_path / "cc").unlink()
    (tmp_path / "cc").symlink_to(tmp_path / "gcc")
    assert len(c_compiler.compilers()) == 2


def test_the_extras_compiler_is_found_in_its_package(tmp_path, monkeypatch):
    (tmp_path / "ziglang").mkdir()
    (tmp_path / "ziglang" / "__init__.py").touch()
    script(tmp_path / "ziglang" / "zig", "exit 1")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PATH", "")
    c_compiler._extra.cache_clear()
    try:
        found = compiler()
    finally:
        c_compiler._extra.cache_clear()
    assert found == Compiler(str(tmp_path / "ziglang" / "zig"), ("cc", "-s"), "ziglang")


def test_the_interpreter_is_said_once(caplog, monkeypatch):
    monkeypatch.setattr(compiling, "compilers", list)
    for number in range(3):
        assert library(f"{SOURCE}/* {number} */") is None
    (said,) = caplog.messages
    assert said == (
        "CasADi interprets, some 100 times as slow: no C compiler found; "
        "install gcc, or pip install -e '.[compiler]' in the clone, "
        "or pip install 'deltaopt[compiler]' with a wheel"
    )


@needs_compiler
def test_a_damaged_library_that_cannot_be_compiled_again_is_not_loaded(caplog, monkeypatch):
    kept = library(SOURCE)
    kept.unlink()  # this process has it loaded, as above
    kept.write_bytes(b"not a library")
    monkeypatch.setattr(Compiler, "compile", lambda *_, **__: False)
    assert library(SOURCE) is None
    damaged, interpreted = caplog.messages
    assert damaged == f"{kept} is damaged and is compiled again"
    assert interpreted.startswith("CasADi interprets")


@needs_compiler
def test_processes_that_are_killed_leave_nothing_half_written(folder):
    """Killed at instants spread over a build; a library that bears its name is whole after each."""
    code = "from deltaopt.codegen.compile import library; import sys; library(sys.argv[1])"
    source = SOURCE + "".join(f"double f{k}(double x) {{ return x * {k}; }}\n" for k in range(300))
    for kill in range(3):
        own = source + f"int number(void) {{ return {kill}; }}\n"
        process = subprocess.Popen([sys.executable, "-c", code, own])
        time.sleep(0.3 + 0.3 * kill)
        process.kill()
        process.wait()
        assert answer(library(own)) == 42


@needs_compiler
def test_compiling_is_said_once_if_it_takes_long(caplog, monkeypatch):
    caplog.set_level("INFO", "deltaopt")
    monkeypatch.setattr(c_compiler, "_SOON", 0.0)
    library(SOURCE)
    library(f"{SOURCE}/* other */")
    (said,) = caplog.messages
    assert said.startswith("compiling for this machine, once")


@needs_compiler
def test_abandoned_build_folders_are_removed_and_others_kept(folder):
    library(SOURCE)
    old, new = folder / "building-old", folder / "building-new"
    for each in (old, new):
        each.mkdir()
    an_hour_ago = time.time() - 3700
    os.utime(old, (an_hour_ago, an_hour_ago))
    library(SOURCE + "int other(void) { return 1; }\n")
    assert not old.exists()
    assert new.exists()


@needs_compiler
@pytest.mark.skipif(os.name != "posix", reason="other systems have no such locks")
def test_processes_that_need_the_same_library_at_once_compile_it_once(tmp_path, monkeypatch):
    built = tmp_path / "built"
    slow = f'case "$*" in *-o*) echo >> {built}; sleep 1;; esac; exec {compiler().command} "$@"'
    script(tmp_path / "gcc", slow)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    code = "from deltaopt.codegen.compile import library; import sys; assert library(sys.argv[1])"
    several = [subprocess.Popen([sys.executable, "-c", code, SOURCE]) for _ in range(3)]
    assert [each.wait(60) for each in several] == [0, 0, 0]
    assert built.read_text() == "\n"


@needs_compiler
def test_a_long_function_of_casadi_is_compiled_in_parts():
    """Some 9000 operations, whose values are used long after they are known."""
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
    first, value, results = 2 + ca.sin(x[0]), x[1], []
    for k in range(900):
        value = ca.sin(value * p[k % 2] / 9 + x[2] / first) + (value - first) ** 2 / (3 + first)
        results += [value / first] if k % 100 == 0 else []
    much = ca.Function("much", [x, p], [ca.vertcat(*results), value])
    little = ca.Function("little", [x], [ca.sin(x)])
    with recording() as asked:
        in_machine_code([much, little])
    (source,) = asked
    assert much.n_instructions() > 5000
    assert max(text.count("\n") for text in source.split("\n}\n")) < 600
    found = in_machine_code([much, little])
    points = np.random.default_rng(1).uniform(0.1, 1.0, (5, 3))
    for expected, machine in zip((much, little), found, strict=True):
        assert machine.is_a("External")
        given = [points.T, [0.7, 1.1]][: expected.n_in()]
        for known, result in zip(expected.call(given), machine.call(given), strict=True):
            np.testing.assert_allclose(result.full(), known.full(), rtol=1e-12)
