"""How much time a wall costs, by its height.

A path that is given, up, across and down, costs the same whatever stands there. Where the planner
knows the wall instead, a low wall costs little: the fastest motion between two points is no
straight line anyway.
"""

from pathlib import Path

import deltaopt

ROBOT = Path(__file__).parents[1] / "problems/robots/industrial.yaml"
START, GOAL = (0.85, -0.1525, 0.0), (0.85, 0.1525, 0.0)  # m, x down


def move(robot, height):
    """The move over a wall of this height above start and goal, m; 0 for none."""
    wall = {"box": {"from": (0.85 - height, -0.01, -0.5), "to": (1.5, 0.01, 0.5)}}
    bodies = [wall] if height else None
    return deltaopt.Scene(robot=robot, payload=1.0, start=START, goal=GOAL, keep_out=bodies)


def main():
    robot = deltaopt.load_robot(ROBOT)
    for height in (0.0, 0.025, 0.05, 0.1):
        plan = deltaopt.plan(move(robot, height))
        report = deltaopt.verify(plan.scene, plan.trajectory)
        print(f"{1e3 * height:3.0f} mm: {plan.duration:.4f} s, verified: {report.ok}")


if __name__ == "__main__":
    main()
