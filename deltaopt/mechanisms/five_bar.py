"""A planar five-bar in the vertical plane: two arms, two bars, and a load where the bars meet.

x points down, y sideways. Chain k has its motor at (0, ∓base / 2), its arm at the angle θ_k from
the downward vertical and its bar at φ_k. The six coordinates are q = [x y θ₁ φ₁ θ₂ φ₂], with four
constraints and two motors. Viscous friction acts at the motors' axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from deltaopt.dynamics.mechanism import SX, Body, Effort, Mechanism, by_chains

SIDES = (-1.0, 1.0)
"""Sign of y at the motor of each chain."""


@dataclass(frozen=True)
class FiveBarParameters:
    """The parameters of a five-bar; the defaults are those of Bordalba et al. (T-RO 2023).

    Lengths, and distances of the centres of mass from the upper joint, in m; masses in kg; moments
    of inertia about the centres of mass in kg·m²; friction in N·m·s/rad; g in m/s².
    """

    base: float = 0.12
    arm: float = 0.20
    bar: float = 0.15
    arm_mass: float = 1.2093
    bar_mass: float = 0.8925
    arm_centre: float = 0.11
    bar_centre: float = 0.0746
    arm_inertia: float = 7e-3
    bar_inertia: float = 2.3e-3
    load: float = 0.5
    friction: float = 0.0176
    g: float = 9.81


def five_bar(p: FiveBarParameters) -> Mechanism:
    """The five-bar mechanism with these parameters as numbers."""
    q, dq, tau = SX.sym("q", 6), SX.sym("dq", 6), SX.sym("tau", 2)
    end = q[:2]
    bodies = [Body("load", p.load, ca.vertcat(end, 0))]
    efforts, closures = [], []
    for k, side in enumerate(SIDES):
        theta, phi = q[2 + 2 * k], q[3 + 2 * k]
        dtheta, dphi = dq[2 + 2 * k], dq[3 + 2 * k]
        motor = SX([0, side * p.base / 2, 0])
        elbow = motor + p.arm * _along(theta)
        bodies += [
            _link(f"arm {k + 1}", p.arm_mass, p.arm_inertia, motor, p.arm_centre, theta, dtheta),
            _link(f"bar {k + 1}", p.bar_mass, p.bar_inertia, elbow, p.bar_centre, phi, dphi),
        ]
        efforts.append(Effort(tau[k] - p.friction * dtheta, dtheta))
        closures.append(end - (elbow + p.bar * _along(phi))[:2])
    holonomic = ca.vertcat(*closures)
    return Mechanism(
        name="five-bar",
        q=q,
        dq=dq,
        bodies=tuple(bodies),
        efforts=tuple(efforts),
        controls=tau,
        holonomic=holonomic,
        gravity=SX([p.g, 0, 0]),
        closed_form=by_chains(ca.jacobian(holonomic, q)),
    )


def inverse_kinematics(p: FiveBarParameters) -> ca.Function:
    """(end, 2, m; no parameters) -> q, 6, with every elbow on the outer side; NaN out of reach."""
    end, none = SX.sym("end", 2), SX.sym("p", 0)
    angles = []
    for side in SIDES:
        x, y = end[0], end[1] - side * p.base / 2
        distance2 = x**2 + y**2
        dot = (distance2 + p.arm**2 - p.bar**2) / 2
        cross = ca.sqrt(p.arm**2 * distance2 - dot**2)
        theta = ca.atan2(y, x) + side * ca.atan2(cross, dot)
        phi = theta - side * ca.atan2(cross, dot - p.arm**2)
        angles += [theta, phi]
    return ca.Function("inverse_kinematics", [end, none], [ca.vertcat(end, *angles)])


def _link(
    name: str, mass: float, inertia: float, joint: SX, centre: float, angle: SX, rate: SX
) -> Body:
    position = joint + centre * _along(angle)
    return Body(name, mass, position, SX([0, 0, inertia]), ca.vertcat(0, 0, rate))


def _along(angle: SX) -> SX:
    return ca.vertcat(ca.cos(angle), ca.sin(angle), 0)
