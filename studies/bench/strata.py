"""Strata of a campaign: which robots, where the ends of moves lie, and what is asked of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

import numpy as np

from deltaopt.files.validated_record import vector3
from deltaopt.robot.drive import Drive
from deltaopt.robot.robot import Elbow, Forearm, Platform, Robot, UpperArm
from deltaopt.robot.tool import Tool
from studies.bench.changes import (
    Change,
    all_limits,
    among_bodies,
    around_a_sphere,
    as_it_is,
    beside_a_forearm,
    combined,
    falling_torque,
    friction,
    heavy_rotors,
    in_a_tube,
    in_a_workspace,
    joint_ranges,
    kept_from_singularity,
    kept_from_tilt,
    lifted,
    limited,
    little_effort,
    mirrored,
    moving,
    near_points,
    on_a_line,
    on_the_axis,
    over_a_wall,
    range_of_payloads,
    rotated,
    round_a_corner,
    short,
    slow_motors,
    stopping,
    strong_motors,
    through_points,
    to_a_belt,
    torque_that_holds,
    up_and_down,
    with_clearance,
)
from studies.bench.random_scenes import MARGIN

_FARTHEST_OF = 40
"""Of so many random points the two that are farthest apart make a longest move."""

RANDOM = "random"
"""Name of robots of random proportions."""


@dataclass(frozen=True)
class Points:
    """Where the ends of a move lie: between which distances from the nearest singularity, and of
    how many random points the two that are farthest apart are taken."""

    least: float = MARGIN
    most: float = inf
    farthest_of: int = 2


RobotChange = Callable[[Robot, np.random.Generator], Robot]
"""A change of a robot into one of a stratum."""


def same(robot: Robot, rng: np.random.Generator) -> Robot:
    """The robot as it is."""
    return robot


@dataclass(frozen=True)
class Stratum:
    """Moves of one kind: where their ends lie, what is changed of the scene, and of the robot
    before."""

    points: Points
    change: Change = as_it_is
    robot: RobotChange = same


def _random(robot: Robot, rng: np.random.Generator) -> Robot:
    """Any proportions, masses and motors, from a hand's size to two metres."""
    arm = float(10 ** rng.uniform(-1.2, -0.1))
    arm_mass, bars, platform = (arm**2 * rng.uniform([0.0, 0.0, 1.0], [15.0, 8.0, 15.0])).tolist()
    weight = 9.81 * (arm_mass + bars + platform)
    torque = arm * weight * 10 ** rng.uniform(0.3, 1.5) * rng.uniform(0.4, 1.0, size=3)
    return Robot(
        name=RANDOM,
        base_radius=arm * float(rng.uniform(0.0, 1.2)),
        platform_radius=arm * float(rng.uniform(0.0, 0.6)),
        upper_arm=UpperArm(length=arm, mass=arm_mass),
        forearm=Forearm(length=arm * float(rng.uniform(1.3, 3.5)), mass=bars),
        platform=Platform(mass=platform),
        drive=Drive(
            torque=vector3(torque), speed=float(rng.uniform(3, 30)) if rng.uniform() < 0.5 else None
        ),
    )


def _tilted(robot: Robot, rng: np.random.Generator) -> Robot:
    """Gravity in any direction: on a wall, upside down."""
    direction = rng.normal(size=3)
    strength = np.linalg.norm(robot.gravity_vector) / np.linalg.norm(direction)
    return robot.model_copy(update={"gravity": vector3(strength * direction)})


def _with_tool(robot: Robot, rng: np.random.Generator) -> Robot:
    """A tool beside and below the platform's centre."""
    arm = robot.upper_arm.length
    offset = arm * rng.uniform([0.0, -0.3, -0.3], [0.5, 0.3, 0.3])
    tool = Tool(offset=vector3(offset), mass=float(rng.uniform(0.0, 0.5)) * robot.platform.mass)
    return robot.model_copy(update={"tool": tool})


def _unequal(robot: Robot, rng: np.random.Generator) -> Robot:
    """Motors that differ by up to a factor of five."""
    torque = np.multiply(robot.torque_limits, rng.uniform(0.2, 1.0, size=3))
    drive = robot.drive.model_copy(update={"torque": vector3(torque)})
    return robot.model_copy(update={"drive": drive})


def _detailed(robot: Robot, rng: np.random.Generator) -> Robot:
    """Centres of mass and inertias of their own, masses at elbows and pins."""
    length, mass = robot.upper_arm.length, robot.platform.mass
    centre = float(rng.uniform(0.2, 0.6)) * length, float(rng.uniform(-0.1, 0.1)) * length
    inertia = float(rng.uniform(0.02, 0.15)) * robot.upper_arm.mass * length**2
    arm = robot.upper_arm.model_copy(update={"centre": centre, "inertia": inertia})
    elbow, pins = (float(rng.uniform(0.0, 0.3)) * mass for _ in range(2))
    platform = robot.platform.model_copy(update={"pins": pins})
    new = {"upper_arm": arm, "elbow": Elbow(mass=elbow), "platform": platform}
    return robot.model_copy(update=new)


_INSIDE, _EDGE, _BORDER = Points(), Points(0.02, MARGIN), Points(0.005, 0.02)
_LONG_EDGE = Points(0.02, MARGIN, _FARTHEST_OF)

STRATA: dict[str, Stratum] = {
    "inside": Stratum(_INSIDE),
    "edge": Stratum(_EDGE),
    "border": Stratum(_BORDER),
    "brink": Stratum(Points(0.002, 0.005)),
    "longest inside": Stratum(Points(farthest_of=_FARTHEST_OF)),
    "longest edge": Stratum(_LONG_EDGE),
    "longest border": Stratum(Points(0.005, 0.02, _FARTHEST_OF)),
    "weak, 2 % to spare": Stratum(_INSIDE, torque_that_holds(1.02)),
    "weak, 20 % to spare": Stratum(_INSIDE, torque_that_holds(1.2)),
    "weak edge": Stratum(_EDGE, torque_that_holds(1.2)),
    "strong": Stratum(_INSIDE, strong_motors),
    "strong edge": Stratum(_EDGE, strong_motors),
    "slow motors": Stratum(_EDGE, slow_motors),
    "millimetres": Stratum(_INSIDE, short(-2.0, -2.0)),
    "micrometres": Stratum(_EDGE, short(-6.0, -3.0)),
    "on the axis": Stratum(_INSIDE, on_the_axis),
    "mirrored": Stratum(_EDGE, mirrored),
    "random robots": Stratum(_INSIDE, robot=_random),
    "random robots, edge": Stratum(_EDGE, robot=_random),
    "random robots, longest": Stratum(_LONG_EDGE, robot=_random),
    "tilted gravity": Stratum(_EDGE, robot=_tilted),
    "tool": Stratum(_EDGE, robot=_with_tool),
    "unequal motors": Stratum(_EDGE, robot=_unequal),
    "centres and pins": Stratum(_EDGE, robot=_detailed),
    "friction": Stratum(_INSIDE, friction),
    "friction edge": Stratum(_EDGE, friction),
    "heavy rotors": Stratum(_EDGE, heavy_rotors),
    "torque curve": Stratum(_EDGE, falling_torque),
    "range of payloads": Stratum(_INSIDE, range_of_payloads),
    "share of torque": Stratum(_INSIDE, limited(torque="30 %")),
    "platform speed": Stratum(_EDGE, limited(platform_speed=1.0)),
    "acceleration": Stratum(_EDGE, limited(acceleration=30.0)),
    "specific force": Stratum(_EDGE, limited(specific_force=25.0)),
    "kept from singularity": Stratum(_EDGE, kept_from_singularity),
    "all limits": Stratum(_EDGE, all_limits),
    "joint ranges": Stratum(_EDGE, joint_ranges),
    "workspace": Stratum(_EDGE, in_a_workspace),
    "rotation": Stratum(_INSIDE, rotated),
    "effort": Stratum(_INSIDE, little_effort),
    "line": Stratum(_INSIDE, on_a_line),
    "lifted": Stratum(_INSIDE, lifted),
    "corner": Stratum(_EDGE, round_a_corner),
    "tube about a line": Stratum(_INSIDE, in_a_tube(on_a_line)),
    "tube, lifted": Stratum(_INSIDE, in_a_tube(lifted)),
    "via points": Stratum(_INSIDE, through_points),
    "approach": Stratum(_INSIDE, up_and_down),
    "sphere": Stratum(_INSIDE, around_a_sphere),
    "wall": Stratum(_INSIDE, over_a_wall),
    "wall, tool, clearance": Stratum(_INSIDE, combined(over_a_wall, with_clearance)),
    "three bodies": Stratum(_INSIDE, among_bodies),
    "moving ends": Stratum(_INSIDE, moving(0.1)),
    "fast ends": Stratum(_INSIDE, moving(0.4)),
    "stop": Stratum(_INSIDE, stopping),
    "belt": Stratum(_INSIDE, to_a_belt),
    "near via points": Stratum(_INSIDE, near_points),
    "links keep clear": Stratum(_INSIDE, beside_a_forearm),
    "kept from tilt": Stratum(_EDGE, kept_from_tilt),
    "kept from tilt, longest": Stratum(_LONG_EDGE, kept_from_tilt),
}
"""Strata by name."""
