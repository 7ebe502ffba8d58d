"""Closed-form kinematics of the Delta in the industrial assembly mode."""

from __future__ import annotations

from math import cos, sin

import casadi as ca

from deltaopt.dynamics.mechanism import SX
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS, DeltaParameters, in_base


def inverse_kinematics(p: DeltaParameters, x: SX) -> SX:
    """Coordinates q, 12, for the tool's point at x, 3, every elbow on the outer side.

    The tool's point is the platform's centre where a robot has no tool with an offset.

    In the plane of its upper arm a chain is a two-link arm of lengths 2 a₂ and 2 a₃ cos q_{k,3}:
    eq. (50)-(52) are solved for one chain after the other. Results are NaN out of reach.
    """
    centre = p.platform_at(x)
    return ca.vertcat(x, *(_chain_angles(p, azimuth, centre) for azimuth in AZIMUTHS))


def serial_distances(p: DeltaParameters, x: SX) -> SX:
    """Squared distances of the chains from their serial singularities, 3 × 2, without unit, for the
    tool's point at x.

    First column: cos² q_{k,3}, zero where the bars lie sideways. Second: sin² (q_{k,1} - q_{k,2}),
    zero where arm and bars are in line. They are negative out of reach, and the second has no
    meaning where the first is negative.
    """
    rows = []
    for azimuth in AZIMUTHS:
        chain = _Chain(p, azimuth, p.platform_at(x))
        rows.append(ca.horzcat(chain.c3_squared, chain.sine_squared))
    return ca.vertcat(*rows)


def tilts(p: DeltaParameters, x: SX) -> SX:
    """sin q_{k,3} of the three chains, 3: how far bars lean out of the plane of their arm."""
    centre = p.platform_at(x)
    return ca.vertcat(*(_Chain(p, azimuth, centre).s3 for azimuth in AZIMUTHS))


def forward_kinematics(p: DeltaParameters, theta: SX) -> SX:
    """Position x of the tool's point, 3, for the motor angles, 3.

    The platform's centre is the lower of the two points where three spheres of radius 2 a₃ meet,
    whose centres are the elbows moved inwards by a₄. The result is NaN if they do not meet.
    """
    radius = 2 * p.a3
    centres = []
    for k, azimuth in enumerate(AZIMUTHS):
        outward = p.a1 - p.a4 + 2 * p.a2 * ca.cos(theta[k])
        centres.append(in_base(azimuth, -2 * p.a2 * ca.sin(theta[k]), outward, SX(0)))
    # The centre of the circle through the three centres lies on the line of both solutions.
    b, c = centres[1] - centres[0], centres[2] - centres[0]
    normal = ca.cross(b, c)
    n2 = ca.dot(normal, normal)
    to_circumcentre = ca.cross(ca.dot(b, b) * c - ca.dot(c, c) * b, normal) / (2 * n2)
    height = ca.sqrt((radius**2 - ca.dot(to_circumcentre, to_circumcentre)) / n2)
    # x is down: of ±height take the one that adds to x.
    centre = centres[0] + to_circumcentre + ca.sign(normal[0]) * height * normal
    return centre if p.tool is None else centre + p.tool


class _Chain:
    """A chain as a two-link arm in the plane of its upper arm, the platform's centre at x.

    ``outward``, ``up``: position of the lower end of the bars, from the motor's axis.
    """

    def __init__(self, p: DeltaParameters, azimuth: float, x: SX) -> None:
        self.outward = cos(azimuth) * x[1] + sin(azimuth) * x[2] - (p.a1 - p.a4)
        self.up = -x[0]
        self.s3 = (cos(azimuth) * x[2] - sin(azimuth) * x[1]) / (2 * p.a3)
        self.c3_squared = (1 - self.s3) * (1 + self.s3)
        arm2, bars2 = (2 * p.a2) ** 2, (2 * p.a3) ** 2 * self.c3_squared
        self.distance2 = self.outward**2 + self.up**2
        # |E·P| and |E×P| of elbow E and end P: the cosine and sine of the angle at the motor.
        self.dot = (self.distance2 + arm2 - bars2) / 2
        self.cross2 = arm2 * self.distance2 - self.dot**2
        self.cosine = self.dot - arm2
        self.sine_squared = self.cross2 / (arm2 * bars2)


def _chain_angles(p: DeltaParameters, azimuth: float, x: SX) -> SX:
    """q_{k,1}, q_{k,2}, q_{k,3} of one chain."""
    chain = _Chain(p, azimuth, x)
    cross = ca.sqrt(chain.cross2)
    q1 = ca.atan2(
        chain.up * chain.dot + chain.outward * cross, chain.outward * chain.dot - chain.up * cross
    )
    # The angle from arm to bars never crosses the cut of atan2: cross > 0 in this assembly mode.
    q2 = q1 - ca.atan2(cross, chain.cosine)
    return ca.vertcat(q1, q2, ca.asin(chain.s3))
