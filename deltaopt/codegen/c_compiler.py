"""C compilers: those of the machine, and the one that the extra ``compiler`` installs.

The C of this package uses vectors as GCC and Clang have them. Microsoft's cl has none and is not
looked for; nor, on Windows, are GCC, which aligns the stack for no vector of 32 bytes there, and
Clang with Microsoft's headers, which lack functions of POSIX: there the extra compiles, which
brings headers of its own.
"""

from __future__ import annotations

import importlib.util
import os
import platform
import re
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

from deltaopt.codegen.library_file import put
from deltaopt.errors import how_to_install

FLAGS = (
    "-O3",
    "-fno-tree-slp-vectorize",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-ffp-contract=fast",
    "-fno-inline-functions-called-once",
)
"""Flags of the compiler for any processor. Vectors are written explicitly where they are faster
(``simd_c``), so the compiler's own vectorisation of straight-line code, which was slower, is off.
The next two change no result; they let square roots be inlined. The next rounds a product and a sum
together where the processor can; it is GCC's default. The last, which Clang ignores, keeps GCC from
putting the parts of long functions together again."""


@dataclass(frozen=True)
class Level:
    """Processors for which C is compiled alike, so that by the same compiler and C library a plan
    has the same bits on all of them.

    ``flags``: of the compiler. ``features``: what a processor must have, by GCC's names.
    """

    name: str
    flags: tuple[str, ...] = ()
    features: tuple[str, ...] = ()


BASELINE = Level("baseline")
_X86 = platform.machine().lower() in ("x86_64", "amd64")
LEVELS = (Level("avx2", ("-mavx2", "-mfma"), ("avx2", "fma")), BASELINE) if _X86 else (BASELINE,)
"""Levels of this family of processors, the fastest first. A plan takes as long at the first as if
compiled for the very processor, and twice as long at the last (docs/installation.md)."""

EXTRA = how_to_install("compiler")
"""What installs a compiler where the system has none."""

_NAMES = () if os.name == "nt" else ("gcc", "cc", "clang")
_LONGEST = 300.0
"""s; the largest source takes some 10 s. A compiler that takes longer hangs, and is stopped."""
BUILDING = "building-"
"""How names of folders begin in which a library is built."""
_SOON = 1.0
"""s; a compiler that takes longer is worth a word to who waits for it."""


@dataclass(frozen=True)
class Compiler:
    """A C compiler.

    ``command``: the path of its program. ``arguments``: the program's first ones, before flags and
    files. ``package``: the Python package that brought it; None for the system's own.
    """

    command: str
    arguments: tuple[str, ...] = ()
    package: str | None = None

    @cached_property
    def identity(self) -> str:
        """A text that differs between versions, and between processors.

        Raises subprocess.TimeoutExpired if the compiler hangs.
        """
        return re.sub(r"-dependency-file \S+", "", self._here.stderr)  # a temporary file of Zig's

    @cached_property
    def level(self) -> Level:
        """The fastest level of which this processor is, by what the compiler sees of it.

        Raises subprocess.TimeoutExpired if the compiler hangs.
        """
        macros = self._here.stdout.split()
        return next(v for v in LEVELS if all(f"__{f.upper()}__" in macros for f in v.features))

    @property
    def flags(self) -> tuple[str, ...]:
        """The flags for this processor."""
        return (*FLAGS, *self.level.flags)

    @cached_property
    def _here(self) -> subprocess.CompletedProcess[str]:
        """What it says of itself, and the macros that it defines for this very processor."""
        native = ["-march=native"] if len(LEVELS) > 1 else []
        return self._answer(*native, "-E", "-dM", "-v", "-x", "c", os.devnull)

    @cached_property
    def version(self) -> str:
        """The first line of the compiler's description of itself, for people."""
        said = (self._answer("--version").stdout.splitlines() or ["unknown"])[0]
        return f"{said} of the package {self.package}" if self.package else said

    def _answer(self, *question: str) -> subprocess.CompletedProcess[str]:
        """What the program prints; nothing if it cannot be run."""
        ask = [self.command, *self.arguments, *question]
        try:
            return subprocess.run(ask, capture_output=True, text=True, timeout=_LONGEST)
        except OSError:
            return subprocess.CompletedProcess(ask, 1, "", "")

    def compile(
        self,
        text: str,
        library: Path,
        flags: Sequence[str],
        slow: Callable[[], None] = lambda: None,
    ) -> bool:
        """Compile a C text into a shared library; returns whether that succeeded.

        Under a temporary name, then renamed: where there are no locks, other processes may compile
        the same. ``slow``: is called once if it takes more than about a second. The compiler's own
        temporary files go beside the library. Raises subprocess.TimeoutExpired if it hangs.
        """
        with tempfile.TemporaryDirectory(dir=library.parent, prefix=BUILDING) as folder:
            source, built = Path(folder) / "a.c", Path(folder) / "a.so"
            source.write_text(text)
            done = self._compiled(source, built, flags, slow)
            if done:
                put(built, library)
        return done

    def _compiled(
        self, source: Path, library: Path, flags: Sequence[str], slow: Callable[[], None]
    ) -> bool:
        files = [str(source), "-o", str(library), "-lm"]
        with suppress(OSError):  # a program that cannot be run fails to compile
            process = subprocess.Popen(
                [self.command, *self.arguments, *flags, "-shared", "-fPIC", *files],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "ZIG_LOCAL_CACHE_DIR": str(library.parent)},
                start_new_session=True,
            )
            return _wait(process, slow)
        return False


def _wait(process: subprocess.Popen[bytes], slow: Callable[[], None]) -> bool:
    """Whether a compiler succeeds. Raises subprocess.TimeoutExpired, having stopped it, if it
    hangs."""
    try:
        try:
            process.wait(min(_SOON, _LONGEST))
        except subprocess.TimeoutExpired:
            slow()
            process.wait(max(0.0, _LONGEST - _SOON))
    except BaseException:
        _stop(process)
        raise
    return process.returncode == 0


def _stop(process: subprocess.Popen[bytes]) -> None:
    """End a compiler and the programs that it has started, unless it has ended by itself."""
    if os.name == "posix":
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.wait()


_compiler_at = lru_cache(maxsize=8)(Compiler)


@lru_cache(maxsize=1)
def _extra() -> Compiler | None:
    """The compiler of the package ziglang, which is Clang with headers and libraries."""
    found = importlib.util.find_spec("ziglang")
    if found is None or found.origin is None:
        return None
    program = Path(found.origin).with_name("zig.exe" if os.name == "nt" else "zig")
    # -s: without it every library carries megabytes of text for debuggers.
    return Compiler(str(program), ("cc", "-s"), "ziglang") if program.is_file() else None


def compilers() -> list[Compiler]:
    """The C compilers of this machine, in the order in which they are tried.

    The system's come first: gcc, cc, clang. Each program is named once, whatever its names.
    """
    programs = {os.path.realpath(p): p for n in reversed(_NAMES) if (p := shutil.which(n))}
    found = [_compiler_at(program) for program in reversed(programs.values())]
    extra = _extra()
    return [*found, extra] if extra else found


def compiler() -> Compiler | None:
    """The first C compiler of this machine, if it has one."""
    return next(iter(compilers()), None)
