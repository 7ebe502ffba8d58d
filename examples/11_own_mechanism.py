"""A mechanism of your own: the slider-crank of an engine, turned at a constant speed.

The second multiplier of its loop closure is the side force between piston and rod."""

import sys

import casadi as ca
import numpy as np
from matplotlib.figure import Figure

from deltaopt.dynamics.mechanism import Body, Effort
from deltaopt.research import Explicit, Mechanism, Partition

CRANK, ROD = 0.04, 0.13  # lengths, m


def setup():
    """The mechanism in crank angle, rod angle and piston position; gravity across the cylinder."""
    q, dq, torque = ca.SX.sym("q", 3), ca.SX.sym("dq", 3), ca.SX.sym("torque")
    pin = CRANK * ca.vertcat(ca.cos(q[0]), ca.sin(q[0]), 0)
    rod = ROD * ca.vertcat(ca.cos(q[1]), ca.sin(q[1]), 0)
    piston = ca.vertcat(q[2], 0, 0)
    inertia, omega = ca.SX([0, 0, 6e-4]), ca.vertcat(0, 0, dq[1])
    bodies = (Body("rod", 0.4, pin + rod / 2, inertia, omega), Body("piston", 0.35, piston))
    closure, motor, gravity = (pin + rod - piston)[:2], Effort(torque, dq[0]), ca.SX([0, -9.81, 0])
    return Mechanism(
        "slider-crank", q, dq, bodies, (motor,), torque, holonomic=closure, gravity=gravity
    )


def one_turn(mechanism, rpm):
    """Crank angle (rad), motor torque (N·m) and side force (N) over one turn."""
    t, rate = ca.SX.sym("t"), rpm * 2 * np.pi / 60
    theta, rod = rate * t, -ca.asin(CRANK / ROD * ca.sin(rate * t))
    q = ca.vertcat(theta, rod, CRANK * ca.cos(theta) + ROD * ca.cos(rod))
    dq = ca.jacobian(q, t)
    inverse = Explicit(Partition((0,))).inverse_dynamics(mechanism)  # the crank is independent
    run = ca.Function("run", [t], [theta, *inverse(t, q, dq, ca.jacobian(dq, t), [])])
    return [np.array(x)[-1] for x in run.map(400)(np.linspace(0, 2 * np.pi / rate, 400))]


def plot(mechanism, path):
    figure = Figure(layout="constrained")
    axes = figure.subplots(2, sharex=True)
    for rpm in (1000, 2000, 3000):
        angle, torque, force = one_turn(mechanism, rpm)
        axes[0].plot(np.degrees(angle), torque)
        axes[1].plot(np.degrees(angle), force, label=f"{rpm} rpm")
    axes[0].set(ylabel="motor torque (N·m)")
    axes[1].set(ylabel="side force (N)", xlabel="crank angle (°)")
    axes[1].legend()
    figure.savefig(path, dpi=150)


def main(path="own_mechanism.png"):
    plot(setup(), path)


if __name__ == "__main__":
    main(*sys.argv[1:])
