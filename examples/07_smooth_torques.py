"""Torques that a drive can follow: a limit, or a little more time.

The fastest motion jumps from full torque to full torque, and no drive does that. A limit of the
torque rate is for what must not be exceeded; one per cent more time, spent on the least torque
rates, is for frames that ring.
"""

from pathlib import Path

import numpy as np

import deltaopt

SCENE = Path(__file__).parents[1] / "problems/industrial_cross.yaml"


def usual_rate(trajectory):
    """The root of the mean square of the motors' torque rates, kN·m/s."""
    t = np.linspace(0.0, trajectory.duration, 20001)[1:-1]
    rates = np.diff(trajectory(t).tau, axis=0) / np.diff(t)[:, None]
    return np.sqrt((rates**2).sum(axis=1).mean()) / 1e3


def main():
    fastest = deltaopt.load_scene(SCENE)
    limited = fastest.model_copy(update={"limits": deltaopt.Limits(torque_rate=5000.0)})
    eased = fastest.model_copy(update={"objective": deltaopt.SmoothTorque(of_fastest=1.01)})
    plans = {"fastest": fastest, "40 N·m in 8 ms": limited, "1 % more time": eased}
    for name, scene in plans.items():
        plan = deltaopt.plan(scene)
        rate = usual_rate(plan.trajectory)
        print(f"{name:15} {plan.duration:.4f} s, torque rates {rate:6.1f} kN·m/s (RMS)")


if __name__ == "__main__":
    main()
