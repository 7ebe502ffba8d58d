"""Exported inverse dynamics in C beside Pinocchio and MuJoCo, where these are installed.

The C code is timed by its own test program; the peers are called from Python, which costs them
about a microsecond.
"""

from __future__ import annotations

import argparse
import re
import subprocess
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np

import deltaopt
from deltaopt.bench.peers import installed
from deltaopt.codegen.compile import compiler
from deltaopt.errors import MissingPackage
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.output.controller_c import export_c
from studies.problems import ORSINO, add_robots

Robot = deltaopt.Robot

HELP = "exported C beside Pinocchio and MuJoCo"
SMALL = {"robots": (ORSINO,), "calls": 20}
_PAYLOAD = 1.0


def exported_nanoseconds(robot: Robot) -> tuple[float, float]:
    """Return the nanoseconds of inverse and of forward dynamics in exported C.

    Raises MissingPackage where there is no C compiler.
    """
    found = compiler()
    if found is None:
        raise MissingPackage("no C compiler is installed")
    with TemporaryDirectory() as folder:
        export_c(robot, Path(folder))
        build = [found.command, "-O2", "delta.c", "test_delta.c", "-lm", "-o", "test_delta"]
        subprocess.run(build, cwd=folder, check=True)
        ran = subprocess.run([f"{folder}/test_delta"], capture_output=True, text=True, check=True)
    inverse, forward = re.findall(r"(\d+) ns", ran.stdout)
    return float(inverse), float(forward)


def pinocchio_seconds(robot: Robot, payload: float, calls: int) -> float:
    """Return the seconds of one recursive Newton-Euler pass over the open tree, which is a part of
    inverse dynamics. Raises MissingPackage."""
    pin = installed("pinocchio", "studies")
    model = pin.Model()
    _add_tree(pin, model, robot, payload)
    data = model.createData()
    q, v, a = (np.full(size, 0.1) for size in (model.nq, model.nv, model.nv))
    return _seconds(lambda: pin.rnea(model, data, q, v, a), calls)


def _add_tree(pin: Any, model: Any, robot: Robot, payload: float) -> None:
    """Add the platform on three slides, and three chains of three hinges: the paper's twelve
    coordinates."""
    arm, bars, identity = robot.upper_arm, robot.forearm, pin.SE3.Identity()
    platform = model.addJoint(0, pin.JointModelTranslation(), identity, "platform")
    mass = robot.platform.mass + payload
    model.appendBodyToJoint(platform, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), identity)
    for k, azimuth in enumerate(AZIMUTHS):
        place = pin.SE3(pin.utils.rotate("x", azimuth), np.zeros(3))
        first = model.addJoint(0, pin.JointModelRZ(), place, f"arm {k}")
        model.appendBodyToJoint(first, _bar(pin, arm.mass, arm.length), identity)
        elbow = pin.SE3(np.eye(3), np.array([0.0, arm.length, 0.0]))
        second = model.addJoint(first, pin.JointModelRZ(), elbow, f"bars {k}")
        third = model.addJoint(second, pin.JointModelRX(), identity, f"sideways {k}")
        model.appendBodyToJoint(third, _bar(pin, bars.mass, bars.length), identity)


def _bar(pin: Any, mass: float, length: float) -> Any:
    moment = mass * length**2 / 12
    return pin.Inertia(mass, np.array([0, length / 2, 0]), np.diag([moment, 0.0, moment]))


def mujoco_seconds(robot: Robot, payload: float, calls: int) -> float:
    """Return the seconds of mj_inverse of the mechanism, its loops closed by three connections.
    Raises MissingPackage."""
    mujoco = installed("mujoco", "studies")
    model = mujoco.MjModel.from_xml_string(mjcf(robot, payload))
    data = mujoco.MjData(model)
    return _seconds(lambda: mujoco.mj_inverse(model, data), calls)


def mjcf(robot: Robot, payload: float) -> str:
    """Write the mechanism in MuJoCo's format, z up: twelve coordinates, nine constraints."""
    chains = "\n".join(_mjcf_chain(robot, k, azimuth) for k, azimuth in enumerate(AZIMUTHS))
    connections = "\n".join(
        f'<connect site1="tip{k}" site2="corner{k}"/>' for k in range(len(AZIMUTHS))
    )
    radius = robot.platform_radius
    corners = "\n".join(
        f'<site name="corner{k}" pos="{radius * np.cos(a)} {radius * np.sin(a)} 0"/>'
        for k, a in enumerate(AZIMUTHS)
    )
    depth = -((robot.forearm.length**2 - (robot.base_radius - radius) ** 2) ** 0.5)
    return f"""<mujoco><option gravity="0 0 -{robot.gravity}"/><worldbody>
<body name="platform" pos="0 0 {depth}">
<joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
<joint type="slide" axis="0 0 1"/>
<inertial mass="{robot.platform.mass + payload}" pos="0 0 0" diaginertia="1e-6 1e-6 1e-6"/>
{corners}</body>
{chains}
</worldbody><equality>{connections}</equality></mujoco>"""


def _mjcf_chain(robot: Robot, k: int, azimuth: float) -> str:
    arm, bars = robot.upper_arm, robot.forearm
    y, z = robot.base_radius * np.cos(azimuth), robot.base_radius * np.sin(azimuth)
    return f"""<body pos="{y} {z} 0"
 euler="0 0 {np.degrees(azimuth)}"><joint axis="0 1 0"/>{_mjcf_bar(arm.mass, arm.length)}
<body pos="{arm.length} 0 0"><joint axis="0 1 0"/><joint axis="0 0 1"/>
{_mjcf_bar(bars.mass, bars.length)}<site name="tip{k}" pos="{bars.length} 0 0"/></body></body>"""


def _mjcf_bar(mass: float, length: float) -> str:
    moment = mass * length**2 / 12
    return (
        f'<inertial mass="{mass}" pos="{length / 2} 0 0" '
        f'diaginertia="{moment * 1e-3} {moment} {moment}"/>'
    )


def _seconds(call: Callable[[], object], calls: int) -> float:
    """Return the seconds per call, the median of 11 batches."""
    batches = []
    for _ in range(11):
        begin = perf_counter()
        for _ in range(calls):
            call()
        batches.append((perf_counter() - begin) / calls)
    return float(np.median(batches))


PEERS: dict[str, Callable[[Robot, float, int], float]] = {
    "Pinocchio, one pass over the open tree": pinocchio_seconds,
    "MuJoCo, mj_inverse with closed loops": mujoco_seconds,
}
"""What the exported inverse dynamics is held against, each called from Python."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_robots(parser)
    parser.add_argument(
        "--calls",
        type=int,
        default=2000,
        metavar="N",
        help="of each peer, 11 times (default: 2000)",
    )


def run(arguments: argparse.Namespace) -> int:
    for robot in map(deltaopt.load_robot, arguments.robots):
        inverse, forward = exported_nanoseconds(robot)
        print(f"{robot.name}: inverse dynamics {inverse:.0f} ns, forward dynamics {forward:.0f} ns")
        for name, measure in PEERS.items():
            try:
                peer = 1e9 * measure(robot, _PAYLOAD, arguments.calls)
            except MissingPackage as error:
                print(f"  {error}")
                continue
            print(f"  {name}: {peer:.0f} ns, {peer / inverse:.0f} times as long")
    return 0
