"""Functions compiled to machine code."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import casadi as ca

from deltaopt.errors import DeltaOptError

FLAGS = ("-O2", "-shared", "-fPIC")


def compiler() -> str | None:
    """The C compiler of this machine, if it has one."""
    return shutil.which("gcc") or shutil.which("cc")


def compiled(functions: Sequence[ca.Function], command: str) -> list[ca.Function]:
    """The same functions in machine code, by the C compiler ``command``.

    Their names must differ.
    """
    with tempfile.TemporaryDirectory(prefix="deltaopt-") as folder:
        generator = ca.CodeGenerator("functions.c")
        for function in functions:
            generator.add(function)
        source, library = Path(generator.generate(f"{folder}/")), Path(folder) / "functions.so"
        result = subprocess.run(
            [command, *FLAGS, str(source), "-o", str(library), "-lm"],
            capture_output=True,
            text=True,
        )
        if result.returncode:
            raise DeltaOptError(f"{command} could not compile: {result.stderr.strip()[:300]}")
        return [ca.external(function.name(), str(library)) for function in functions]
