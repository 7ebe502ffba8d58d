"""The C of a robot and of a plan: compiled, run under sanitizers, and held against Python."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import deltaopt
from deltaopt.cli import main
from deltaopt.output.controller_c import export_c, export_plan_c
from deltaopt.robot.robot import Robot, load_robot
from studies.problems import PROBLEMS

ROBOT = load_robot(PROBLEMS / "robots" / "orsino.yaml")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")
SANITIZED = ("-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
EVERYTHING = {
    "name": "a robot with every term",
    "base_radius": 0.2,
    "platform_radius": 0.045,
    "upper_arm": {"length": 0.235, "mass": 1.0, "inertia": 0.005, "centre": [0.11, 0.004]},
    "elbow": {"mass": 0.05},
    "forearm": {"length": 0.8, "mass": 0.4, "inertia": [0.0284, 0.001, 0.0284]},
    "platform": {"mass": 0.5, "pins": 0.05},
    "tool": {"offset": [0.12, 0.01, -0.02], "mass": 0.2},
    "drive": {
        "torque": [40, 38, 42],
        "inertia": 0.02,
        "friction": {"viscous": 0.3, "coulomb": 1.5, "speed": 0.05},
    },
    "joints": {"zero": [0.1, -0.2, 0.3], "sign": [1, -1, 1]},
    "gravity": [9.7, 0.5, -0.3],
}
gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")


@pytest.fixture(scope="module")
def every_term(tmp_path_factory) -> Path:
    """The folder of the C of a robot with every term and of a motion of it."""
    robot = Robot.model_validate(EVERYTHING)
    scene = deltaopt.Scene(robot=robot, start=(0.87, -0.15, 0.0), goal=(0.87, 0.1, 0.05))
    folder = tmp_path_factory.mktemp("every_term")
    export_plan_c(deltaopt.baseline(scene), folder)
    return folder


def compiled(folder: Path, *options: str) -> Path:
    sources = [file.name for file in sorted(folder.glob("*.c"))]
    command = ["gcc", *STRICT, *options, *sources, "-lm", "-o", "program"]
    made = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    return folder / "program"


def largest_error(folder: Path, *options: str) -> float:
    """That the exported test program prints, compiled with options."""
    program = compiled(folder, *options)
    ran = subprocess.run([program], capture_output=True, text=True, timeout=60)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return float(re.search(r"largest relative error: (\S+)", ran.stdout)[1])


@pytest.mark.parametrize("name", ["*/ int evil; /*", "/* x */ int evil; /*/", "µ-Delta ??/ \\"])
def test_a_name_does_not_end_the_comment(name, tmp_path):
    header, source, *_ = export_c(ROBOT.model_copy(update={"name": name}), tmp_path)
    for file in header, source:
        text = file.read_text(encoding="utf-8")
        assert "evil" not in text.split("*/")[1]
        assert "/*" not in text.split("*/")[0][2:]  # which compilers warn of
    text = header.read_text(encoding="utf-8")
    assert text.splitlines()[0].endswith(": kinematics and dynamics. Written by deltaopt.")


@gcc
def test_c_is_python(tmp_path):
    """Kinematics, dynamics and the controller's angles; torques are by another formulation."""
    export_c(load_robot(PROBLEMS / "robots" / "rl5.yaml"), tmp_path)
    assert largest_error(tmp_path, *SANITIZED) < 1e-12


@gcc
@pytest.mark.parametrize("scene", ["hornet/1_kg.yaml", "moving/belt.yaml"])
def test_a_plan_is_played(tmp_path, scene):
    """At its knots, between them, before and after it, where one that goes on on a belt rests."""
    plan = deltaopt.plan(deltaopt.load_scene(PROBLEMS / scene))
    plan.save(tmp_path / "plan", chart=False)
    assert main(["export", "c", str(tmp_path / "plan"), "-o", str(tmp_path / "c")]) == 0
    assert largest_error(tmp_path / "c", *SANITIZED) < 1e-12


@gcc
def test_a_robot_with_every_term_and_a_motion(every_term):
    """Without sanitizers, with which compilers take ten seconds for its long sums."""
    assert largest_error(every_term, "-O0") < 1e-12


@gcc
def test_times_that_are_none(tmp_path):
    """NaN and infinity as times play the nearest end; nothing is read beyond the data."""
    line = deltaopt.baseline(deltaopt.load_scene(PROBLEMS / "pick_and_place.yaml"))
    export_plan_c(line, tmp_path)
    (tmp_path / "test_delta.c").write_text(
        """#include <stdio.h>
        #include "plan.h"
        int main(void) {
          const double t[] = {0.0 / 0.0, -1.0 / 0.0, 1e308, 1.0 / 0.0, 0.0};
          for (int i = 0; i < 5; i++) {
            delta_setpoint s;
            delta_play(&delta_plan, t[i], delta_plan_payload, &s);
            printf("%.17g %.17g\\n", s.angle[0], s.torque[0]);
          }
        }"""
    )
    ran = subprocess.run([compiled(tmp_path, *SANITIZED)], capture_output=True, text=True)
    found = np.array([row.split() for row in ran.stdout.splitlines()], float)
    ends = line([-1.0, -1.0, line.duration + 1, line.duration + 1, 0.0])
    np.testing.assert_allclose(found, np.stack([ends.theta, ends.tau])[:, :, 0].T, rtol=1e-12)


@gcc
def test_nothing_of_the_library_but_four_functions(every_term):
    """Not optimised, so that the compiler neither leaves calls out nor joins sin and cos."""
    needed = set()
    for name in ("delta", "plan"):
        subprocess.run(["gcc", "-O0", "-c", f"{name}.c"], cwd=every_term, check=True)
        listed = subprocess.run(["nm", "-u", f"{name}.o"], cwd=every_term, capture_output=True)
        needed |= {line.split()[-1] for line in listed.stdout.decode().splitlines()}
    needed = {name for name in needed if not name.startswith("_")}
    assert needed == {"sin", "cos", "sqrt", "atan2"}


@gcc
def test_friction_far_from_rest(every_term, tmp_path):
    """tanh, by doublings of a continued fraction: from 1e-300 to beyond where it is 1."""
    text = (every_term / "delta.c").read_text(encoding="utf-8")
    text = text.replace('#include "delta.h"\n', "").split("typedef double V;")[0]
    angles = [s * a for a in np.geomspace(1e-300, 1e3, 400).tolist() for s in (1, -1)]
    calls = "\n".join(f'printf("%.17g\\n", hyperbolic_tangent({a!r}));' for a in [*angles, 0.0])
    calls += '\nprintf("%g", hyperbolic_tangent(0.0 / 0.0));'
    program = f"#include <stdio.h>\n{text}\nint main(void) {{\n{calls}\n}}\n"
    (tmp_path / "tanh.c").write_text(program)
    ran = subprocess.run([compiled(tmp_path, "-O1")], capture_output=True, text=True)
    *found, last = map(float, ran.stdout.split())
    np.testing.assert_allclose(found, np.tanh([*angles, 0.0]), rtol=4e-15, atol=0)
    assert np.isnan(last)
