"""Functions as machine code: C, compiled once on a machine and kept.

What is kept is named by a hash of the C source, of the compiler and of its flags, so nothing
kept is ever out of date. Where there is no compiler, the compiler fails, or nothing can be
kept, there is no machine code and CasADi's interpreter does the same work.
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
"""Vectors are written out where they pay (``lanes``): what the compiler joins beyond these is
slower. The last two change no result, only let √ be inlined."""

CACHE = "DELTAOPT_CACHE"
"""Environment variable naming another folder for the compiled libraries."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler: the path of its command."""

    command: str

    @cached_property
    def identity(self) -> str:
        """Its version, and what it makes of ``FLAGS`` on this processor."""
        ask = [self.command, *FLAGS, "-E", "-v", "-x", "c", os.devnull]
        answer = subprocess.run(ask, capture_output=True, text=True)
        return answer.stderr

    @cached_property
    def version(self) -> str:
        """One line for people."""
        answer = subprocess.run([self.command, "--version"], capture_output=True, text=True)
        return (answer.stdout.splitlines() or ["unknown"])[0]

    def compile(self, source: Path, library: Path) -> bool:
        """Make a shared library of a C file; whether that went well."""
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
    """Where compiled libraries are kept."""
    return Path(os.environ.get(CACHE) or platformdirs.user_cache_dir("deltaopt"))


def library(source: str) -> Path | None:
    """The shared library of a C source, compiled now if it is not kept yet."""
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
    """Compile under a name of our own, then rename: another process may do the same."""
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
    """The same CasADi functions in machine code; as they are where there is none.

    Their names must differ.
    """
    return in_machine_code(functions) or list(functions)


def in_machine_code(functions: Sequence[ca.Function]) -> list[ca.Function] | None:
    """The same CasADi functions in machine code, if there is any. Their names must differ."""
    generator = ca.CodeGenerator("functions.c")
    for function in functions:
        generator.add(function)
    built = library(generator.dump())
    if built is None:
        return None
    return [ca.external(function.name(), str(built)) for function in functions]


def describe() -> str:
    """Whether functions run as machine code here, for people."""
    found = compiler()
    if found is None:
        return "no: no C compiler found, CasADi interprets"
    if library("int deltaopt_works(void) { return 1; }\n") is None:
        return f"no: {found.command} does not compile into {cache_directory()}, CasADi interprets"
    return f"yes: {found.version}, kept in {cache_directory()}"
