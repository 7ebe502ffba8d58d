"""Machine code: C source compiled once on a machine and kept in a cache folder.

A compiled library is named by a hash of the C source, the compiler and its flags, so that it is
never out of date. Where there is no compiler, the compiler fails, or the folder cannot be written,
there is no machine code, and CasADi's interpreter does the same work.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import casadi as ca
import platformdirs

FLAGS = ("-O3", "-fno-tree-slp-vectorize", "-march=native", "-fno-math-errno", "-fno-trapping-math")
"""Flags of the compiler. Vectors are written explicitly where they are faster (``simd_c``), so the
compiler's own vectorisation of straight-line code, which was slower, is off. The last two flags
change no result; they let square roots be inlined."""

CACHE = "DELTAOPT_CACHE"
"""Name of the environment variable that gives another folder for the compiled libraries."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler; ``command``: the path of its program."""

    command: str

    @cached_property
    def identity(self) -> str:
        """A text that differs between versions, and between what ``FLAGS`` mean on processors."""
        ask = [self.command, *FLAGS, "-E", "-v", "-x", "c", os.devnull]
        answer = subprocess.run(ask, capture_output=True, text=True)
        return answer.stderr

    @cached_property
    def version(self) -> str:
        """The first line of the compiler's description of itself, for people."""
        answer = subprocess.run([self.command, "--version"], capture_output=True, text=True)
        return (answer.stdout.splitlines() or ["unknown"])[0]

    def compile(self, source: Path, library: Path) -> bool:
        """Compile a C file into a shared library; returns whether that succeeded."""
        command = [self.command, *FLAGS, "-shared", "-fPIC", str(source), "-o", str(library), "-lm"]
        return subprocess.run(command, capture_output=True).returncode == 0


@lru_cache(maxsize=8)
def _compiler_at(command: str) -> Compiler:
    return Compiler(command)


def compiler() -> Compiler | None:
    """The C compiler of this machine, if it has one."""
    command = shutil.which("gcc") or shutil.which("cc")
    return _compiler_at(command) if command else None


def cache_directory() -> Path:
    """The folder where compiled libraries are kept."""
    return Path(os.environ.get(CACHE) or platformdirs.user_cache_dir("deltaopt"))


def library(source: str) -> Path | None:
    """The shared library of a C source, compiled now if it is not in the cache folder yet.

    None if there is no compiler, it fails, or the folder cannot be written.
    """
    found = compiler()
    if found is None:
        return None
    content = "\0".join([source, found.command, found.identity, *FLAGS])
    name = hashlib.sha256(content.encode()).hexdigest()[:32]
    kept = cache_directory() / f"{name}.so"
    if kept.exists() or _build(found, source, kept):
        return kept
    return None


def _build(found: Compiler, source: str, library: Path) -> bool:
    """Compile under a temporary name, then rename, since other processes may compile the same."""
    try:
        library.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=library.parent, prefix="building-") as folder:
            text, built = Path(folder) / "source.c", Path(folder) / "built.so"
            text.write_text(source)
            if not found.compile(text, built):
                return False
            built.replace(library)
    except OSError:  # the folder cannot be written to, or the compiler not be run
        return False
    return True


def compiled(functions: Sequence[ca.Function]) -> list[ca.Function]:
    """The same CasADi functions as machine code, or unchanged if that cannot be made.

    Their names must differ.
    """
    return in_machine_code(functions) or list(functions)


def in_machine_code(functions: Sequence[ca.Function]) -> list[ca.Function] | None:
    """The same CasADi functions as machine code; None if that cannot be made.

    Their names must differ.
    """
    generator = ca.CodeGenerator("functions.c")
    for function in functions:
        generator.add(function)
    built = library(generator.dump())
    if built is None:
        return None
    return [ca.external(function.name(), str(built)) for function in functions]


def describe() -> str:
    """A phrase that says whether functions run as machine code on this machine, and where it is."""
    found = compiler()
    if found is None:
        return "no: no C compiler found, CasADi interprets"
    if library("int deltaopt_works(void) { return 1; }\n") is None:
        return f"no: {found.command} does not compile into {cache_directory()}, CasADi interprets"
    return f"yes: {found.version}, kept in {cache_directory()}"
