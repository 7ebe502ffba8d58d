"""A part on a belt, and a goal that changes while the robot is on its way.

When and where the part is met is not known beforehand: both are unknowns of the plan. A motion that
begins moving cannot simply be slowed to keep its limits, for slowing would change how it begins.
"""

from pathlib import Path

import numpy as np

import deltaopt

ROBOT = Path(__file__).parents[1] / "problems/robots/industrial.yaml"
START = (0.85, -0.10, -0.05)  # m


def main():
    planner = deltaopt.Planner(deltaopt.load_robot(ROBOT))
    for speed in (0.0, 0.5, 1.0):
        part = deltaopt.Belt(at=(0.85, 0.05, 0.10), belt=(0.0, 0.0, -speed))
        plan = planner.plan(START, part)
        where = np.array(part.at) + plan.duration * np.array(part.belt)
        print(f"belt at {speed} m/s: met after {plan.duration:.4f} s at {where.round(4)}")

    halfway = plan.trajectory(plan.duration / 2)
    back = planner.plan(halfway, START)  # the part is faulty: back to the start
    stop = planner.stop(halfway)  # or stop
    print(f"from halfway back to the start: {back.duration:.4f} s; to rest: {stop.duration:.4f} s")


if __name__ == "__main__":
    main()
