"""A planar five-bar in the vertical plane: two arms, two bars, and a load where the bars meet.

x points down, y sideways. Chain k has its motor at (0, ∓base / 2), its arm at the angle θ_k from
the downward vertical and its bar at φ_k. The six coordinates are q = [x y θ₁ φ₁ θ₂ φ₂], with four
constraints and two motors. Viscous friction acts at the motors' axes.
"""

from __future__ import annotations

import casadi as ca

from deltaopt.dynamics.mechanism import SX, Body, Effort, Mechanism, by_chains

SIDES = (-1.0, 1.0)
"""Sign of y at the motor of each chain."""


BASE, ARM, BAR = 0.12, 0.20, 0.15
"""Distance of the motors, lengths of an arm and a bar, m: all numbers are those of Bordalba et al.
(T-RO 2023)."""
ARM_MASS, BAR_MASS, LOAD = 1.2093, 0.8925, 0.5
"""Masses of an arm, of a bar, and of what hangs where the bars meet, kg."""
ARM_CENTRE, BAR_CENTRE = 0.11, 0.0746
"""Distances of the centres of mass from the upper joint, m."""
ARM_INERTIA, BAR_INERTIA = 7e-3, 2.3e-3
"""Moments of inertia about the centres of mass, kg·m²."""
FRICTION, GRAVITY = 0.0176, 9.81
"""Viscous, at the motors' axes, N·m·s/rad; and m/s²."""


def five_bar() -> Mechanism:
    """The five-bar mechanism; it has no parameters."""
    q, dq, tau = SX.sym("q", 6), SX.sym("dq", 6), SX.sym("tau", 2)
    end = q[:2]
    bodies = [Body("load", LOAD, ca.vertcat(end, 0))]
    efforts, closures = [], []
    for k, side in enumerate(SIDES):
        theta, phi = q[2 + 2 * k], q[3 + 2 * k]
        dtheta, dphi = dq[2 + 2 * k], dq[3 + 2 * k]
        motor = SX([0, side * BASE / 2, 0])
        elbow = motor + ARM * _along(theta)
        bodies += [
            _link(f"arm {k + 1}", ARM_MASS, ARM_INERTIA, motor, ARM_CENTRE, theta, dtheta),
            _link(f"bar {k + 1}", BAR_MASS, BAR_INERTIA, elbow, BAR_CENTRE, phi, dphi),
        ]
        efforts.append(Effort(tau[k] - FRICTION * dtheta, dtheta))
        closures.append(end - (elbow + BAR * _along(phi))[:2])
    holonomic = ca.vertcat(*closures)
    return Mechanism(
        name="five-bar",
        q=q,
        dq=dq,
        bodies=tuple(bodies),
        efforts=tuple(efforts),
        controls=tau,
        holonomic=holonomic,
        gravity=SX([GRAVITY, 0, 0]),
        closed_form=by_chains(ca.jacobian(holonomic, q)),
    )


def inverse_kinematics() -> ca.Function:
    """(end, 2, m; no parameters) -> q, 6, with every elbow on the outer side; NaN out of reach."""
    end, none = SX.sym("end", 2), SX.sym("p", 0)
    angles = []
    for side in SIDES:
        x, y = end[0], end[1] - side * BASE / 2
        distance2 = x**2 + y**2
        dot = (distance2 + ARM**2 - BAR**2) / 2
        cross = ca.sqrt(ARM**2 * distance2 - dot**2)
        theta = ca.atan2(y, x) + side * ca.atan2(cross, dot)
        phi = theta - side * ca.atan2(cross, dot - ARM**2)
        angles += [theta, phi]
    return ca.Function("inverse_kinematics", [end, none], [ca.vertcat(end, *angles)])


def _link(
    name: str, mass: float, inertia: float, joint: SX, centre: float, angle: SX, rate: SX
) -> Body:
    position = joint + centre * _along(angle)
    return Body(name, mass, position, SX([0, 0, inertia]), ca.vertcat(0, 0, rate))


def _along(angle: SX) -> SX:
    return ca.vertcat(ca.cos(angle), ca.sin(angle), 0)
