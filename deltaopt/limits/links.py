"""d(line) ≥ clearance: the signed distance of the lines of arms and forearms from keep-out bodies.

A link is a capsule: all that is within a radius of the line from shaft to elbow, or from elbow to
the middle of the pins at the platform. Along a line the distance from a convex body is a convex
function, whose least value is where its slope changes sign: bisection finds about where, and one
step of Newton's method then gives that place, and how it moves with the line, to rounding.

Which link keeps clear of which body is numbers, as bodies are. Their count is rounded up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import cos, inf, sin

import casadi as ca

from deltaopt.codegen.vectorised import RowFunction
from deltaopt.limits.keep_out import (
    FAR,
    OF_LIMIT,
    OF_SOLID,
    PLACES,
    Distances,
    distance_from_solid,
    kept_from,
    larger,
    numbers_of_solid,
    positive,
    root,
    where,
)
from deltaopt.limits.limit import (
    SX,
    Described,
    Instant,
    KeptLink,
    Numbers,
    OwnMeasure,
)
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS
from deltaopt.robot.robot import Robot, as_delta

_OF_LINE = 12
"""Numbers of a link's line: which motor turns its arm (3), outwards from the base's axis (2),
whether it is a forearm, radii of base and platform, length of the arm, offset of the tool (3)."""
_BISECTIONS = 12
"""Of a line: its nearest place is then known to a four-thousandth of it, from where one step of
Newton's method leads to rounding. Each is some forty operations for each pair and instant."""
_CLOSELY = 50
"""The same where a motion is looked at and not optimised: to rounding, for the step may lead across
a kink, and inside of a solid there is none."""
_LEAST_BEND = 1e-9
"""Of the squared length: least curvature of the squared distance along a line, where it is beside a
side of a body that it is parallel to, and every place is as near."""


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
        return [
            tuple(
                number
                for each in filled
                for number in (
                    *_of_line(as_delta(scene.robot), each.link),
                    *numbers_of_solid(each.body),
                    *kept_from(scene, each.least),
                )
            )
        ]

    def _size(self, numbers: int) -> int:
        return _OF_LINE + OF_SOLID + OF_LIMIT

    def _distance(self, motion: Instant, own: SX) -> SX:
        begin, end = _ends(motion, own[:_OF_LINE])
        solid = own[_OF_LINE : _OF_LINE + OF_SOLID]
        axes, centre = ca.reshape(solid[:9], 3, 3).T, solid[9:12]
        share = _nearest_share(_Line(axes @ (begin - centre), axes @ (end - begin), solid))
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


@dataclass(frozen=True, eq=False)
class _Line:
    """A line in the axes of a solid: where it begins, its way to its end, and the solid."""

    begin: SX
    way: SX
    solid: SX

    def beyond(self, share: SX) -> tuple[list[SX], list[SX], SX]:
        """At a share of the line: by how much it is beyond the solid's sides, the rates of these
        by the share, and the rate of the first of these rates, which of a cylinder is not
        constant."""
        half, is_round, u, way = self.solid[12:15], self.solid[15], self.begin, self.way
        u = u + share * way
        across = root(u[0] ** 2 + is_round * u[1] ** 2)
        rate = (u[0] * way[0] + is_round * u[1] * way[1]) / across
        bend = (way[0] ** 2 + is_round * way[1] ** 2 - rate**2) / across
        far = across - half[0], (1 - is_round) * ca.fabs(u[1]) - half[1], ca.fabs(u[2]) - half[2]
        rates = [rate, (1 - is_round) * _sign(u[1]) * way[1], _sign(u[2]) * way[2]]
        return list(far), rates, bend

    def slope(self, share: SX) -> SX:
        """A number with the sign of the distance's rate by the share."""
        far, rates, _ = self.beyond(share)
        outside = sum((positive(a) * rate for a, rate in zip(far, rates, strict=True)), SX(0))
        farthest, inside = far[0], rates[0]
        for a, rate in zip(far[1:], rates[1:], strict=True):
            is_farther = farthest < a
            farthest = farthest + where(is_farther, a - farthest)
            inside = inside + where(is_farther, rate - inside)
        is_outside = farthest > 0
        return where(is_outside, outside) + where(ca.logic_not(is_outside), inside)


@lru_cache(maxsize=1)
def nearest_on_line() -> RowFunction:
    """(begin and end of a line, numbers of a solid) -> at which share of the line, from 0 to 1, it
    is nearest to the solid, the signed distance there, m, and the gradient of that, a unit vector.
    """
    begin, end, x = (SX.sym(name, 3) for name in ("begin", "end", "x"))
    solid = SX.sym("solid", OF_SOLID)
    axes, centre = ca.reshape(solid[:9], 3, 3).T, solid[9:12]
    line = _Line(axes @ (begin - centre), axes @ (end - begin), solid)
    share, distance = _nearest_share(line, _CLOSELY), distance_from_solid(x, solid)
    found = ca.substitute(
        [distance, ca.gradient(distance, x)], [x], [begin + share * (end - begin)]
    )
    outputs = [ca.densify(each) for each in (share, *found)]
    return RowFunction(ca.Function("nearest", [begin, end, solid], outputs, {"cse": True}))


def _nearest_share(line: _Line, bisections: int = _BISECTIONS) -> SX:
    """At which share of a line, from 0 to 1, it is nearest to a solid."""
    share, step = SX(0.5), 0.25
    for _ in range(bisections):
        recedes = line.slope(share) > 0
        share = share + step - where(recedes, SX(2 * step))
        step /= 2
    far, rates, bend = line.beyond(share)
    away = [positive(a) for a in far]
    slope = sum((a * rate for a, rate in zip(away, rates, strict=True)), SX(0))
    curvature = sum((where(a > 0, r**2) for a, r in zip(far, rates, strict=True)), away[0] * bend)
    share = share - slope / larger(curvature, _LEAST_BEND * ca.sumsqr(line.way))
    share = positive(share)
    return 1 - positive(1 - share)


def _sign(value: SX) -> SX:
    return where(value > 0, SX(2)) - 1
