"""A cell whose z points up, in millimetres: its points, velocities and boxes in the robot's frame.

The origin of deltaopt's frame is in the middle of the base, at the height of the motors' axes; x
points down and y towards motor 1. So a height above the floor becomes a depth below the motors, and
the cell is turned until its X is where motor 1 is. Y changes its sign, for a frame turned upside
down is else a mirror image.
"""

from math import cos, radians, sin
from pathlib import Path

import deltaopt

ROBOT = Path(__file__).parents[1] / "problems/robots/hornet_565.yaml"
MOTORS_ABOVE_FLOOR = 1500.0  # mm
MOTOR_1 = 0.0  # degrees from X, counter-clockwise from above


def direction(X, Y, Z):
    """A displacement or a velocity of the cell, mm or mm/s, in the robot's frame, m or m/s."""
    c, s = cos(radians(MOTOR_1)), sin(radians(MOTOR_1))
    return (-Z / 1e3, (c * X + s * Y) / 1e3, (s * X - c * Y) / 1e3)


def point(X, Y, Z):
    """A point of the cell, mm, in the robot's frame, m."""
    return direction(X, Y, Z - MOTORS_ABOVE_FLOOR)


def box(corner, opposite):
    """A box of the cell, mm, as a body. It stays a box where MOTOR_1 is a multiple of 90."""
    a, b = point(*corner), point(*opposite)
    return {"box": {"from": tuple(map(min, a, b)), "to": tuple(map(max, a, b))}}


def main():
    scene = deltaopt.Scene(
        robot=deltaopt.load_robot(ROBOT),
        payload=1.0,
        start=point(-150, 40, 700),
        goal=point(150, 40, 700),
        keep_out=[box((-20, -300, 0), (20, 300, 740))],
        tool={"radius": 0.02},
    )
    plan = deltaopt.plan(scene)
    depths = plan.trajectory(plan.trajectory.instants(500)).x[:, 0]
    highest = MOTORS_ABOVE_FLOOR - 1e3 * depths.min()
    print(f"pick at {scene.start} m in the robot's frame")
    print(f"{plan.duration:.4f} s, up to {highest:.0f} mm above the floor")
    return plan


if __name__ == "__main__":
    main()
