"""How near arms and forearms come to keep-out bodies, by samples of a motion.

Arms and pairs of bars are taken as lines, for no robot file says how thick they are. The distance
from a convex body is a convex function along a line, whose least value golden sections find.
"""

from __future__ import annotations

import numpy as np

from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.motion.trajectory import Array, Trajectory
from deltaopt.robot.robot import Robot
from deltaopt.robot.solids import Convex
from deltaopt.scene.bodies import sums
from deltaopt.scene.scene import Scene
from deltaopt.verify.clearance import distance_from

_FRACTIONS = np.linspace(0.0, 1.0, 5)
"""Of every interval, where the robot is looked at."""
_SECTIONS = 32
"""Of a line: a place is then known to 2e-7 of it."""
_GOLDEN = (5**0.5 - 1) / 2


def robot_clearance(scene: Scene, trajectory: Trajectory) -> float | None:
    """The least distance of arms and forearms from the bodies of a scene, m, negative inside of
    one; None if there are no bodies."""
    if scene.keep_out is None:
        return None
    motion = trajectory.inside_intervals(_FRACTIONS)
    begins, ends = _lines(scene.robot, motion.x, motion.theta)
    return min(_least(body, begins, ends) for _, body in sums(scene.keep_out, None))


def _lines(robot: Robot, x: Array, theta: Array) -> tuple[Array, Array]:
    """Where the lines of all arms and forearms begin and end at N instants, (6 N, 3) each, m."""
    centre = x - np.array(robot.tool_offset)
    begins, ends = [], []
    for k, azimuth in enumerate(AZIMUTHS):
        outwards = np.array([0.0, np.cos(azimuth), np.sin(azimuth)])
        shaft = np.broadcast_to(robot.base_radius * outwards, x.shape)
        along = np.cos(theta[:, k, None]) * outwards
        along[:, 0] -= np.sin(theta[:, k])
        elbow = shaft + robot.upper_arm.length * along
        begins += [shaft, elbow]
        ends += [elbow, centre + robot.platform_radius * outwards]
    return np.vstack(begins), np.vstack(ends)


def _least(body: Convex, begins: Array, ends: Array) -> float:
    """The least distance of lines from a body, m."""

    def at(share: Array) -> Array:
        distance, _ = distance_from(body, begins + share[:, None] * (ends - begins))
        return distance

    low, high = np.zeros(len(begins)), np.ones(len(begins))
    for _ in range(_SECTIONS):
        width = _GOLDEN * (high - low)
        one, other = high - width, low + width
        nearer = at(one) < at(other)
        low, high = np.where(nearer, low, one), np.where(nearer, other, high)
    return float(at((low + high) / 2).min())
