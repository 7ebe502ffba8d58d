"""Libraries that a wheel carries, compiled when it was built.

There is a folder for each `Level` of processors, with the libraries named by a hash of their C
source. A source that differs in a single character, because a scene has other terms or CasADi has
another version, has another name and is not found.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

from deltaopt.codegen.c_compiler import BASELINE, FLAGS, LEVELS, Compiler, Level
from deltaopt.codegen.library_file import intact
from deltaopt.errors import DeltaOptError

FOLDER = Path(__file__).with_name("prebuilt")
"""Where a wheel has its libraries; an installation from a clone has none."""


_PROBE = "runs_here"
"""Name of the library, and of its function, that says whether this processor has a level."""

_OLD_LIBC = Path(__file__).with_name("old_libc.c")
"""Asks for the names of functions that every glibc has: those of 2.29 return the same numbers."""


def carried(source: str) -> Path | None:
    """The library of a C source that was built with the wheel; None if there is none."""
    level = level_here()
    if level is None:
        return None
    library = _library(FOLDER, level, source)
    return library if intact(library) else None


@cache
def level_here() -> Level | None:
    """The fastest level in the wheel whose libraries this processor can run."""
    return next((level for level in LEVELS if _runs(FOLDER / level.name / f"{_PROBE}.so")), None)


def _runs(probe: Path) -> bool:
    return intact(probe) and bool(ctypes.CDLL(str(probe)).runs_here())


def _library(folder: Path, level: Level, source: str) -> Path:
    name = hashlib.sha256(source.encode()).hexdigest()[:32]
    return folder / level.name / f"{name}.so"


def prebuild(sources: Collection[str], folder: Path, compiler: Compiler) -> None:
    """Compile C sources for all levels into a folder, on all cores.

    Raises DeltaOptError if the compiler fails.
    """
    old_libc = _OLD_LIBC.read_text()
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        todo = [
            pool.submit(_compile, old_libc + s, _library(folder, v, s), v, compiler)
            for v in LEVELS
            for s in sources
        ]
        for each in todo:
            each.result()
    for level in LEVELS:
        _compile(_probe_source(level), folder / level.name / f"{_PROBE}.so", BASELINE, compiler)


def _compile(text: str, library: Path, level: Level, compiler: Compiler) -> None:
    library.parent.mkdir(parents=True, exist_ok=True)
    if not compiler.compile(text, library, (*FLAGS, *level.flags)):
        raise DeltaOptError(f"{compiler.command} does not compile {library.name}")


def _probe_source(level: Level) -> str:
    tests = " && ".join(["1", *(f'__builtin_cpu_supports("{name}")' for name in level.features)])
    begin = "__builtin_cpu_init(); " if level.features else ""
    return f"int {_PROBE}(void) {{ {begin}return {tests}; }}\n"
