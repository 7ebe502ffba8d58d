"""Ranges of the joints: θ_least ≤ θ_k ≤ θ_most, where the arms' stops, cables or software ends are,
and |q_{k,3}| ≤ β_max, how far ball joints let the bars lean out of the plane of their arm."""

from __future__ import annotations

import casadi as ca

from deltaopt.limits.limit import SX, Bounds, Instant, Limit
from deltaopt.limits.norms_and_ranges import Range


def _theta(motion: Instant) -> SX:
    return motion.theta


ARM_RANGE = Range("arm angle", "rad", "motor", _theta, "joints.arm")
"""Least and largest angle of each arm."""


class BallJoint(Limit):
    """Largest angle of the ball joints of each chain, rad, from the robot's key ``joints.ball``."""

    name, unit, subject, order = "ball joint angle", "rad", "chain", 0
    robot_key = "joints.ball"

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.symmetric(numbers)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return ca.asin(motion.tilt)

    def rows(self, motion: Instant, numbers: SX) -> SX:
        return motion.tilt / ca.sin(numbers)  # of the platform's position it is linear
