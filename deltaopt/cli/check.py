"""Check a scene, and say what of it is modelled and what is not.

Reads the scene and its robot, checks that the platform can be at both ends and that the motors can
hold it there, lists the limits, and shows the baseline: the straight line by a quintic law (10 u³ -
15 u⁴ + 6 u⁵ of the line at the share u of the duration), slowed until it keeps the limits. Timed
optimally the same line takes less: 0.144 s instead of 0.197 s in problems/pick_and_place.yaml.

Exit code: 0 the scene can be planned; 1 it has no solution; 2 bad input.
"""

from __future__ import annotations

import argparse

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from deltaopt.cli.arguments import add_scene
from deltaopt.codegen.compile import describe
from deltaopt.errors import DeltaOptError, in_words
from deltaopt.mechanisms.delta.mechanism import DeltaParameters
from deltaopt.planning.initial_motion import baseline
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene import Scene, limits_of, load_scene
from deltaopt.scene.task import distance

Array = NDArray[np.float64]

HELP = "check a scene and say what is modelled"

_ORDERS = ("position", "velocity", "acceleration or torque")
_NEVER = "friction, motor and gear inertia, elasticity, play"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scene(parser)


def run(arguments: argparse.Namespace) -> int:
    scene = load_scene(arguments.scene)
    check_feasible(scene)
    for name, text in _description(scene):
        print(f"{name:<13}{text}")
    print(f"\n{limits_table(scene)}")
    return 0


def _description(scene: Scene) -> list[tuple[str, str]]:
    """The lines of the description, each a name and a text."""
    model, task = DeltaModel(scene.robot, scene.payload), scene.task
    mechanism, parameters = model.functions.mechanism, model.numbers
    coordinates, constraints = mechanism.q.numel(), mechanism.mu.numel()
    start, goal = in_words(task.start.position), in_words(task.goal.position)
    return [
        ("robot", scene.robot.name),
        ("task", f"{task.description}: {start} to {goal} m, {distance(task):.4g} m apart"),
        ("objective", str(scene.objective)),
        ("coordinates", f"{coordinates}: x, y, z of the platform, three angles of each chain"),
        ("constraints", f"{constraints}: loop closure, eq. (50)-(52)"),
        ("freedom", f"{coordinates - constraints} degrees, {mechanism.controls.numel()} motors"),
        ("bodies", f"{len(mechanism.bodies)}: {_masses(parameters)}"),
        ("inertia", _inertias(parameters)),
        ("gravity", _gravity(parameters)),
        ("machine code", describe()),
        ("left out", ", ".join([*_absent(parameters), _NEVER])),
        ("baseline", _baseline(scene)),
    ]


def limits_table(scene: Scene) -> str:
    """A table of the limits of a scene: unit, bounds, order, and whether slowing down helps."""
    limits = limits_of(scene)
    constraints, (lower, upper) = limits.constraints, limits.bounds
    rows = [("limit", "of each", "unit", "bound", "order", "slowing helps", "")]
    for limit, own in zip(constraints.limits, constraints.slices, strict=True):
        rows.append(
            (
                limit.name,
                limit.subject,
                limit.unit,
                _bounds(lower[own], upper[own]),
                f"{limit.order} ({_ORDERS[limit.order]})",
                "yes" if constraints.slowing_exponents[own].any() else "no",
                "" if limit.promised else "a margin of the planner's, not verified",
            )
        )
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = ("  ".join(f"{cell:<{w}}" for cell, w in zip(row, widths, strict=True)) for row in rows)
    return "\n".join(line.rstrip() for line in lines)


def _bounds(lower: Array, upper: Array) -> str:
    """Bounds as text: ± 10, at most 5, at least 0.01; several numbers if items differ."""
    size = [f"{value:g}" for value in dict.fromkeys(np.where(np.isfinite(upper), upper, lower))]
    each = ", ".join(size)
    if np.isfinite(lower).all() and np.isfinite(upper).all():
        return f"± {each}"
    return f"at most {each}" if np.isfinite(upper).all() else f"at least {each}"


def _masses(p: DeltaParameters) -> str:
    payload = "" if p.m2 is None else f"payload {p.m2:g} kg, "
    return f"platform {p.m1:g} kg, {payload}3 arms {p.m3:g} kg, 3 pairs of bars {p.m4:g} kg"


def _inertias(p: DeltaParameters) -> str:
    """Moments of inertia about the centres of mass, as text."""
    axes = (p.I41, p.I43) if p.I42 is None else (p.I41, p.I42, p.I43)
    bars = ", ".join(f"{moment:.4g}" for moment in axes)
    return f"arm {p.I33:.4g} kg·m²; bars {bars} kg·m²"


def _gravity(p: DeltaParameters) -> str:
    """The acceleration of gravity, as text."""
    if p.gravity is None:
        return "none"
    if p.g_y is None and p.g_z is None:
        return f"{p.g:g} m/s² downward (+x)"
    return f"{in_words(np.array(ca.DM(p.gravity)).ravel())} m/s² in the base's frame"


def _absent(p: DeltaParameters) -> list[str]:
    """Names of the terms that a model can have and this one has not."""
    terms = {"payload": p.m2, "bars' inertia about their length": p.I42, "gravity": p.gravity}
    return [name for name, value in terms.items() if value is None]


def _baseline(scene: Scene) -> str:
    try:
        return f"straight line by a quintic law in {baseline(scene).duration:.6f} s"
    except DeltaOptError as error:
        return f"none: {error}"
