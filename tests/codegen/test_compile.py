"""The cache of compiled libraries: what is loaded is what was built, whatever happened since."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import time

import pytest

from deltaopt.codegen import compile as compiling
from deltaopt.codegen.compile import CACHE, Compiler, compiler, describe, library

SOURCE = "int answer(void) { return 42; }\n"
needs_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    folder = tmp_path / "cache"
    monkeypatch.setenv(CACHE, str(folder))
    return folder


def answer(path):
    return ctypes.CDLL(str(path)).answer()


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
    kept.write_bytes(damage(kept.read_bytes()))
    assert answer(library(SOURCE)) == 42


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
def test_a_new_folder_is_the_users_alone(folder):
    library(SOURCE)
    assert folder.stat().st_mode & 0o777 == 0o700


@needs_compiler
@pytest.mark.skipif(os.name != "posix", reason="other systems have other rights")
@pytest.mark.parametrize("mode", [0o770, 0o707])
def test_a_folder_that_others_can_write_to_is_refused(mode, folder):
    folder.mkdir()
    folder.chmod(mode)
    assert library(SOURCE) is None
    assert "not yours alone to write to" in describe()
    assert "100 to 200 times as slow" in describe()


@needs_compiler
def test_a_compiler_that_hangs_is_stopped(tmp_path, monkeypatch):
    slow = tmp_path / "gcc"
    slow.write_text("#!/bin/sh\nexec sleep 60\n")
    slow.chmod(0o755)
    monkeypatch.setattr(compiling, "_LONGEST", 0.2)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    began = time.monotonic()
    assert library(SOURCE) is None
    assert time.monotonic() - began < 10


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
def test_processes_that_are_killed_leave_nothing_half_written(folder):
    """Killed at instants spread over a build; a library that bears its name is whole after each."""
    code = "from deltaopt.codegen.compile import library; import sys; library(sys.argv[1])"
    source = SOURCE + "".join(f"double f{k}(double x) {{ return x * {k}; }}\n" for k in range(300))
    for kill in range(12):
        own = source + f"int number(void) {{ return {kill}; }}\n"
        process = subprocess.Popen([sys.executable, "-c", code, own])
        time.sleep(0.3 + 0.06 * kill)
        process.kill()
        process.wait()
        assert answer(library(own)) == 42
