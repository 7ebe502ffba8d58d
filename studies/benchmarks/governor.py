"""A05, the flyball governor: two stiff springs with strong dampers couple its rods to its slider.

A shaft of 1 m turns freely about the vertical z. Two rods of 1 m hang from its top, 0.1 m apart,
with a ball of 5 kg at each end; a slider of 3 kg moves along the shaft. Rods and shaft are square
bars of 10 mm, the slider a cube of 100 mm, of 3000 kg/m³.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from deltaopt.compare.dynamics.tasks import Array
from deltaopt.dynamics.mechanism import SX, Body, Effort, Mechanism

STIFFNESS, DAMPING, REST = 8e5, 4e4, 0.5
"""Of each coupler, N/m, N·s/m and m."""
BAR, BALL, CUBE = 0.3, 5.0, 3.0
"""Masses, kg."""
LONG, SHORT = BAR * (1 + 0.01**2) / 12, BAR * 0.01**2 / 6
"""Moments of inertia of a bar across and along it, kg·m²."""
SPIN = 2 * np.pi
"""Of everything about the shaft at t = 0, rad/s."""


def governor() -> Mechanism:
    """Return the governor: the shaft's angle, the slider's height s (m), the rods' slopes (rad).

    No constraint is left: a tree, whose loops are closed by springs.
    """
    q, dq = SX.sym("q", 4), SX.sym("dq", 4)
    psi, s, slopes = q[0], q[1], q[2:]
    spin = ca.vertcat(0, 0, dq[0])
    bodies = [
        Body("shaft", BAR, SX([0, 0, 0.5]), SX([LONG, LONG, SHORT]), spin),
        Body("slider", CUBE, ca.vertcat(0, 0, s), SX([CUBE * 0.1**2 / 6] * 3), spin),
    ]
    efforts = []
    for k, side in enumerate((1.0, -1.0)):
        slope, dslope = slopes[k], dq[2 + k]
        outward = side * ca.vertcat(ca.cos(psi), ca.sin(psi), 0)
        rod = ca.cos(slope) * outward - ca.vertcat(0, 0, ca.sin(slope))
        top = 0.05 * outward + SX([0, 0, 1])
        omega = ca.vertcat(-dq[0] * ca.sin(slope), dslope, dq[0] * ca.cos(slope))
        bodies += [
            Body(f"rod {k + 1}", BAR, top + rod / 2, SX([SHORT, LONG, LONG]), omega),
            Body(f"ball {k + 1}", BALL, top + rod),
        ]
        coupler = top + rod / 2 - (0.05 * outward + ca.vertcat(0, 0, s))
        length = ca.norm_2(coupler)
        rate = ca.jtimes(length, q, dq)
        efforts.append(Effort(-STIFFNESS * (length - REST) - DAMPING * rate, rate))
    return Mechanism(
        name="flyball governor",
        q=q,
        dq=dq,
        bodies=tuple(bodies),
        efforts=tuple(efforts),
        gravity=SX([0, 0, -9.81]),
        closed_form=(SX.eye(4), SX(4, 0)),
    )


def start() -> tuple[Array, Array]:
    """Return q, q̇: springs at rest, rods 30° below the horizontal."""
    return np.array([0, 0.5, np.pi / 6, np.pi / 6]), np.array([SPIN, 0, 0, 0])
