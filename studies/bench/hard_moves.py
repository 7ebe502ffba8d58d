"""Seeded moves of robots of all kinds, from easy ones to those at the limit of what is possible.

A move is known by a seed and a number, so that any part of a campaign can be planned again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deltaopt.errors import RULED_OUT, Infeasible, SceneError
from deltaopt.files.validated_record import Vector3
from deltaopt.robot.drive import Drive
from deltaopt.robot.model import DeltaModel, delta_model
from deltaopt.robot.robot import Forearm, Platform, Robot, UpperArm
from deltaopt.scene.feasibility import check_feasible
from deltaopt.scene.scene import Scene
from studies.bench.random_scenes import farthest_apart, points_in_workspace
from studies.bench.strata import RANDOM, STRATA, Points

_MOST_TRIES = 300
"""Random moves of which none can begin and end at rest before the search for one ends."""


def robot_of(
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
    (robot_of("orsino", (0.2, 0.1), (0.2, 0.5), (0.4, 0.25, 0.3), (10.0, None)), 1.0),
    (robot_of("industrial", (0.2, 0.045), (0.235, 0.8), (1.0, 0.4, 0.5), (40.0, 10.0)), 2.0),
    (robot_of("irb360", (0.2, 0.045), (0.35, 0.8), (1.2, 0.4, 0.4), (90.0, 12.0)), 1.0),
    (robot_of("haptic", (0.037, 0.027), (0.06, 0.103), (0.02, 0.015, 0.05), (0.3, 30.0)), 0.1),
    (robot_of("big", (0.45, 0.1), (0.75, 1.8), (6.0, 4.0, 3.0), (600.0, 6.0)), 10.0),
    (robot_of("massless", (0.0, 0.0), (0.25, 0.6), (0.0, 0.0, 0.5), (15.0, 15.0), 0.0), 2.0),
    (robot_of("odd", (0.15, 0.1), (0.3, 0.55), (0.8, 0.3, 0.4), ((12.0, 30.0, 20.0), 9.0)), 1.0),
)
"""Robots with the largest payload of their moves, kg: the paper's, the industrial one, one of
IRB 360's proportions, a haptic one of 0.1 m, one of 2 m, one without masses in a place without
gravity, one with unequal motors."""


@dataclass(frozen=True)
class Move:
    """A move of a campaign: its ``number``, the stratum that it was drawn from, its ``scene``."""

    number: int
    stratum: str
    scene: Scene


def move(seed: int, number: int) -> Move:
    """The move of this number. Raises Infeasible if hardly any such move can be held at both ends.

    Robots follow one another, then strata; two moves in three of each robot in each stratum carry a
    payload.
    """
    rng = np.random.default_rng([seed, number])
    usual, most = ROBOTS[number % len(ROBOTS)]
    name = list(STRATA)[number // len(ROBOTS) % len(STRATA)]
    stratum = STRATA[name]
    cycle = number // (len(ROBOTS) * len(STRATA))
    share = None if (number + cycle) % 3 == 0 else float(rng.uniform(0.05, 1.0))
    for _ in range(_MOST_TRIES):
        robot = stratum.robot(usual, rng)
        payload = None if share is None else share * _carried(robot, most)
        ends = random_ends(DeltaModel(robot, payload), stratum.points, rng)
        if ends is None:
            continue
        try:
            scene = Scene(robot=robot, payload=payload, start=ends[0], goal=ends[1])
            scene = stratum.change(scene, rng)
            check_feasible(scene)
        except (SceneError, *RULED_OUT):
            continue
        if not _path_stays_in_workspace(scene):
            continue
        return Move(number, name, Scene.model_validate(scene.model_dump()))
    raise Infeasible(f"move {number} ({usual.name}, {name}): none of {_MOST_TRIES} can be held")


def _carried(robot: Robot, usual: float) -> float:
    """The largest payload of a robot, kg, if it is the usual one of a robot of this name."""
    return 2 * robot.platform.mass if robot.name == RANDOM else usual


def _path_stays_in_workspace(scene: Scene) -> bool:
    """Whether the path that is given, if any, does, as far as samples show."""
    if scene.path is None:
        return True
    start, goal = scene.given_points
    path = scene.path.between(start, goal)
    places = path(np.linspace(path.knots[0], path.knots[-1], 101))
    alignments = delta_model(scene.robot, scene.payload).alignments(places)
    return bool((alignments > 0).all())  # False where not a number


def random_ends(
    model: DeltaModel, where: Points, rng: np.random.Generator
) -> tuple[Vector3, Vector3] | None:
    """Start and goal, m; None if a batch has too few points."""
    points = points_in_workspace(model, rng, where.least, where.most)
    return farthest_apart(points[: where.farthest_of])
