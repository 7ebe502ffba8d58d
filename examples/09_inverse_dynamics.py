"""Torques along a straight line by two models of the paper, its section 5.3.

Why two: eq. (37), model L_I, keeps the forces of the chains as nine multipliers and solves for
twelve unknowns at once. Eq. (39), model L_E, is projected by C of eq. (55), so that only the three
torques are unknown. Both follow from the same energies, so that any difference is rounding: the
second panel shows it, in units of the largest torque.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import deltaopt

ROBOT = Path(__file__).parents[1] / "problems/robots/orsino.yaml"
START, GOAL = (0.45, 0.0, 0.0), (0.50, 0.06, 0.08)  # m; the paper does not print its own


def setup(duration=0.5):
    """The motion on a line, at rest and without acceleration at both ends, as in Fig. 4."""
    robot = deltaopt.load_robot(ROBOT)
    line = deltaopt.baseline(deltaopt.Scene(robot=robot, payload=1.0, start=START, goal=GOAL))
    return line.slowed(duration / line.duration)


def torques(line):
    """Times, (N,), and torques by L_E and L_I, (N, 3) each."""
    motion = line(np.linspace(0, line.duration, 501))
    robot, payload = line.model.robot, line.model.payload
    models = (
        deltaopt.DeltaModel(robot, payload, formulation)
        for formulation in (deltaopt.explicit, deltaopt.multiplier)
    )
    return motion.t, *(model.inverse_dynamics(motion.x, motion.v, motion.a) for model in models)


def plot(t, explicit, multiplier, path):
    figure = Figure(layout="constrained")
    above, below = figure.subplots(2, sharex=True, height_ratios=[2, 1])
    for k in range(3):
        (curve,) = above.plot(t, explicit[:, k], label=f"motor {k + 1}")
        above.plot(t[::25], multiplier[::25, k], "o", mfc="none", color=curve.get_color())
        below.plot(t, (explicit - multiplier)[:, k] / np.abs(explicit).max(), linewidth=0.7)
    above.set(ylabel="torque (N·m)", title="lines: $L_E$, circles: $L_I$")
    below.set(ylabel="relative difference", xlabel="time (s)")
    figure.legend(loc="outside right upper")
    figure.savefig(path, dpi=150)


def main(path="inverse_dynamics.png"):
    t, explicit, multiplier = torques(setup())
    difference = np.abs(explicit - multiplier).max() / np.abs(explicit).max()
    print(
        f"largest torque {np.abs(explicit).max():.4f} N·m, L_E and L_I differ by {difference:.0e}"
    )
    plot(t, explicit, multiplier, path)


if __name__ == "__main__":
    main(*sys.argv[1:])
