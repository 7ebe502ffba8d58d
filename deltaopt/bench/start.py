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
from deltaopt.motion.time_scaling import torque_excess
from deltaopt.planning.planner import plan
from deltaopt.scene.scene import load_scene
import sys
scene = load_scene(sys.argv[1])
found = plan(scene)
assert torque_excess(scene, found.trajectory).value <= 1e-9 and found.within_tolerance
print(perf_counter() - begin)
"""


def first_plan(scene: Path) -> float:
    """With nothing compiled yet, s."""
    with tempfile.TemporaryDirectory() as folder:
        return _seconds(scene, {CACHE: folder})


def warm_plan(scene: Path) -> float:
    """With everything compiled, by a process before if need be, s."""
    _seconds(scene, {})
    return _seconds(scene, {})


def plan_without_compiler(scene: Path) -> float:
    """With no compiler to be found, s."""
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
