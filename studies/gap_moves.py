"""Seeded moves of many robots, in the middle of their workspaces and at the edges.

A move is known by a seed and a number: any part of a campaign can be run again by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from deltaopt import Robot, Scene, load_robot
from deltaopt.errors import Infeasible, Unreachable
from deltaopt.robot.drive import Drive
from deltaopt.robot.model import DeltaModel
from deltaopt.scene.feasibility import check_feasible
from studies.bench.hard_moves import Move, random_ends, robot_of
from studies.bench.random_scenes import MARGIN
from studies.bench.strata import Points
from studies.problems import INDUSTRIAL, ORSINO

INSIDE = "inside"
STRATA = {
    INSIDE: Points(),
    "at the edge": Points(0.02, MARGIN),
    "longest at the edge": Points(0.02, MARGIN, 12),
}
_MOST_TRIES = 200
"""Random moves, or robots, of which none can be driven, before the search ends."""


@dataclass(frozen=True)
class RobotKind:
    """A robot with the payload (kg) that it carries in half of its moves and the speed limit
    (rad/s) that it has in half of its moves."""

    robot: Robot
    payload: float
    speed: float


_SMALL = robot_of("haptic, 0.1 m", (0.037, 0.027), (0.06, 0.103), (0.02, 0.015, 0.05), (0.3, None))
_PACKER = robot_of("packer", (0.2, 0.045), (0.35, 0.8), (1.2, 0.4, 0.4), (90.0, None))
_LARGE = robot_of("large, 2 m", (0.45, 0.1), (0.75, 1.8), (6.0, 4.0, 3.0), (600.0, None))
_WEIGHTLESS = robot_of("weightless", (0.1, 0.05), (0.25, 0.6), (0.3, 0.2, 0.5), (15.0, None), 0.0)
_UNEQUAL = robot_of(
    "unequal motors", (0.15, 0.1), (0.3, 0.55), (0.8, 0.3, 0.4), ((12.0, 30.0, 20.0), None)
)
KINDS = (
    RobotKind(load_robot(ORSINO), 1.0, 12.0),
    RobotKind(load_robot(INDUSTRIAL), 1.0, 10.0),
    RobotKind(_SMALL, 0.05, 30.0),
    RobotKind(_PACKER, 1.0, 12.0),
    RobotKind(_LARGE, 5.0, 6.0),
    RobotKind(_WEIGHTLESS, 1.0, 15.0),
    RobotKind(_UNEQUAL, 1.0, 10.0),
)
"""Both shipped robots, and others of sizes, proportions and drives that differ as much as robots
do. To each seven moves of these comes one of a robot of random proportions."""


def random_kind(rng: np.random.Generator) -> RobotKind:
    """A robot of random proportions, whose motors hold a few times its weight."""
    arm = 10 ** rng.uniform(-1, 0)
    forearm, base = arm * rng.uniform(1.3, 3.5), arm * rng.uniform(0.2, 1.2)
    platform = base * rng.uniform(0.2, 0.9)
    mass = 2 * arm * rng.uniform(0.3, 3)
    masses = (mass * rng.uniform(0.2, 2), mass * rng.uniform(0.1, 1), mass)
    payload = mass * rng.uniform(0.5, 2)
    torque = 9.81 * arm * (sum(masses) + payload) * rng.uniform(1, 6)
    robot = robot_of("random proportions", (base, platform), (arm, forearm), masses, (torque, None))
    return RobotKind(robot, payload, rng.uniform(0.3, 1.0) * float(np.sqrt(60 / arm)))


def stratum_of(number: int) -> str:
    """From where the move of this number is drawn."""
    return list(STRATA)[number // (len(KINDS) + 1) % len(STRATA)]


def move(seed: int, number: int) -> Move:
    """The move of this number. Raises Infeasible if hardly any such move can be driven."""
    rng, stratum = np.random.default_rng([seed, number]), stratum_of(number)
    which, number_of_kind = number % (len(KINDS) + 1), number // (len(KINDS) + 1)
    loaded, limited = number_of_kind // 3 % 2, number_of_kind // 6 % 2
    for _ in range(_MOST_TRIES):
        kind = KINDS[which] if which < len(KINDS) else random_kind(rng)
        payload = kind.payload if loaded else None
        drive = Drive(torque=kind.robot.drive.torque, speed=kind.speed if limited else None)
        robot = kind.robot.model_copy(update={"drive": drive})
        ends = random_ends(DeltaModel(robot, payload), STRATA[stratum], rng)
        if ends is None:
            continue
        scene = Scene(robot=robot, payload=payload, start=ends[0], goal=ends[1])
        try:
            check_feasible(scene)
        except (Unreachable, Infeasible):
            continue
        return Move(number, stratum, scene)
    raise Infeasible(f"move {number}: none of {_MOST_TRIES} in a row can be driven")
