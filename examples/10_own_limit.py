"""A limit of one's own: the power that all motors together draw from their supply.

A limit is a class that measures a quantity of the motion at an instant and says its bounds. All
else follows from that: derivatives, slowing, the gap, verification.
"""

from pathlib import Path

import casadi as ca

import deltaopt
import deltaopt.scene.known_limits as known
from deltaopt.limits.limit import Bounds, Limit

SCENE = Path(__file__).parents[1] / "problems/industrial_cross.yaml"
SHIPPED = known.LIMITS


class SupplyPower(Limit):
    """Largest mechanical power of all motors together, W."""

    name, unit, subject, order = "supply power", "W", "robot", 2
    powers = (1, 3)  # the torque at rest times the speed, and the torque of the motion times it

    def __init__(self, most):
        self.most = most

    def items(self, scene):
        return [(self.most,)]

    def bounds(self, numbers):
        return Bounds.at_most(numbers)

    def measure(self, motion, numbers):
        return ca.dot(motion.tau, motion.dtheta)


def fed_by(scene, most):
    """The scene with a robot on a supply of so many W. It has a name of its own, for what is known
    of a scene is kept."""
    known.LIMITS = (*SHIPPED, SupplyPower(most))
    robot = scene.robot.model_copy(update={"name": f"{scene.robot.name}, on {most} W"})
    return scene.model_copy(update={"robot": robot})


def drawn(plan):
    """The largest power of all motors together, W."""
    motion = plan.trajectory(plan.trajectory.instants(5000))
    return (motion.tau * motion.dtheta).sum(axis=1).max()


def main():
    scene = deltaopt.load_scene(SCENE)
    plan = deltaopt.plan(scene)
    print(f"no limit: {plan.duration:.4f} s, draws {drawn(plan):.1f} W")
    try:
        for most in (400.0, 250.0):
            plan = deltaopt.plan(fed_by(scene, most))
            report = deltaopt.verify(plan.scene, plan.trajectory)
            print(f"{most} W: {plan.duration:.4f} s, draws {drawn(plan):.1f} W, ok: {report.ok}")
    finally:
        known.LIMITS = SHIPPED


if __name__ == "__main__":
    main()
