"""d(line) ≥ clearance: the signed distance of the lines of arms and forearms from keep-out bodies.

A link is a capsule: all that is within a radius of the line from shaft to elbow, or from elbow to
the middle of the pins at the platform.

Which link keeps clear of which body is numbers, as bodies are. Their count is rounded up.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, inf, sin

import casadi as ca

from deltaopt.limits.keep_out import FAR, OF_LIMIT, PLACES, Distances, kept_from
from deltaopt.limits.limit import SX, Described, Instant, KeptLink, Numbers, OwnMeasure
from deltaopt.limits.solid_distance import (
    OF_SOLID,
    distance_from_solid,
    nearest_share,
    numbers_of_solid,
)
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.robot.robot import Robot, as_delta

_OF_LINE = 12
"""Numbers of a link's line: which motor turns its arm (3), outwards from the base's axis (2),
whether it is a forearm, radii of base and platform, length of the arm, offset of the tool (3)."""


class LinkClearance(Distances):
    """Least distance of the lines of arms and forearms from bodies, m, for some pairs of both."""

    name, unit, subject, order = "clearance of links", "m", "arm or forearm", 0
    own_measure = OwnMeasure.LINKS
    slid_along = True

    def items(self, scene: Described) -> Sequence[Numbers]:
        kept = scene.kept_links
        if not kept:
            return []
        places = next(n for n in PLACES if n >= len(kept))
        filled = [*kept, *[KeptLink(0, FAR, -inf)] * (places - len(kept))]
        robot, numbers = as_delta(scene.robot), list[float]()
        for each in filled:
            numbers += _of_line(robot, each.link) + numbers_of_solid(each.body)
            numbers += kept_from(scene, each.least)
        return [tuple(numbers)]

    def _size(self, numbers: int) -> int:
        return _OF_LINE + OF_SOLID + OF_LIMIT

    def _distance(self, motion: Instant, own: SX) -> SX:
        begin, end = _ends(motion, own[:_OF_LINE])
        solid = own[_OF_LINE : _OF_LINE + OF_SOLID]
        share = nearest_share(begin, end, solid)
        return distance_from_solid(begin + share * (end - begin), solid)


def _of_line(robot: Robot, link: int) -> Numbers:
    """A link's line as numbers; links are counted arm 1, forearm 1, arm 2, and so on."""
    chain, is_forearm = divmod(link, 2)
    motor = [float(chain == k) for k in range(3)]
    outwards = cos(AZIMUTHS[chain]), sin(AZIMUTHS[chain])
    lengths = robot.base_radius, robot.platform_radius, robot.upper_arm.length
    return (*motor, *outwards, float(is_forearm), *lengths, *robot.tool_offset)


def _ends(motion: Instant, own: SX) -> tuple[SX, SX]:
    """Where a link's line begins and ends, 3 each, m."""
    outwards, is_forearm = ca.vertcat(0, own[3:5]), own[5]
    base, platform, arm = ca.vertsplit(own[6:9])
    theta = ca.dot(own[:3], motion.theta)
    shaft = base * outwards
    elbow = shaft + arm * (ca.cos(theta) * outwards - ca.vertcat(ca.sin(theta), 0, 0))
    pins = motion.x - own[9:12] + platform * outwards
    begin = shaft + is_forearm * (elbow - shaft)
    return begin, elbow + is_forearm * (pins - elbow)
