"""Seeded moves of robots of all kinds, from easy ones to those at the limit of what is possible.

A move is known by a seed and a number, so that any part of a campaign can be planned again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from deltaopt.bench.random_scenes import MARGIN, farthest_apart, points_in_workspace
from deltaopt.errors import DeltaOptError, Infeasible
from deltaopt.files.validated_record import Vector3
from deltaopt.robot.drive import Drive, Friction
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.robot.robot import Forearm, Platform, Robot, UpperArm
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.moving_ends import State
from deltaopt.scene.path import Corners, Line, PickAndPlace
from deltaopt.scene.rotation import Rotation
from deltaopt.scene.scene import Limits, Scene

Array = NDArray[np.float64]

_FARTHEST_OF = 40
"""Of so many random points the two that are farthest apart make a longest move."""
_MOST_TRIES = 300
"""Random moves of which none can begin and end at rest before the search for one ends."""


def _robot(
    name: str,
    radii: tuple[float, float],
    lengths: tuple[float, float],
    masses: tuple[float, float, float],
    drive: tuple[float | Vector3, float | None],
    gravity: float = 9.81,
) -> Robot:
    """A robot from radii of base and platform and lengths of arm and forearm (m), masses of arm,
    forearm and platform (kg), and limits on torque (N·m) and speed (rad/s)."""
    arm, forearm, platform = masses
    return Robot(
        name=name,
        base_radius=radii[0],
        platform_radius=radii[1],
        upper_arm=UpperArm(length=lengths[0], mass=arm),
        forearm=Forearm(length=lengths[1], mass=forearm),
        platform=Platform(mass=platform),
        drive=Drive(torque=drive[0], speed=drive[1]),
        gravity=gravity,
    )


ROBOTS = (
    (_robot("orsino", (0.2, 0.1), (0.2, 0.5), (0.4, 0.25, 0.3), (10.0, None)), 1.0),
    (_robot("industrial", (0.2, 0.045), (0.235, 0.8), (1.0, 0.4, 0.5), (40.0, 10.0)), 2.0),
    (_robot("irb360", (0.2, 0.045), (0.35, 0.8), (1.2, 0.4, 0.4), (90.0, 12.0)), 1.0),
    (_robot("haptic", (0.037, 0.027), (0.06, 0.103), (0.02, 0.015, 0.05), (0.3, 30.0)), 0.1),
    (_robot("big", (0.45, 0.1), (0.75, 1.8), (6.0, 4.0, 3.0), (600.0, 6.0)), 10.0),
    (_robot("massless", (0.0, 0.0), (0.25, 0.6), (0.0, 0.0, 0.5), (15.0, 15.0), 0.0), 2.0),
    (_robot("odd", (0.15, 0.1), (0.3, 0.55), (0.8, 0.3, 0.4), ((12.0, 30.0, 20.0), 9.0)), 1.0),
)
"""Robots with the largest payload of their moves, kg: the paper's, the industrial one, one of
IRB 360's proportions, a haptic one of 0.1 m, one of 2 m, one without masses in a place without
gravity, one with unequal motors."""


@dataclass(frozen=True)
class Points:
    """Where the ends of a move lie: between which distances from the nearest singularity, and of
    how many random points the two that are farthest apart are taken."""

    least: float = MARGIN
    most: float = inf
    farthest_of: int = 2


_INSIDE, _EDGE = Points(), Points(0.02, MARGIN)

Change = Callable[[Scene, np.random.Generator], Scene]
"""A change of a random move of a robot into one of a stratum."""


def _as_it_is(scene: Scene, rng: np.random.Generator) -> Scene:
    return scene


def _with_drive(**of: object) -> Change:
    """Terms of the drive beside those that there are."""

    def change(scene: Scene, rng: np.random.Generator) -> Scene:
        drive = scene.robot.drive.model_copy(update=of)
        return scene.model_copy(update={"robot": scene.robot.model_copy(update={"drive": drive})})

    return change


def _torque_times(least: float, most: float) -> Change:
    """So many times the torque there is."""

    def change(scene: Scene, rng: np.random.Generator) -> Scene:
        torque = np.multiply(scene.robot.torque_limits, rng.uniform(least, most))
        return _with_drive(torque=tuple(torque.tolist()))(scene, rng)

    return change


def _torque_that_holds(share: float) -> Change:
    """Motors that need so much less than their torque to hold both ends."""

    def change(scene: Scene, rng: np.random.Generator) -> Scene:
        ends, rest = np.array(scene.given_points), np.zeros((2, 3))
        model = delta_model(scene.robot, scene.payload)
        needed = float(np.abs(model.inverse_dynamics(ends, rest, rest)).max())
        largest = max(scene.robot.torque_limits)
        torque = share * needed if needed > 1e-9 * largest else 1e-4 * largest
        return _with_drive(torque=torque)(scene, rng)

    return change


def _speed(scene: Scene) -> float:
    """A speed of the motors, rad/s: their limit, or a usual one."""
    limits = scene.robot.speed_limits
    return 10.0 if limits is None else min(limits)


def _slow_motors(scene: Scene, rng: np.random.Generator) -> Scene:
    return _with_drive(speed=_speed(scene) * 10 ** rng.uniform(-2, -0.5))(scene, rng)


def _millimetres(scene: Scene, rng: np.random.Generator) -> Scene:
    start = np.array(scene.given_points[0])
    goal = start + rng.normal(size=3) * 1e-2 * scene.robot.upper_arm.length
    return scene.model_copy(update={"goal": tuple(goal.tolist())})


def _friction(scene: Scene, rng: np.random.Generator) -> Scene:
    torque = min(scene.robot.torque_limits)
    friction = Friction(viscous=0.2 * torque / _speed(scene), coulomb=0.1 * torque, speed=0.05)
    return _with_drive(friction=friction)(scene, rng)


def _heavy_rotors(scene: Scene, rng: np.random.Generator) -> Scene:
    length = scene.robot.upper_arm.length
    return _with_drive(inertia=scene.robot.platform.mass * length**2)(scene, rng)


def _limited(**of: float) -> Change:
    return lambda scene, rng: scene.model_copy(update={"limits": Limits(**of)})


def _on_a_line(scene: Scene, rng: np.random.Generator) -> Scene:
    return scene.model_copy(update={"path": Line()})


def _lifted(scene: Scene, rng: np.random.Generator) -> Scene:
    path = PickAndPlace(height=0.1 * _distance(scene), blend=0.05 * _distance(scene))
    return scene.model_copy(update={"path": path})


def _round_a_corner(scene: Scene, rng: np.random.Generator) -> Scene:
    corner = _middle(scene) + _across(scene, rng) * rng.uniform(0.1, 0.5)
    path = Corners(points=(_vector(corner),), blend=0.1 * _distance(scene))
    return scene.model_copy(update={"path": path})


def _around_a_sphere(scene: Scene, rng: np.random.Generator) -> Scene:
    """A sphere near the middle of the straight line, which it is in the way of."""
    radius = rng.uniform(0.05, 0.25) * _distance(scene)
    centre = _middle(scene) + rng.uniform(0.0, 0.8) * radius * _unit(_across(scene, rng))
    body = {"sphere": {"centre": centre.tolist(), "radius": radius}}
    return scene.model_copy(update={"keep_out": [body]})


def _over_a_wall(scene: Scene, rng: np.random.Generator) -> Scene:
    """A wall across the straight line, from a little above the higher end downwards; x is down."""
    thick, high = rng.uniform(0.1, 0.6), rng.uniform(0.02, 0.2)
    ends, size = np.array(scene.given_points), _distance(scene)
    half = thick / 2 * np.abs(ends[1] - ends[0])
    half[1:][half[1:] < 0.05 * size] = size  # thin in the direction of the move, wide across it
    least, most = _middle(scene) - half, _middle(scene) + half
    least[0], most[0] = ends[:, 0].min() - high * size, ends[:, 0].max() + size
    body = {"box": {"from": least.tolist(), "to": most.tolist()}}
    return scene.model_copy(update={"keep_out": [body]})


def _moving(scene: Scene, rng: np.random.Generator) -> Scene:
    """Both ends passed at speeds that are small beside those on the way."""
    force = sum(scene.robot.torque_limits) / scene.robot.upper_arm.length
    mass = scene.robot.platform.mass + (scene.payload or 0.0)
    usual = np.sqrt(_distance(scene) * force / mass)
    start, goal = (
        State(at=at, velocity=_vector(0.1 * usual * rng.uniform() * _unit(rng.normal(size=3))))
        for at in scene.given_points
    )
    return scene.model_copy(update={"start": start, "goal": goal})


def _range_of_payloads(scene: Scene, rng: np.random.Generator) -> Scene:
    largest = scene.payload or scene.robot.platform.mass
    return scene.model_copy(update={"payload": [largest * rng.uniform(0.0, 0.9), largest]})


def _falling_torque(scene: Scene, rng: np.random.Generator) -> Scene:
    torque, speed = min(scene.robot.torque_limits), _speed(scene)
    curve = ((0.0, torque), (0.4 * speed, torque), (speed, rng.uniform(0.2, 0.8) * torque))
    return _with_drive(torque_curve=curve)(scene, rng)


def _distance(scene: Scene) -> float:
    start, goal = np.array(scene.given_points)
    return float(np.linalg.norm(goal - start))


def _middle(scene: Scene) -> Array:
    return np.asarray(np.mean(scene.given_points, axis=0))


def _across(scene: Scene, rng: np.random.Generator) -> Array:
    """A random vector across the straight line, as long as that."""
    start, goal = np.array(scene.given_points)
    found = np.cross(goal - start, rng.normal(size=3))
    return np.asarray(_unit(found) * _distance(scene))


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _vector(array: Array) -> Vector3:
    x, y, z = array.tolist()
    return x, y, z


def _rotated(scene: Scene, rng: np.random.Generator) -> Scene:
    rotation = Rotation(angle=1.57, speed=30.0, acceleration=400.0)
    return scene.model_copy(update={"rotation": rotation})


STRATA: dict[str, tuple[Points, Change]] = {
    "inside": (_INSIDE, _as_it_is),
    "edge": (_EDGE, _as_it_is),
    "border": (Points(0.005, 0.02), _as_it_is),
    "longest inside": (Points(farthest_of=_FARTHEST_OF), _as_it_is),
    "longest edge": (Points(0.02, MARGIN, _FARTHEST_OF), _as_it_is),
    "longest border": (Points(0.005, 0.02, _FARTHEST_OF), _as_it_is),
    "weak, 2 % to spare": (_INSIDE, _torque_that_holds(1.02)),
    "weak, 20 % to spare": (_INSIDE, _torque_that_holds(1.2)),
    "weak edge": (_EDGE, _torque_that_holds(1.2)),
    "strong": (_INSIDE, _torque_times(5.0, 20.0)),
    "strong edge": (_EDGE, _torque_times(5.0, 20.0)),
    "slow motors": (_EDGE, _slow_motors),
    "millimetres": (_INSIDE, _millimetres),
    "friction": (_INSIDE, _friction),
    "friction edge": (_EDGE, _friction),
    "heavy rotors": (_EDGE, _heavy_rotors),
    "platform speed": (_EDGE, _limited(platform_speed=1.0)),
    "acceleration": (_EDGE, _limited(acceleration=30.0)),
    "line": (_INSIDE, _on_a_line),
    "rotation": (_INSIDE, _rotated),
    "lifted": (_INSIDE, _lifted),
    "corner": (_EDGE, _round_a_corner),
    "sphere": (_INSIDE, _around_a_sphere),
    "wall": (_INSIDE, _over_a_wall),
    "moving ends": (_INSIDE, _moving),
    "range of payloads": (_INSIDE, _range_of_payloads),
    "torque curve": (_EDGE, _falling_torque),
}
"""Strata of a campaign: where the ends lie, and what is changed."""


@dataclass(frozen=True)
class Move:
    """A move of a campaign: its ``number``, the stratum that it was drawn from, its ``scene``."""

    number: int
    stratum: str
    scene: Scene


def move(seed: int, number: int) -> Move:
    """The move of this number. Raises Infeasible if hardly any such move can be held at both ends.

    Robots follow one another, then strata; two moves in three carry a payload.
    """
    rng = np.random.default_rng([seed, number])
    robot, most = ROBOTS[number % len(ROBOTS)]
    stratum = list(STRATA)[number // len(ROBOTS) % len(STRATA)]
    where, change = STRATA[stratum]
    payload = None if number % 3 == 0 else most * float(rng.uniform(0.05, 1.0))
    for _ in range(_MOST_TRIES):
        ends = _ends(DeltaModel(robot, payload), where, rng)
        if ends is None:
            continue
        scene = Scene(robot=robot, payload=payload, start=ends[0], goal=ends[1])
        try:
            scene = change(scene, rng)
            check_feasible(scene)
        except DeltaOptError:
            continue
        if not _path_stays_in_workspace(scene):
            continue
        return Move(number, stratum, Scene.model_validate(scene.model_dump()))
    raise Infeasible(f"move {number} ({robot.name}, {stratum}): none of {_MOST_TRIES} can be held")


def _path_stays_in_workspace(scene: Scene) -> bool:
    """Whether the path that is given, if any, does, as far as samples show."""
    if scene.path is None:
        return True
    start, goal = scene.given_points
    path = scene.path.between(start, goal)
    places = path(np.linspace(path.knots[0], path.knots[-1], 101))
    alignments = delta_model(scene.robot, scene.payload).alignments(places)
    return bool((alignments > 0).all())  # False where not a number


def _ends(
    model: DeltaModel, where: Points, rng: np.random.Generator
) -> tuple[Vector3, Vector3] | None:
    """Start and goal, m; None if a batch has too few points."""
    points = points_in_workspace(model, rng, where.least, where.most)
    return farthest_apart(points[: where.farthest_of])
