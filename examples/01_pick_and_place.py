"""The fastest pick-and-place move, from scene file to picture.

Why this is difficult: in minimum time nearly every motor is at its limit nearly all the time,
one way or the other ("bang-bang"). Torques then jump at instants nobody knows beforehand, and
between the points of a mesh, where an optimiser does not look, a smooth motion overshoots the
limits it seems to keep. So a plan is measured between its points too, slowed until it keeps
every limit, and the price of slowing is part of the gap it reports. Verification then starts
from the motion alone: its torques are integrated by code the planner does not share.
"""

import sys
from pathlib import Path

import deltaopt
from deltaopt.plots.plan import draw

SCENE = Path(__file__).parents[1] / "problems/pick_and_place.yaml"


def setup():
    """What is to be moved, from where to where, with which motors."""
    return deltaopt.load_scene(SCENE)


def solve(scene):
    """The fastest motion, once it is verified."""
    plan = deltaopt.plan(scene, progress=print)
    report = deltaopt.verify(scene, plan.trajectory)
    print(f"straight line {deltaopt.baseline(scene).duration:.4f} s, plan {plan.duration:.4f} s")
    print(f"largest torque: {1 + report.torque_excess:.7%} of its limit")
    print(f"its torques lead to {report.arrival_distance:.0e} m from the goal")
    if not report.ok:
        raise SystemExit("\n".join(report.failures()))
    return plan


def plot(plan, path):
    """Torques against their limits, motor speeds, and the path."""
    draw(Path(path), plan.scene, plan.trajectory)


def main(path="pick_and_place.png"):
    plot(solve(setup()), path)


if __name__ == "__main__":
    main(*sys.argv[1:])
