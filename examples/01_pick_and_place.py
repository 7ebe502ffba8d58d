"""The fastest pick-and-place move, from scene file to picture.

Why this is difficult: in minimum time nearly every motor is at its upper or lower limit nearly
all the time ("bang-bang"). Torques then jump at instants that are not known beforehand. Between the
points of a mesh, where the optimiser imposes no limits, a smooth motion exceeds the limits that it
keeps at the points. So a plan is checked between its points too and slowed until it keeps every
limit; what slowing costs is part of the gap it reports. Verification then starts from the motion
alone: its torques are integrated by code that the planner does not use.
"""

import sys
from pathlib import Path

import deltaopt
from deltaopt.plots.plan import draw

SCENE = Path(__file__).parents[1] / "problems/pick_and_place.yaml"


def setup():
    """Read the scene: the robot, its payload, start and goal, and the limits."""
    return deltaopt.load_scene(SCENE)


def solve(scene):
    """Plan the fastest motion and verify it; stop if verification fails."""
    plan = deltaopt.plan(scene, progress=print)
    report = deltaopt.verify(scene, plan.trajectory)
    print(f"straight line {deltaopt.baseline(scene).duration:.4f} s, plan {plan.duration:.4f} s")
    print(f"largest torque: {1 + report.torque_excess:.7%} of its limit")
    print(f"its torques lead to {report.arrival_distance:.0e} m from the goal")
    if not report.ok:
        raise SystemExit("\n".join(report.failures()))
    return plan


def plot(plan, path):
    """Draw torques between their limits, motor speeds, and the path."""
    draw(Path(path), plan.scene, plan.trajectory)


def main(path="pick_and_place.png"):
    plot(solve(setup()), path)


if __name__ == "__main__":
    main(*sys.argv[1:])
