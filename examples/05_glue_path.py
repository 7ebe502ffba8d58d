"""A bead of glue along a curve of one's own: three quarters of a circle, timed optimally.

The curve is given as a function with its first two derivatives. The motors then allow a speed that
changes along it; how much slower a constant speed would be is what the timing saves.
"""

from math import pi
from pathlib import Path

import numpy as np

import deltaopt

ROBOT = Path(__file__).parents[1] / "problems/robots/orsino.yaml"
CENTRE, RADIUS = np.array([0.45, 0.0, 0.0]), 0.06  # m


def circle(angle, order):
    """The point, or its first or second derivative by the angle, (N,) -> (N, 3)."""
    turned = angle + order * pi / 2
    ring = np.stack([0 * angle, np.cos(turned), np.sin(turned)], axis=-1)
    return (CENTRE if order == 0 else 0.0) + RADIUS * ring


def main():
    curve = deltaopt.Curve.of(circle, 0.0, 1.5 * pi)
    scene = deltaopt.Scene(
        robot=deltaopt.load_robot(ROBOT),
        payload=0.5,
        start=curve.x[0],
        goal=curve.x[-1],
        path=curve,
    )
    plan = deltaopt.plan(scene)
    motion = plan.trajectory(plan.trajectory.instants(1000))
    off = np.abs(np.linalg.norm(motion.x - CENTRE, axis=1) - RADIUS).max()
    speeds = np.linalg.norm(motion.v, axis=1)
    print(f"{plan.duration:.4f} s, at most {speeds.max():.2f} m/s, {off:.0e} m off the circle")
    return plan


if __name__ == "__main__":
    main()
