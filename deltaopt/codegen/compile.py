"""Machine code: the compiled library of a C source, from the wheel, the cache, or a compiler.

A library that came with the wheel is used if it was made of the same source. Otherwise one is
compiled, once on a machine, and kept in a cache folder, named by a hash of the source, the compiler
and its flags, so that it is never out of date. A damaged one is compiled again. Where there is no
compiler, all fail or hang, or the folder cannot be written or could be written by others, there is
no machine code, and CasADi's interpreter does the same work, which is said once.
"""

from __future__ import annotations

import hashlib
import logging
import os
import shutil
import stat
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

import casadi as ca
import platformdirs

from deltaopt.codegen.c_compiler import BUILDING, EXTRA, Compiler, compilers
from deltaopt.codegen.library_file import intact
from deltaopt.codegen.long_functions import in_parts
from deltaopt.codegen.prebuilt import carried, level_here
from deltaopt.files.output_folder import locked

CACHE = "DELTAOPT_CACHE"
"""Name of the environment variable that gives another folder for the compiled libraries."""

SLOWER = "some 100 times as slow"
"""What the interpreter costs in a plan (docs/speed.md)."""

_ABANDONED = 3600.0
"""s; a build folder that is older was left by a process that was killed."""

_LOG = logging.getLogger("deltaopt")
_SAID: set[str] = set()
"""What is said once in a process, and has been."""
_HANGING: set[Compiler] = set()
"""Compilers that were stopped in this process, and are not tried again."""
_ASKED: ContextVar[dict[str, None] | None] = ContextVar("asked", default=None)


class _NoLibrary(Exception):
    """There is no machine code; the text says why, and what to do about it."""


def cache_directory() -> Path:
    """The folder where compiled libraries are kept."""
    return Path(os.environ.get(CACHE) or platformdirs.user_cache_dir("deltaopt"))


def library(source: str) -> Path | None:
    """The shared library of a C source, compiled now if it neither came with the wheel nor is in
    the cache folder yet.

    None if no compiler compiles it, or the folder cannot be written or is not safe.
    """
    asked = _ASKED.get()
    if asked is not None:
        asked[source] = None
        return None
    try:
        return carried(source) or _kept(source)
    except _NoLibrary as why:
        _say_once("interpreted", logging.WARNING, f"CasADi interprets, {SLOWER}: {why}")
        return None


@contextmanager
def recording() -> Iterator[dict[str, None]]:
    """Collect the C sources of which libraries are asked for meanwhile in this thread, in order,
    as the keys of a dictionary.

    Nothing is compiled: CasADi interprets.
    """
    asked: dict[str, None] = {}
    token = _ASKED.set(asked)
    try:
        yield asked
    finally:
        _ASKED.reset(token)


def _say_once(what: str, level: int, text: str) -> None:
    if what not in _SAID:
        _SAID.add(what)
        _LOG.log(level, text)


def _kept(source: str) -> Path:
    """The library of a C source in the cache, compiled if need be by the first compiler that can.

    Raises _NoLibrary.
    """
    folder, found = cache_directory(), compilers()
    if not found:
        raise _NoLibrary(f"no C compiler found; install gcc, or {EXTRA}")
    try:
        if not _safe(folder):
            raise _NoLibrary(
                f"{folder} is not yours alone to write to; set {CACHE} to a folder that is"
            )
        if not _may_hold_programs(folder):
            raise _NoLibrary(
                f"{folder} may hold no programs (mounted noexec); set {CACHE} to another folder"
            )
        for each in found:
            kept = _try(each, source, folder)
            if kept:
                return kept
    except OSError as error:
        raise _NoLibrary(f"{folder}: {error.strerror}; set {CACHE} to another folder") from None
    tried = " and ".join(each.command for each in found)
    raise _NoLibrary(f"{tried} failed to compile into {folder}; install gcc, or {EXTRA}")


def _try(found: Compiler, source: str, folder: Path) -> Path | None:
    """The library of a C source by one compiler, from the cache or compiled now; None if it fails
    or hangs."""
    if found in _HANGING:
        return None
    try:
        content = "\0".join([source, found.command, *found.arguments, found.identity, *found.flags])
        kept = folder / f"{hashlib.sha256(content.encode()).hexdigest()[:32]}.so"
        if intact(kept):
            return kept
        if kept.exists():
            _LOG.warning("%s is damaged and is compiled again", kept)
        lock = kept.with_suffix(".lock")
        lock.touch()
        with locked(lock):  # another process may be compiling it: once on a machine is enough
            if not intact(kept):
                _remove_abandoned(folder)
                found.compile(source, kept, found.flags, slow=_say_compiling)
            lock.unlink(missing_ok=True)
            return kept if intact(kept) else None
    except subprocess.TimeoutExpired:
        _LOG.warning("%s does not end and is not run again", found.command)
        _HANGING.add(found)
        return None


def _safe(folder: Path) -> bool:
    """Whether a folder, made if need be, is the user's own and nobody else can write to it."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if os.name != "posix":
        return True
    found = folder.stat()
    return found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _may_hold_programs(folder: Path) -> bool:
    """Whether the file system of a folder lets its files be run, as far as the system says."""
    return os.name != "posix" or not os.statvfs(folder).f_flag & getattr(os, "ST_NOEXEC", 0)


def _say_compiling() -> None:
    text = f"compiling for this machine, once (kept in {cache_directory()}) ..."
    _say_once("compiling", logging.INFO, text)


def _remove_abandoned(folder: Path) -> None:
    for left in folder.glob(f"{BUILDING}*"):
        with suppress(OSError):
            if time.time() - left.stat().st_mtime > _ABANDONED:
                shutil.rmtree(left, ignore_errors=True)


def in_machine_code(functions: Sequence[ca.Function]) -> list[ca.Function] | None:
    """CasADi functions as machine code; None if that cannot be made.

    Their names must differ.
    """
    generator = ca.CodeGenerator("functions.c")
    for function in functions:
        generator.add(function)
    built = library(in_parts(generator.dump()))
    if built is None:
        return None
    return [ca.external(function.name(), str(built)) for function in functions]


_TRIAL = "int deltaopt_works(void) { return 1; }\n"


def describe(source: Callable[[], str] = lambda: _TRIAL) -> str:
    """A phrase that says how the library of a C source is had on this machine, without compiling
    it, and how what a scene adds is. ``source``: is asked for where a wheel brought libraries."""
    here = level_here()
    level = here if here and carried(source()) else None
    came = f"from the wheel ({level.name})" if level else ""
    try:
        folder = _kept(_TRIAL).parent
    except _NoLibrary as why:
        if came:
            return f"{came}; what else a scene needs is interpreted, {SLOWER}: {why}"
        return f"none: CasADi interprets, {SLOWER}: {why}"
    by = next(each.version for each in compilers() if _try(each, _TRIAL, folder))
    compiles = f"compiled by {by}, kept in {folder}"
    return f"{came}; what else a scene needs is {compiles}" if came else compiles
