"""Scenes at the edge, where a planner may fail: at the end of the workspace, at singularities, with
torques that hardly hold the robot, with ends that are all but one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.robot.drive import Drive
from deltaopt.robot.model import DeltaModel
from deltaopt.robot.robot import Forearm, Platform, Robot, UpperArm
from deltaopt.scene.scene import Scene

MIDDLE: Vector3 = (0.45, 0.05, 0.0)
"""A good place, m."""
ASIDE: Vector3 = (0.42, -0.06, 0.05)
"""Another."""
DEEP: Vector3 = (0.46, 0.0, 0.0)
HIGH: Vector3 = (0.4, 0.0, 0.0)
"""On the axis, where all motors hold the same."""
STRONG = 60.0
"""N·m, so that only the place matters."""
DISTANCES = (1e-2, 1e-4, 1e-9)
"""Of a start or goal from the boundary, along the line to ``MIDDLE``, m."""
SHARES = (0.99, 0.9999, 1.01)
"""Of a torque limit that holding still takes."""
STEPS = (1e-2, 1e-4, 1e-6, 1e-8, 1e-15)
"""From start to goal, m."""
ORSINO = Robot(
    name="Orsino, Coutinho and Hess-Coelho",
    base_radius=0.20,
    platform_radius=0.10,
    upper_arm=UpperArm(length=0.20, mass=0.40),
    forearm=Forearm(length=0.50, mass=0.25),
    platform=Platform(mass=0.30),
    drive=Drive(torque=10.0),
)
"""Section 5.3 with a torque limit of our choice."""
PAYLOAD = 1.0
"""kg."""
ENDS: dict[str, Vector3] = {
    "a chain stretched": (0.70, 0.05, 0.0),
    "a chain folded": (0.20, 0.05, 0.0),
    "bars sideways": (0.16, 0.22, 0.5),
}
"""Points towards which the workspace ends, seen from ``MIDDLE``, by what ends it; the bars of
chain 1 lie sideways exactly at the last."""


@dataclass(frozen=True)
class Case:
    """A scene at the edge, which is made when it is called for, since that may already be
    refused."""

    family: str
    name: str
    make: Callable[[], Scene]


def cases() -> list[Case]:
    """Return all cases, family by family."""
    families = (_boundary, _singular, _gravity, _coincident, _wide, _payloads, _unequal)
    return [case for family in families for case in family()]


def _boundary() -> Iterator[Case]:
    """Starts and goals at a distance from the end of the workspace, and a way along it."""
    for name in ENDS:
        for d in DISTANCES:
            yield Case("boundary", f"start {d:g} m, {name}", partial(_from_end, name, d))
        yield Case("boundary", f"goal {DISTANCES[1]:g} m, {name}", partial(_to_end, name))
    grazing = {
        "way inside the hole of a folded chain": ((0.31, -0.20, 0.0), (0.31, 0.12, 0.0)),
        "way along the stretched end": ((0.66, -0.10, 0.0), (0.66, 0.10, 0.0)),
        "goal outside": (MIDDLE, (0.75, 0.0, 0.0)),
    }
    for name, (start, goal) in grazing.items():
        yield Case("boundary", name, partial(_scene, start, goal, torque=STRONG))


def _singular() -> Iterator[Case]:
    """Starts and goals at serial singularities themselves, as far as doubles can tell."""
    for name in ENDS:
        yield Case("serial singularity", f"start, {name}", partial(_from_end, name, 0.0))
    yield Case(
        "serial singularity", "goal, a chain stretched", partial(_to_end, next(iter(ENDS)), 0.0)
    )


def _gravity() -> Iterator[Case]:
    """Torque limits of which holding still at the start takes a share."""
    for share in SHARES:
        yield Case(
            "gravity", f"one motor holds with {share:.2%}", partial(_exhausted, share, False)
        )
        yield Case("gravity", f"all motors hold with {share:.2%}", partial(_exhausted, share, True))


def _coincident() -> Iterator[Case]:
    for step in STEPS:
        x, y, z = MIDDLE
        yield Case("coincident", f"{step:g} m apart", partial(_scene, MIDDLE, (x, y + step, z)))


def _wide() -> Iterator[Case]:
    wide = ORSINO.model_copy(update={"base_radius": 0.10, "platform_radius": 0.20})
    yield Case(
        "wide platform", "platform 0.2 m, base 0.1 m", partial(_scene, MIDDLE, ASIDE, robot=wide)
    )
    equal = ORSINO.model_copy(update={"base_radius": 0.10})
    yield Case("wide platform", "both 0.1 m", partial(_scene, MIDDLE, ASIDE, robot=equal))


def _payloads() -> Iterator[Case]:
    """None, zero (which is not a payload), and what the limits can just hold."""
    yield Case("payload", "none", partial(_scene, MIDDLE, ASIDE, payload=None))
    yield Case("payload", "zero", partial(_scene, MIDDLE, ASIDE, payload=0.0))
    yield Case("payload", "1e-9 kg", partial(_scene, MIDDLE, ASIDE, payload=1e-9))
    for times in (0.99, 10.0):
        yield Case("payload", f"{times:g} of what can be held", partial(_heavy, times))


def _unequal() -> Iterator[Case]:
    for limits in ((300.0, 30.0, 3.0), (2.0, 200.0, 200.0)):
        name = " ".join(f"{limit:g}" for limit in limits) + " N·m"
        yield Case("unequal motors", name, partial(_scene, MIDDLE, ASIDE, torque=limits))


def _scene(
    start: Vector3,
    goal: Vector3,
    *,
    robot: Robot = ORSINO,
    payload: float | None = PAYLOAD,
    torque: float | Vector3 = 10.0,
) -> Scene:
    driven = robot.model_copy(update={"drive": Drive(torque=torque)})
    return Scene(robot=driven, payload=payload, start=start, goal=goal)


def _from_end(name: str, distance: float) -> Scene:
    return _scene(_before_end(name, distance), MIDDLE, torque=STRONG)


def _to_end(name: str, distance: float = DISTANCES[1]) -> Scene:
    return _scene(MIDDLE, _before_end(name, distance), torque=STRONG)


def _before_end(name: str, distance: float) -> Vector3:
    """The point at a distance before the workspace's end, by bisection to the last digit."""
    model = DeltaModel(ORSINO, PAYLOAD)
    begin, end = np.array(MIDDLE), np.array(ENDS[name])
    inside, outside = 0.0, 1.0
    while inside < (middle := (inside + outside) / 2) < outside:
        q = model.functions.inverse_kinematics(begin + middle * (end - begin), model.parameters)
        if np.isfinite(q.full()).all():
            inside = middle
        else:
            outside = middle
    point = begin + (inside - distance / np.linalg.norm(end - begin)) * (end - begin)
    return vector3(point)


def _exhausted(share: float, all_motors: bool) -> Scene:
    """A limit that the strongest motor of ``ASIDE`` nearly exhausts, or that all do of ``DEEP``."""
    start, goal = (DEEP, HIGH) if all_motors else (ASIDE, MIDDLE)
    return _scene(start, goal, torque=float(_holding(start, PAYLOAD).max()) / share)


def _heavy(times: float) -> Scene:
    """So many times the payload that ORSINO can hold at both ends: holding is linear in it."""
    empty, one = (
        np.array([_holding(point, payload) for point in (MIDDLE, ASIDE)]) for payload in (None, 1.0)
    )
    most = float(((ORSINO.torque_limits[0] - empty) / (one - empty)).min())
    return _scene(MIDDLE, ASIDE, payload=times * most)


def _holding(point: Vector3, payload: float | None) -> Array:
    """Torques that hold ORSINO still at a point."""
    return np.abs(DeltaModel(ORSINO, payload).inverse_dynamics(point, np.zeros(3), np.zeros(3)))
