"""Machine code: C source compiled once on a machine and kept in a cache folder.

A compiled library is named by a hash of the C source, the compiler and its flags, so that it is
never out of date. Beside it stands a hash of its own content, and it is built again if that does
not fit: a damaged library ends the process that loads it. Where there is no compiler, the compiler
fails or hangs, or the folder cannot be written or could be written by others, there is no machine
code, and CasADi's interpreter does the same work.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
import subprocess
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
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

_LONGEST = 300.0
"""s; the largest source takes some 10 s. A compiler that takes longer hangs, and is stopped."""
_BUILDING = "building-"
_ABANDONED = 3600.0
"""s; a build folder that is older was left by a process that was killed."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler; ``command``: the path of its program."""

    command: str

    @cached_property
    def identity(self) -> str:
        """A text that differs between versions, and between what ``FLAGS`` mean on processors."""
        ask = [self.command, *FLAGS, "-E", "-v", "-x", "c", os.devnull]
        answer = subprocess.run(ask, capture_output=True, text=True, timeout=_LONGEST)
        return answer.stderr

    @cached_property
    def version(self) -> str:
        """The first line of the compiler's description of itself, for people."""
        answer = subprocess.run([self.command, "--version"], capture_output=True, text=True)
        return (answer.stdout.splitlines() or ["unknown"])[0]

    def compile(self, source: Path, library: Path) -> bool:
        """Compile a C file into a shared library; returns whether that succeeded.

        Raises subprocess.TimeoutExpired if the compiler hangs.
        """
        command = [self.command, *FLAGS, "-shared", "-fPIC", str(source), "-o", str(library), "-lm"]
        return subprocess.run(command, capture_output=True, timeout=_LONGEST).returncode == 0


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

    None if there is no compiler, it fails, or the folder cannot be written or is not safe.
    """
    found = compiler()
    if found is None:
        return None
    try:
        content = "\0".join([source, found.command, found.identity, *FLAGS])
        name = hashlib.sha256(content.encode()).hexdigest()[:32]
        kept = cache_directory() / f"{name}.so"
        if not _safe(kept.parent):
            return None
        if _intact(kept) or (_build(found, source, kept) and _intact(kept)):
            return kept
    except (OSError, subprocess.TimeoutExpired):  # no folder to write to, or no compiler that ends
        pass
    return None


def _safe(folder: Path) -> bool:
    """Whether a folder, made if need be, is the user's own and nobody else can write to it."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if os.name != "posix":
        return True
    found = folder.stat()
    return found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _hash_file(library: Path) -> Path:
    return library.with_suffix(".sha256")


def _intact(library: Path) -> bool:
    """Whether a library is there and has the content that was built."""
    try:
        return _hash_file(library).read_text() == hashlib.sha256(library.read_bytes()).hexdigest()
    except (OSError, UnicodeDecodeError):
        return False


def _build(found: Compiler, source: str, library: Path) -> bool:
    """Compile under a temporary name, then rename, since other processes may compile the same."""
    _remove_abandoned(library.parent)
    with tempfile.TemporaryDirectory(dir=library.parent, prefix=_BUILDING) as folder:
        text, built, digest = (Path(folder) / name for name in ("a.c", "a.so", "a.sha256"))
        text.write_text(source)
        if not found.compile(text, built):
            return False
        digest.write_text(hashlib.sha256(built.read_bytes()).hexdigest())
        for file, name in ((built, library), (digest, _hash_file(library))):
            _to_disk(file)
            file.replace(name)
    return True


def _to_disk(file: Path) -> None:
    """Wait until a file's content is on the disk: a name must never outlast what it names."""
    with file.open("rb+") as opened:
        os.fsync(opened.fileno())


def _remove_abandoned(folder: Path) -> None:
    for left in folder.glob(f"{_BUILDING}*"):
        with suppress(OSError):
            if time.time() - left.stat().st_mtime > _ABANDONED:
                shutil.rmtree(left, ignore_errors=True)


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
    found, folder = compiler(), cache_directory()
    if found is None:
        return "no: no C compiler found, CasADi interprets, 100 to 200 times as slow; install gcc"
    if library("int deltaopt_works(void) { return 1; }\n") is None:
        why = f"{found.command} does not compile into {folder}"
        with suppress(OSError):
            if not _safe(folder):
                why = f"{folder} is not yours alone to write to (set {CACHE} to a folder that is)"
        return f"no: {why}, CasADi interprets, 100 to 200 times as slow"
    return f"yes: {found.version}, kept in {folder}"
