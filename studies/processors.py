"""The same plans by the code of several processors, compilers and libraries: which bits differ.

Shipped scenes and random moves are planned in processes of their own, each under one setting. A
compiler's flags are set by a program named gcc that adds them, and stands before the compiler; what
NumPy, BLAS and the C library choose for a processor, by their environment variables.
"""

from __future__ import annotations

import argparse
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping

import deltaopt
from deltaopt.cli.arguments import one_or_more
from deltaopt.codegen.c_compiler import compilers
from deltaopt.codegen.compile import cache_directory
from studies.bench.random_scenes import random_scenes
from studies.problems import PROBLEMS, ROBOTS, shipped_scenes

ROOT = PROBLEMS.parent
SMALL: Mapping[str, object] = {"moves": 1, "only": ("OpenBLAS for Haswell",), "shipped": False}

_ENVIRONMENTS = {
    "OpenBLAS for Haswell": {"OPENBLAS_CORETYPE": "Haswell"},
    "OpenBLAS for Zen": {"OPENBLAS_CORETYPE": "Zen"},
    "OpenBLAS for Nehalem": {"OPENBLAS_CORETYPE": "Nehalem"},
    "NumPy without AVX-512": {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"},
    "C library without AVX2": {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F"},
}
_FLAGS = {
    "gcc, this very processor": "-march=native",
    "gcc -march=x86-64-v4": "-march=x86-64-v4",
    "gcc -march=x86-64-v2": "-mno-avx -mno-avx2 -mno-fma -march=x86-64-v2",
    "gcc -ffp-contract=off": "-O1 -ffp-contract=off",  # the bits of -O3, in half of GCC's time
    "gcc -O1": "-O1",
}
_EXTRA = "Clang of the extra"
_SETTINGS = (*_ENVIRONMENTS, *_FLAGS, _EXTRA)


_AGREE = 2e-3
"""Relative difference of durations that both are within a plan's usual tolerance of an optimum."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--moves", type=one_or_more, default=40, metavar="N", help="random moves of each robot"
    )
    parser.add_argument(
        "--shipped", action=argparse.BooleanOptionalAction, default=True, help="shipped scenes too"
    )
    parser.add_argument(
        "--only",
        nargs="+",
        choices=_SETTINGS,
        default=_SETTINGS,
        metavar="SETTING",
        help=f"of: {'; '.join(_SETTINGS)}",
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument(
        "--durations",
        action="store_true",
        help="plan here, as it is, and print the durations alone",
    )
    what.add_argument(
        "--run", dest="command", metavar="COMMAND", help="run this under each setting instead"
    )


def run(arguments: argparse.Namespace) -> int:
    if arguments.durations:
        for name, scene in _scenes(arguments.moves, shipped=arguments.shipped):
            print(f"{name}\t{_duration(scene)}", flush=True)
        return 0
    settings = {name: found for name in arguments.only if (found := _environment(name)) is not None}
    for name in set(arguments.only) - set(settings):
        print(f"not tried, for it is not installed: {name}")
    if arguments.command:
        codes = []
        for setting, environment in settings.items():
            print(f"\n{setting}:", flush=True)
            command = shlex.split(arguments.command)
            codes.append(subprocess.call(command, env={**os.environ, **environment}))
        return max(codes, default=0)
    here, worst = _planned(arguments, {}), 0.0
    print(f"\n{len(here)} plans\n\n| setting | same bits | largest relative difference | of |")
    print("|---|---|---|---|")
    for setting, environment in settings.items():
        there = _planned(arguments, environment)
        same = sum(here[name] == there[name] for name in here)
        which = max(here, key=lambda name: _difference(here[name], there[name]))
        largest = _difference(here[which], there[which])
        print(f"| {setting} | {same} | {largest:.1e} | {which if largest else ''} |", flush=True)
        worst = max(worst, largest)
    return int(worst > _AGREE)


def _scenes(moves: int, *, shipped: bool) -> Iterator[tuple[str, deltaopt.Scene]]:
    for file in shipped_scenes() if shipped else ():
        yield str(file.relative_to(PROBLEMS).with_suffix("")), deltaopt.load_scene(file)
    for file in ROBOTS:
        for k, scene in enumerate(random_scenes(deltaopt.load_robot(file), 1.0, moves, seed=1)):
            yield f"{file.stem} {k}", scene


def _duration(scene: deltaopt.Scene) -> str:
    try:
        return deltaopt.plan(scene).duration.hex()
    except deltaopt.DeltaOptError as error:
        return type(error).__name__


def _planned(arguments: argparse.Namespace, environment: Mapping[str, str]) -> dict[str, str]:
    """The durations in a process of its own, by name."""
    words = ["--durations", "--moves", str(arguments.moves)]
    words.append("--shipped" if arguments.shipped else "--no-shipped")
    command = [sys.executable, "-m", "studies", "processors", *words]
    told = subprocess.check_output(command, env={**os.environ, **environment}, cwd=ROOT, text=True)
    return dict(line.split("\t") for line in told.splitlines())


def _environment(setting: str) -> Mapping[str, str] | None:
    """The variables of a setting; None if what it needs is not installed."""
    if setting in _ENVIRONMENTS:
        return _ENVIRONMENTS[setting]
    if setting == _EXTRA:
        found = next((each for each in compilers() if each.package), None)
        program = [found.command, *found.arguments] if found else None
    else:
        program = [shutil.which("gcc") or ""]
    if program is None or not program[0]:
        return None
    folder = cache_directory() / "processors" / setting.replace(" ", "_")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "gcc").write_text(
        f'#!/bin/sh\nexec {" ".join(program)} "$@" {_FLAGS.get(setting, "")}\n'
    )
    (folder / "gcc").chmod(0o755)
    return {"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}"}


def _difference(here: str, there: str) -> float:
    """Relative, of two durations; infinite if one is none."""
    if here == there:
        return 0.0
    try:
        return abs(float.fromhex(there) / float.fromhex(here) - 1)
    except ValueError:
        return float("inf")
