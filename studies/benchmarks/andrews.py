"""A03, Andrews' squeezer: seven bodies in a plane within 0.1 m, driven by a torque to 10,000 rpm.

Letters and numbers are those of Hairer and Wanner, *Solving Ordinary Differential Equations II*,
section VII.7, which the test set for initial value problems uses too. One degree of freedom.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics import (
    Multiplier,
)
from deltaopt.dynamics.mechanism import SX, Body, Effort, Mechanism
from studies.simulation import (
    Gauss,
    NoStabilisation,
    simulate,
)

D, DA, E, EA = 28e-3, 115e-4, 2e-2, 1421e-5
RR, RA, SS, SA, SB, SC, SD = 7e-3, 92e-5, 35e-3, 1874e-5, 1043e-5, 18e-3, 2e-2
TA, TB, U, UA, UB, ZF, ZT, FA = 2308e-5, 916e-5, 4e-2, 1228e-5, 449e-5, 2e-2, 4e-2, 1421e-5
A, B, C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)
STIFFNESS, REST = 4530.0, 7785e-5
"""Of the spring, N/m and m."""
TORQUE = 0.033
"""Of the motor, N·m."""
MASSES = (0.04325, 0.00365, 0.02373, 0.00706, 0.0705, 0.00706, 0.05498)
INERTIAS = (2.194e-6, 4.41e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5)
START = (
    -0.0617138900142764496,
    0.0,
    0.455279819163070380,
    0.222668390165885885,
    0.487364979543842551,
    -0.222668390165885885,
    1.23054744454982119,
)
"""β, Θ, γ, Φ, δ, Ω, ε at t = 0, rad; at rest."""


def andrews_squeezer() -> Mechanism:
    """Return the squeezer in its seven angles, six constraints, one motor on β."""
    q, dq, torque = SX.sym("q", 7), SX.sym("dq", 7), SX.sym("torque")
    beta, theta, gamma, phi, delta, omega, epsilon = ca.vertsplit(q)
    turning = (dq[0], dq[0] + dq[1], dq[2], dq[3] + dq[4], dq[4], dq[5] + dq[6], dq[6])
    a, b = SX(A), SX(B)
    F = RR * _along(beta)
    point = F - D * _along(beta + theta)
    centres = (
        RA * _along(beta),
        F - DA * _along(beta + theta),
        b + SA * _across(gamma) + SB * _along(gamma),
        a + ZT * _along(delta) + (E - EA) * _across(phi + delta),
        a + TA * _along(delta) + TB * -_across(delta),
        a + U * _across(epsilon) + (ZF - FA) * _along(omega + epsilon),
        a + UA * _across(epsilon) - UB * _along(epsilon),
    )
    bodies = tuple(
        Body(f"K{i + 1}", m, ca.vertcat(r, 0), SX([0, 0, J]), ca.vertcat(0, 0, w))
        for i, (m, r, J, w) in enumerate(zip(MASSES, centres, INERTIAS, turning, strict=True))
    )
    closures = (
        b + SS * _across(gamma),
        a + ZT * _along(delta) + E * _across(phi + delta),
        a + U * _across(epsilon) + ZF * _along(omega + epsilon),
    )
    spring = ca.norm_2(b + SC * _across(gamma) + SD * _along(gamma) - SX(C)) - REST
    return Mechanism(
        name="Andrews' squeezer",
        q=q,
        dq=dq,
        bodies=bodies,
        efforts=(Effort(torque, dq[0]),),
        controls=torque,
        holonomic=ca.vertcat(*(point - closure for closure in closures)),
        potential=STIFFNESS / 2 * spring**2,
    )


def start() -> tuple[Array, Array]:
    """Return q, q̇."""
    return np.array(START), np.zeros(7)


def by_gauss(times: Array) -> Array:
    """Return the angles at the times, N × 7, by Gauss's method of order 8 with steps of 0.05 ms."""
    return simulate(
        andrews_squeezer(),
        Multiplier(),
        *start(),
        times,
        controls=[TORQUE],
        stabilisation=NoStabilisation(),
        integrator=Gauss(5e-5, stages=4),
        tolerance=1e-11,
    ).q


def _along(angle: SX) -> SX:
    return ca.vertcat(ca.cos(angle), ca.sin(angle))


def _across(angle: SX) -> SX:
    return ca.vertcat(ca.sin(angle), -ca.cos(angle))
