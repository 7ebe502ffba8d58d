"""Check a scene and say what of it will be modelled, and what not.

Reads the scene and its robot, makes sure that the platform can be at both ends and that the
motors can hold it there, and shows the baseline: the straight line, as fast as the limits
allow.

Exit code: 0 the scene can be planned; 1 it has no solution; 2 bad input.
"""

from __future__ import annotations

import argparse

import numpy as np

from deltaopt.cli.arguments import add_scene
from deltaopt.codegen.compile import describe
from deltaopt.errors import DeltaOptError, in_words
from deltaopt.files.validated_record import Vector3
from deltaopt.mechanisms.delta.mechanism import DeltaParameters
from deltaopt.planning.initial_motion import baseline
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene import Scene, load_scene

HELP = "check a scene and say what will be modelled"

_NEVER = "friction, motor and gear inertia, elasticity, play"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scene(parser)


def run(arguments: argparse.Namespace) -> int:
    scene = load_scene(arguments.scene)
    check_feasible(scene)
    for name, text in _description(scene):
        print(f"{name:<13}{text}")
    return 0


def _description(scene: Scene) -> list[tuple[str, str]]:
    """Name and text of each line."""
    model = DeltaModel(scene.robot, scene.payload)
    mechanism, parameters = model.functions.mechanism, model.numbers
    coordinates, constraints = mechanism.q.numel(), mechanism.mu.numel()
    distance = np.linalg.norm(np.subtract(scene.goal, scene.start))
    return [
        ("robot", scene.robot.name),
        ("motion", f"{in_words(scene.start)} to {in_words(scene.goal)} m, {distance:.4g} m apart"),
        ("", "at rest at both ends, where the motors can hold it; path free"),
        ("objective", str(scene.objective)),
        ("coordinates", f"{coordinates}: x, y, z of the platform, three angles of each chain"),
        ("constraints", f"{constraints}: loop closure, eq. (50)-(52)"),
        ("freedom", f"{coordinates - constraints} degrees, {mechanism.controls.numel()} motors"),
        ("bodies", f"{len(mechanism.bodies)}: {_masses(parameters)}"),
        ("inertia", _inertias(parameters)),
        ("gravity", "none" if parameters.g is None else f"{parameters.g:g} m/s² downward (+x)"),
        ("torque", _limit(scene.torque_limits, "N·m")),
        ("speed", _limit(scene.speed_limits, "rad/s")),
        ("machine code", describe()),
        ("left out", ", ".join([*_absent(parameters), _NEVER])),
        ("baseline", _baseline(scene)),
    ]


def _masses(p: DeltaParameters) -> str:
    payload = "" if p.m2 is None else f"payload {p.m2:g} kg, "
    return f"platform {p.m1:g} kg, {payload}3 arms {p.m3:g} kg, 3 pairs of bars {p.m4:g} kg"


def _inertias(p: DeltaParameters) -> str:
    """Moments about the centres of mass."""
    axes = (p.I41, p.I43) if p.I42 is None else (p.I41, p.I42, p.I43)
    bars = ", ".join(f"{moment:.4g}" for moment in axes)
    return f"arm {p.I33:.4g} kg·m²; bars {bars} kg·m²"


def _absent(p: DeltaParameters) -> list[str]:
    """Terms a scene could have and this one has not."""
    terms = {"payload": p.m2, "bars' inertia about their length": p.I42, "gravity": p.g}
    return [name for name, value in terms.items() if value is None]


def _limit(limits: Vector3 | None, unit: str) -> str:
    if limits is None:
        return "no limit"
    each = f"{limits[0]:g}" if len(set(limits)) == 1 else in_words(limits)
    return f"at most {each} {unit}"


def _baseline(scene: Scene) -> str:
    try:
        return f"straight line in {baseline(scene).duration:.6f} s"
    except DeltaOptError as error:
        return f"none: {error}"
