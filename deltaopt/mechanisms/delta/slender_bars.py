"""Eq. (39) without the bars' angles, for a Delta with slender bars; the default plan uses it.

A bar with I₄,₁ = I₄,₃ = I and I₄,₂ = 0 has the kinetic energy of particles at its ends, elbow E and
tip P:

    T = (α v_E² + 2 β v_E·v_P + α v_P²) / 2,   α = m₄/4 + I/(2 a₃)²,   β = m₄/4 − I/(2 a₃)²

This equals eq. (64), which is m₄ (v_E + v_P)²/8 + I (v_P − v_E)²/(2 (2 a₃)²) for such a bar. With E
a function of the motor angle alone, six coordinates x and θ_k under three constraints |P − E|² =
(2 a₃)² replace twelve under nine, and no trigonometric function is left. A planner evaluates
these equations millions of times, and this form takes a tenth of the operations of the general
derivation. `tests/mechanisms/test_slender_bars.py` proves the two equal, to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin

import casadi as ca

from deltaopt.dynamics.mechanism import SX
from deltaopt.mechanisms.delta.mechanism import AZIMUTHS, DeltaParameters, in_base


def angle_free_equations(p: DeltaParameters, x: SX, v: SX, a: SX, tau: SX) -> tuple[SX, SX, SX, SX]:
    """Eq. (39) and the motor speeds and accelerations for a motion of the platform.

    Returns Cᵀ (Q* + Q), 3, N, zero where the motion obeys eq. (39); the alignment sin² (q_{k,1} -
    q_{k,2}) of each chain, 3, zero where it is folded or stretched; θ̇ and θ̈, 3 each, rad/s and
    rad/s². x, v, a: of the platform's centre, 3 each, m, m/s, m/s². tau: motor torques, 3, N·m.
    """
    mass = p.m1 + p.m2
    force = -mass * a
    if p.gravity is not None:
        force += mass * p.gravity
    alignments, speeds, accelerations = [], [], []
    for azimuth, torque in zip(AZIMUTHS, ca.vertsplit(tau), strict=True):
        chain = _SlenderChain(p, azimuth, p.platform_at(x), v, a)
        force += in_base(azimuth, *chain.force_on_platform(torque))
        alignments.append(chain.alignment)
        speeds.append(chain.dtheta)
        accelerations.append(chain.ddtheta)
    return force, ca.vertcat(*alignments), ca.vertcat(*speeds), ca.vertcat(*accelerations)


def chain_forces(p: DeltaParameters, x: SX, v: SX, a: SX, tau: SX) -> SX:
    """The force of each chain on the platform, 9, N, in the base frame: λ of eq. (37) where the
    torques ``tau``, 3, N·m, produce the platform's motion x, v, a, 3 each."""
    forces = []
    for azimuth, torque in zip(AZIMUTHS, ca.vertsplit(tau), strict=True):
        chain = _SlenderChain(p, azimuth, p.platform_at(x), v, a)
        forces.append(in_base(azimuth, *chain.force_on_platform(torque)))
    return ca.vertcat(*forces)


@dataclass(frozen=True)
class _Vector:
    """A vector by its components down, outward and sideways in the frame of a chain."""

    d: SX
    o: SX
    s: SX

    def dot(self, other: _Vector) -> SX:
        return self.d * other.d + self.o * other.o + self.s * other.s


class _SlenderChain:
    """One chain: its arm's speed θ̇ and acceleration θ̈, and its force on the platform, whose centre
    is at x."""

    def __init__(self, p: DeltaParameters, azimuth: float, x: SX, v: SX, a: SX) -> None:
        self.p, self.azimuth = p, azimuth
        self.a, v_tip = self._local(a), self._local(v)
        tip = self._local(x)
        self._place(tip.d, tip.o - (p.a1 - p.a4), tip.s)
        # L·(v − u θ̇) = 0, L the bar from elbow to tip, u = dE/dθ. Then its derivative.
        Lu = self.L.d * self.u_d + self.L.o * self.u_o
        self.C = _Vector(self.L.d / Lu, self.L.o / Lu, self.L.s / Lu)  # dθ/dx
        self.dtheta = self.C.dot(v_tip)
        self.w2 = self.dtheta**2
        dL_d, dL_o = v_tip.d - self.u_d * self.dtheta, v_tip.o - self.u_o * self.dtheta
        towards = _Vector(self.a.d + self.E_d * self.w2, self.a.o + self.E_o * self.w2, self.a.s)
        self.ddtheta = self.C.dot(towards) + (dL_d**2 + dL_o**2 + v_tip.s**2) / Lu

    def _place(self, down: SX, outward: SX, sideways: SX) -> None:
        """Set the elbow E, its derivative u = dE/dθ and the bar L from elbow to tip, all relative
        to the motor's axis, for the tip at these coordinates."""
        # Projected onto the plane of the arm the bar has the length √bars2.
        arm2, bars2 = (2 * self.p.a2) ** 2, (2 * self.p.a3) ** 2 - sideways**2
        distance2 = down**2 + outward**2
        dot = (distance2 + arm2 - bars2) / 2  # E·P
        cross2 = arm2 * distance2 - dot**2
        self.alignment = cross2 / (arm2 * bars2)
        cross = ca.sqrt(cross2)  # |E×P|: the elbow outside
        self.E_d = (down * dot - outward * cross) / distance2
        self.E_o = (outward * dot + down * cross) / distance2
        self.u_d, self.u_o = -self.E_o, self.E_d
        self.L = _Vector(down - self.E_d, outward - self.E_o, sideways)

    def force_on_platform(self, tau: SX) -> tuple[SX, SX, SX]:
        """The force of arm, bars and motor on the platform, N: their part of Cᵀ (Q* + Q)."""
        p = self.p
        across = p.I41 / (2 * p.a3) ** 2
        alpha, beta = p.m4 / 4 + across, p.m4 / 4 - across
        inertia = p.I33 + self._distance2 * p.m3 + (2 * p.a2) ** 2 * alpha
        u_a = self.u_d * self.a.d + self.u_o * self.a.o
        load = p.load(ca.atan2(-self.E_d, self.E_o), self.dtheta)
        moment = tau if load is None else tau - load
        moment = moment - inertia * self.ddtheta - beta * u_a  # Q*_θ + Q_θ
        dv_E_d = self.u_d * self.ddtheta - self.E_d * self.w2
        dv_E_o = self.u_o * self.ddtheta - self.E_o * self.w2
        down = -alpha * self.a.d - beta * dv_E_d  # Q*_x + Q_x of the bars
        outward = -alpha * self.a.o - beta * dv_E_o
        sideways = -alpha * self.a.s
        if p.gravity is not None:
            g = self._local(p.gravity)
            moment += self._weight(g)
            down += g.d * p.m4 / 2
            if p.g_y is not None or p.g_z is not None:
                outward += g.o * p.m4 / 2
                sideways += g.s * p.m4 / 2
        return (
            down + self.C.d * moment,
            outward + self.C.o * moment,
            sideways + self.C.s * moment,
        )

    @property
    def _distance2(self) -> SX:
        """Square of the distance of the arm's centre of mass from the shaft."""
        p = self.p
        along2 = SX(p.a2 if p.b1 is None else p.b1) ** 2
        return along2 if p.b2 is None else along2 + p.b2**2

    def _weight(self, g: _Vector) -> SX:
        """Moment of gravity about the shaft: of the arm, and of the half of the bars at the elbow.

        The arm's centre of mass is (b₁ E + b₂ u) / (2 a₂), so that its derivative by θ is
        (b₁ u - b₂ E) / (2 a₂).
        """
        p = self.p
        if p.b1 is None and p.b2 is None:
            return self._along_u((p.m3 + p.m4) / 2, g)
        along = p.m3 / 2 if p.b1 is None else p.m3 * p.b1 / (2 * p.a2)
        moment = self._along_u(along + p.m4 / 2, g)
        if p.b2 is not None:
            moment -= p.m3 * p.b2 / (2 * p.a2) * (g.d * self.E_d + g.o * self.E_o)
        return moment

    def _along_u(self, factor: SX | float, g: _Vector) -> SX:
        return factor * g.d * self.u_d + factor * g.o * self.u_o

    def _local(self, vector: SX) -> _Vector:
        c, s = cos(self.azimuth), sin(self.azimuth)
        return _Vector(vector[0], c * vector[1] + s * vector[2], c * vector[2] - s * vector[1])
