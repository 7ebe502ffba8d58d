"""Seconds from ``import`` to a verified plan, in processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from deltaopt.codegen.compile import CACHE

_SCRIPT = """
from time import perf_counter
begin = perf_counter()
import sys
import deltaopt
scene = deltaopt.load_scene(sys.argv[1])
plan = deltaopt.plan(scene)
assert plan.within_tolerance and deltaopt.verify(scene, plan.trajectory).ok
print(perf_counter() - begin)
"""


def first_plan(scene: Path) -> float:
    """Return the seconds with nothing compiled yet."""
    with tempfile.TemporaryDirectory() as folder:
        return _seconds(scene, {CACHE: folder})


def warm_plan(scene: Path) -> float:
    """Return the seconds with everything compiled, by a process before if need be."""
    _seconds(scene, {})
    return _seconds(scene, {})


def plan_without_compiler(scene: Path) -> float:
    """Return the seconds with no compiler to be found."""
    return _seconds(scene, {"PATH": ""})


def _seconds(scene: Path, environment: dict[str, str]) -> float:
    command = [sys.executable, "-c", _SCRIPT, str(scene)]
    path = os.pathsep.join(filter(None, [os.getcwd(), os.environ.get("PYTHONPATH")]))
    result = subprocess.run(
        command,
        env={**os.environ, "PYTHONPATH": path, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return float(result.stdout)
