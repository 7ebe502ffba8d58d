"""The spherical pendulum of section 2: a thin bar on a base that moves up and down.

Coordinates q = [x y z θ φ]: the tip P, the angle of the bar with the Z axis, and that of
its projection on OXY with the Y axis. The base is at (0, 0, ζ(t)).

The paper leaves two things open. "Rigid thin bar" is read as a uniform slender one: mass
at mid-length, m l²/12 across and nothing about its axis. Z points down, so that the bar
hangs at θ = 0 under a positive g.
"""

from __future__ import annotations

from collections.abc import Callable

import casadi as ca

from deltaopt.dynamics.mechanism import SX, Body, Effort, Mechanism


def spherical_pendulum(length: float, mass: float, g: float, zeta: Callable[[SX], SX]) -> Mechanism:
    """The pendulum of ``length`` (m) and ``mass`` (kg) whose base is at z = ``zeta(t)``, m.

    ``zeta`` makes an expression from the symbol t. The controls are the torques (N·m) conjugate to
    the speeds ψ̇ = cos θ φ̇ and θ̇; without motors they are zero.
    """
    t, q, dq, tau = SX.sym("t"), SX.sym("q", 5), SX.sym("dq", 5), SX.sym("tau", 2)
    tip, theta, phi = q[:3], q[3], q[4]
    dtheta, dphi = dq[3], dq[4]
    base = ca.vertcat(0, 0, zeta(t))
    along = ca.vertcat(ca.sin(theta) * ca.sin(phi), ca.sin(theta) * ca.cos(phi), ca.cos(theta))
    across = mass * length**2 / 12
    bar = Body(
        name="bar",
        mass=mass,
        position=(base + tip) / 2,  # in the tip's coordinates: λ is the force on the tip
        inertia=SX([across, across, 0]),
        angular_velocity=ca.vertcat(-dtheta, dphi * ca.sin(theta), -dphi * ca.cos(theta)),
    )
    return Mechanism(
        name="spherical pendulum",
        q=q,
        dq=dq,
        bodies=(bar,),
        efforts=(Effort(tau[0], ca.cos(theta) * dphi), Effort(tau[1], dtheta)),
        controls=tau,
        holonomic=tip - length * along - base,  # eq. (9)
        gravity=SX([0, 0, g]),
        time=t,
        closed_form=_closed_form(length, theta, phi),
    )


def _closed_form(length: float, theta: SX, phi: SX) -> tuple[SX, SX]:
    """C of eq. (11) for the non-exact δψ = cos θ δφ and δθ; P moves the tip alone."""
    sin, cos, tan = ca.sin, ca.cos, ca.tan
    by_psi = ca.vertcat(
        length * tan(theta) * cos(phi), -length * tan(theta) * sin(phi), 0, 0, 1 / cos(theta)
    )
    by_theta = ca.vertcat(
        length * cos(theta) * sin(phi), length * cos(theta) * cos(phi), -length * sin(theta), 1, 0
    )
    return ca.horzcat(by_psi, by_theta), ca.vertcat(SX.eye(3), SX(2, 3))
