"""|τ_k + μ θ̇_k| ≤ c for each straight piece of a torque curve: less torque at speed, driving.

A piece from (ω₁, τ₁) to (ω₂, τ₂) lies on the line τ = c - μ ω. A motor that drives forward keeps
τ + μ θ̇ ≤ c, backward -τ - μ θ̇ ≤ c; as the curve is concave, the motor is below the curve if it
is below the lines of all pieces. When it brakes, τ and θ̇ have opposite signs, and rows with c no
less than the peak torque hold by themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from deltaopt.limits.limit import SX, Bounds, Described, Instant, Limit, Numbers


class TorqueCurve(Limit):
    """Largest torque of each motor by its speed, N·m, from the robot's key ``drive.torque_curve``.

    One item for each piece that falls or is below the peak torque: μ in N·m·s/rad and c in N·m.
    """

    name, unit, subject, order = "torque at speed", "N·m", "motor", 2
    powers = (1, 2)
    robot_key = "drive.torque_curve"

    def items(self, scene: Described) -> Sequence[Numbers]:
        curve, peak = scene.robot.drive.torque_curve, max(scene.robot.torque_limits)
        pieces = [_line(*ends) for ends in pairwise(curve or ())]
        return [(mu, c) for mu, c in pieces if mu > 0 or c < peak]

    def bounds(self, numbers: SX) -> Bounds:
        return Bounds.symmetric(numbers[1])

    def measure(self, motion: Instant, numbers: SX) -> SX:
        return motion.tau + numbers[0] * motion.dtheta


def _line(begin: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
    """μ and c of the line τ = c - μ ω through two points (ω, τ), rad/s and N·m."""
    mu = (begin[1] - end[1]) / (end[0] - begin[0])
    return mu, begin[1] + mu * begin[0]
