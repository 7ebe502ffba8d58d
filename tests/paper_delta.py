"""Sections 4 and 5 of the paper typed in as printed, and states of the Delta to try them on.

Nothing here comes from the package but the record of parameters: q and q̇ are arrays of 12
numbers, τ of 3, and indices start at 0 where the paper's start at 1.
"""

import json
from dataclasses import dataclass
from math import cos, pi, sin
from pathlib import Path

import numpy as np

from deltaopt.mechanisms.delta.mechanism import DeltaParameters

PHI = (0.0, 2 * pi / 3, -2 * pi / 3)
DATA = Path(__file__).parent / "data"


@dataclass(frozen=True)
class Reference:
    """Rows of the reference data: see tests/data/README.md."""

    p: DeltaParameters
    rows: dict[str, np.ndarray]

    def __getattr__(self, name):
        return self.rows[name]


def reference(name):
    """``delta_paper`` (slender bars) or ``delta_general_inertia``."""
    with np.load(DATA / f"{name}.npz") as file:
        rows = {key: file[key] for key in file.files}
    p = json.loads(str(rows.pop("params")))
    p.setdefault("I33", p["m3"] * p["a2"] ** 2 / 3)  # slender bars of length 2 a2 and 2 a3
    p.setdefault("I41", p["m4"] * p["a3"] ** 2 / 3)
    p.setdefault("I43", p["m4"] * p["a3"] ** 2 / 3)
    return Reference(DeltaParameters(**p), rows)


def values(p):
    """The numbers of the terms that are present, in the order of ``Mechanism.parameters``."""
    return [float(getattr(p, name)) for name in p.named()]


def name(formulation):
    """What a test with this formulation is called."""
    parts = [type(formulation).__name__]
    parts += [str(v) for k, v in vars(formulation).items() if k == "constraint_matrix"]
    return "-".join(parts)


def inverse_kinematics(p, x):
    """q of the industrial assembly mode, elbows outward, at the platform centre x."""
    q = np.empty(12)
    q[:3] = x
    for k, phi in enumerate(PHI):
        down = x[0]
        outward = cos(phi) * x[1] + sin(phi) * x[2] - (p.a1 - p.a4)
        sideways = -sin(phi) * x[1] + cos(phi) * x[2]
        q3 = np.arcsin(sideways / (2 * p.a3))
        arm, bars, reach = 2 * p.a2, 2 * p.a3 * cos(q3), np.hypot(down, outward)
        bend = np.arccos((arm**2 + reach**2 - bars**2) / (2 * arm * reach))
        q1 = np.arctan2(-down, outward) + bend
        q2 = np.arctan2(-down - arm * sin(q1), outward - arm * cos(q1))
        q[3 + 3 * k : 6 + 3 * k] = q1, q2, q3
    return q


def constraints(p, q):
    """Eq. (50)-(52)."""
    f = []
    for k, phi in enumerate(PHI):
        q1, q2, q3 = q[3 + 3 * k : 6 + 3 * k]
        outward = p.a1 - p.a4 + 2 * p.a2 * cos(q1) + 2 * p.a3 * cos(q2) * cos(q3)
        f += [
            q[0] + 2 * p.a2 * sin(q1) + 2 * p.a3 * cos(q3) * sin(q2),
            q[1] + 2 * sin(phi) * p.a3 * sin(q3) - cos(phi) * outward,
            q[2] - 2 * cos(phi) * p.a3 * sin(q3) - sin(phi) * outward,
        ]
    return np.array(f)


def jacobian_block(p, q, k):
    """J⁽ᵏ⁾, eq. (54)."""
    a2, a3 = p.a2, p.a3
    c1, c2, c3 = np.cos(q[3 + 3 * k : 6 + 3 * k])
    s1, s2, s3 = np.sin(q[3 + 3 * k : 6 + 3 * k])
    c, s = cos(PHI[k]), sin(PHI[k])
    return np.array(
        [
            [2 * a2 * c1, 2 * a3 * c2 * c3, -2 * a3 * s2 * s3],
            [2 * c * a2 * s1, 2 * c * a3 * c3 * s2, 2 * s * a3 * c3 + 2 * c * a3 * c2 * s3],
            [2 * s * a2 * s1, 2 * s * a3 * c3 * s2, -2 * c * a3 * c3 + 2 * s * a3 * c2 * s3],
        ]
    )


def jacobian(p, q):
    """J, eq. (53)."""
    J = np.zeros((9, 12))
    for k in range(3):
        J[3 * k : 3 * k + 3, :3] = np.eye(3)
        J[3 * k : 3 * k + 3, 3 + 3 * k : 6 + 3 * k] = jacobian_block(p, q, k)
    return J


def constraint_matrix(p, q):
    """C, eq. (55)."""
    return np.vstack([np.eye(3), *(-np.linalg.inv(jacobian_block(p, q, k)) for k in range(3))])


def velocities(p, q, dq):
    """v* of platform, payload, arm 1, bars 1, arm 2, ... eq. (56)-(59)."""
    a2, a3, v = p.a2, p.a3, [dq[:3], dq[:3]]
    for k, phi in enumerate(PHI):
        (c1, c2, c3), (s1, s2, s3) = np.cos(q[3 + 3 * k :][:3]), np.sin(q[3 + 3 * k :][:3])
        d1, d2, d3 = dq[3 + 3 * k :][:3]
        c, s = cos(phi), sin(phi)
        nu = 2 * a2 * s1 * d1 + a3 * c3 * s2 * d2 + a3 * c2 * s3 * d3
        v.append(np.array([-a2 * c1 * d1, -c * a2 * s1 * d1, -s * a2 * s1 * d1]))
        down = -2 * a2 * c1 * d1 - a3 * c2 * c3 * d2 + a3 * s2 * s3 * d3
        v.append(np.array([down, -(s * a3 * c3 * d3 + c * nu), c * a3 * c3 * d3 - s * nu]))
    return v


def kinetic_energy(p, q, dq):
    """T, eq. (62)-(64)."""
    T = (p.m1 + p.m2) * (dq[0] ** 2 + dq[1] ** 2 + dq[2] ** 2) / 2
    for k in range(3):
        q1, q2, q3 = q[3 + 3 * k : 6 + 3 * k]
        d1, d2, d3 = dq[3 + 3 * k : 6 + 3 * k]
        T += (p.a2**2 * p.m3 + p.I33) * d1**2 / 2
        T += (
            4 * p.a2**2 * p.m4 * d1**2
            + (p.a3**2 * p.m4 + p.I41) * d3**2
            + (sin(q3) ** 2 * axial(p) + cos(q3) ** 2 * (p.a3**2 * p.m4 + p.I43)) * d2**2
            + 4
            * (p.a2 * p.a3 * p.m4 * d1)
            * (cos(q3) * cos(q1 - q2) * d2 + sin(q3) * sin(q1 - q2) * d3)
        ) / 2
    return T


def potential_energy(p, q):
    """V, eq. (77)-(79)."""
    V = -p.g * (p.m1 + p.m2) * q[0]
    for k in range(3):
        q1, q2, q3 = q[3 + 3 * k : 6 + 3 * k]
        V += p.g * p.a2 * p.m3 * sin(q1)
        V += p.g * p.m4 * (2 * p.a2 * sin(q1) + p.a3 * cos(q3) * sin(q2))
    return V


def inertia_matrix(p, q):
    """M, eq. (66) and (68)-(73)."""
    M = np.zeros((12, 12))
    M[:3, :3] = (p.m1 + p.m2) * np.eye(3)
    for k in range(3):
        q1, q2, q3 = q[3 + 3 * k : 6 + 3 * k]
        m11 = p.a2**2 * (p.m3 + 4 * p.m4) + p.I33
        m22 = sin(q3) ** 2 * axial(p) + cos(q3) ** 2 * (p.a3**2 * p.m4 + p.I43)
        m33 = p.a3**2 * p.m4 + p.I41
        m12 = 2 * p.a2 * p.a3 * p.m4 * cos(q3) * cos(q1 - q2)
        m13 = 2 * p.a2 * p.a3 * p.m4 * sin(q3) * sin(q1 - q2)
        block = [[m11, m12, m13], [m12, m22, 0.0], [m13, 0.0, m33]]
        M[3 + 3 * k : 6 + 3 * k, 3 + 3 * k : 6 + 3 * k] = block
    return M


def gyroscopic_force(p, q, dq):
    """Q̂*, eq. (67) and (74)-(76)."""
    Q = np.zeros(12)
    coupling, tilt = p.a2 * p.a3 * p.m4, p.a3**2 * p.m4 - axial(p) + p.I43
    for k in range(3):
        q1, q2, q3 = q[3 + 3 * k : 6 + 3 * k]
        d1, d2, d3 = dq[3 + 3 * k : 6 + 3 * k]
        S, C = sin(q1 - q2), cos(q1 - q2)
        Q[3 + 3 * k : 6 + 3 * k] = (
            4 * coupling * (C * sin(q3) * d2 * d3 - cos(q3) * S * (d2**2 + d3**2) / 2),
            2 * cos(q3) * (coupling * S * d1**2 + sin(q3) * tilt * d2 * d3),
            -sin(q3) * (2 * coupling * C * d1**2 + cos(q3) * tilt * d2**2),
        )
    return Q


def active_force(p, q, tau):
    """Q, eq. (67) and (80)-(83)."""
    Q = np.zeros(12)
    Q[0] = (p.m1 + p.m2) * p.g
    for k in range(3):
        q1, q2, q3 = q[3 + 3 * k : 6 + 3 * k]
        Q[3 + 3 * k : 6 + 3 * k] = (
            -p.g * p.a2 * (p.m3 + 2 * p.m4) * cos(q1) + tau[k],
            -p.g * p.a3 * p.m4 * cos(q2) * cos(q3),
            p.g * p.a3 * p.m4 * sin(q2) * sin(q3),
        )
    return Q


def axial(p):
    """I₄,₂, nothing for slender bars."""
    return 0.0 if p.I42 is None else p.I42
