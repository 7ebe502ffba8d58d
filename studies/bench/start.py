"""Processor time from ``import`` to a verified plan, in processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from deltaopt.codegen.compile import CACHE

_SCRIPT = """
import os, sys, time
def spent():
    return sum(os.times()[:4])
begin = spent()
import deltaopt
scene = deltaopt.load_scene(sys.argv[1])
planning = spent()
plan = deltaopt.plan(scene)
planned = spent()
assert plan.within_tolerance and deltaopt.verify(scene, plan.trajectory).ok
done = spent()
later = []
for _ in range(int(sys.argv[2])):
    again = time.process_time()
    deltaopt.plan(scene)
    later.append(time.process_time() - again)
print(done - begin, planned - planning, sorted(later)[len(later) // 2])
"""
_LATER = 15
"""Number of later plans; more make their median steadier, but take seconds without machine code."""


@dataclass(frozen=True)
class Start:
    """What a process took of the processor, in s: ``verified`` from ``import`` to a verified plan,
    ``first`` the first plan in it, ``later`` the median of later ones of the same scene.

    Compilers that it called are counted. While nothing else runs, it takes as long by the clock.
    """

    verified: float
    first: float
    later: float


def first_plan(scene: Path) -> Start:
    """Measure with nothing compiled yet but what came with the wheel."""
    with tempfile.TemporaryDirectory() as folder:
        return _measured(scene, {CACHE: folder, "ZIG_GLOBAL_CACHE_DIR": f"{folder}/zig"})


def warm_plan(scene: Path) -> Start:
    """Measure with everything compiled, by a process before if need be."""
    _measured(scene, {})
    return _measured(scene, {})


def plan_without_compiler(scene: Path) -> Start:
    """Measure with none of the system's compilers to be found."""
    return _measured(scene, {"PATH": ""})


CASES: dict[str, Callable[[Path], Start]] = {
    "nothing compiled yet": first_plan,
    "cache warm": warm_plan,
    "no compiler on PATH": plan_without_compiler,
}


def _measured(scene: Path, environment: dict[str, str]) -> Start:
    command = [sys.executable, "-c", _SCRIPT, str(scene), str(_LATER)]
    path = os.pathsep.join(filter(None, [os.getcwd(), os.environ.get("PYTHONPATH")]))
    result = subprocess.run(
        command,
        env={**os.environ, "PYTHONPATH": path, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return Start(*map(float, result.stdout.split()))
