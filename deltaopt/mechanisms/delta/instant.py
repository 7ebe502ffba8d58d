"""A motion of the Delta at one instant: every quantity that a limit may depend on, as expressions.

There are three ways to the same quantities, each derived only when needed: from the platform's
motion by eq. (39), in the angle-free form if the bars are slender; from the platform's motion by
the general derivation in twelve coordinates; and from the twelve coordinates themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from deltaopt.dynamics.mechanism import SX
from deltaopt.mechanisms.delta.functions import DeltaFunctions


@dataclass(frozen=True, eq=False)
class PlatformInstant:
    """The quantities as functions of the platform's motion.

    ``x``, ``v``, ``a``: position, velocity, acceleration, 3 each, m, m/s, m/s². ``p``: parameters.

    ``given_torque``: the motor torques (3, N·m), where these are variables of their own; otherwise
    they follow from the motion by eq. (39).
    """

    functions: DeltaFunctions
    x: SX
    v: SX
    a: SX
    p: SX
    given_torque: SX | None = None

    @cached_property
    def tau(self) -> SX:
        """Motor torques, 3, N·m."""
        if self.given_torque is not None:
            return self.given_torque
        return self.functions.explicit_torques(self.x, self.v, self.a, self.p)

    @cached_property
    def tau_per_payload(self) -> SX:
        """By how much the motor torques grow with the payload's mass, 3, N·m/kg: along a given
        motion they are affine in it. Of mechanisms with a payload."""
        tau, mass = SX.sym("tau", 3), self.p[self.functions.terms.names.index("m2")]
        force, *_ = self.functions.explicit_equations(self.x, self.v, self.a, tau, self.p)
        return -ca.inv_minor(ca.jacobian(force, tau)) @ ca.jacobian(force, mass)

    @property
    def force(self) -> SX:
        """Cᵀ (Q* + Q) of eq. (39), 3, N: zero where the torques produce the motion."""
        return self._equations[0]

    @property
    def alignment(self) -> SX:
        """sin² (q_{k,1} - q_{k,2}), 3: squared distances from the serial singularities."""
        return self._equations[1]

    @property
    def dtheta(self) -> SX:
        """Speeds of the arms, 3, rad/s."""
        return self._equations[2]

    @property
    def ddtheta(self) -> SX:
        """Accelerations of the arms, 3, rad/s²."""
        return self._equations[3]

    @property
    def theta(self) -> SX:
        """Angles of the arms, 3, rad."""
        return self.functions.inverse_kinematics(self.x, self.p)[3::3]

    @property
    def tilt(self) -> SX:
        """sin q_{k,3}, 3: how far the bars lean out of the plane of their arm."""
        return self.functions.tilt(self.x, self.p)

    @property
    def q(self) -> SX:
        """All coordinates, 12, m and rad."""
        return self._coordinates[0]

    @property
    def dq(self) -> SX:
        """Their rates, 12, m/s and rad/s."""
        return self._coordinates[1]

    @property
    def ddq(self) -> SX:
        """Their second derivatives, 12, m/s² and rad/s²."""
        return self._coordinates[2]

    @cached_property
    def _coordinates(self) -> tuple[SX, SX, SX]:
        q, dq, ddq = self.functions.motion(self.x, self.v, self.a, self.p)
        return q, dq, ddq

    @cached_property
    def _equations(self) -> tuple[SX, SX, SX, SX]:
        torque = SX.zeros(3) if self.given_torque is None else self.given_torque
        force, alignment, dtheta, ddtheta = self.functions.explicit_equations(
            self.x, self.v, self.a, torque, self.p
        )
        return force, alignment, dtheta, ddtheta


@dataclass(frozen=True, eq=False)
class CoordinateInstant:
    """The quantities as functions of all coordinates ``q``, 12, m and rad, their derivatives ``dq``
    and ``ddq`` by time, and the motor torques ``tau``, 3, N·m.

    ``torques``: mass of the payload added, kg -> the motor torques with it, where these are known.
    """

    q: SX
    dq: SX
    ddq: SX
    tau: SX
    torques: Callable[[float], SX] | None = None

    @classmethod
    def general(cls, functions: DeltaFunctions, x: SX, v: SX, a: SX, p: SX) -> CoordinateInstant:
        """From the platform's motion, by the general derivation in twelve coordinates."""
        inverse = functions.inverse_dynamics.expand()
        q, dq, ddq = functions.motion(x, v, a, p)

        def torques(added: float) -> SX:
            more = ca.DM([added * (name == "m2") for name in functions.terms.names])
            return inverse(x, v, a, p + more)[0]

        return cls(q, dq, ddq, inverse(x, v, a, p)[0], torques)

    @property
    def tau_per_payload(self) -> SX:
        """By how much the motor torques grow with the payload's mass, 3, N·m/kg.

        Raises ValueError where the torques with another payload are not known.
        """
        if self.torques is None:
            raise ValueError("the torques with another payload are not known")
        return self.torques(1.0) - self.tau

    @property
    def x(self) -> SX:
        """Position of the platform, 3, m."""
        return self.q[:3]

    @property
    def v(self) -> SX:
        """Velocity of the platform, 3, m/s."""
        return self.dq[:3]

    @property
    def a(self) -> SX:
        """Acceleration of the platform, 3, m/s²."""
        return self.ddq[:3]

    @property
    def theta(self) -> SX:
        """Angles of the arms, 3, rad."""
        return self.q[3::3]

    @property
    def dtheta(self) -> SX:
        """Speeds of the arms, 3, rad/s."""
        return self.dq[3::3]

    @property
    def ddtheta(self) -> SX:
        """Accelerations of the arms, 3, rad/s²."""
        return self.ddq[3::3]

    @property
    def alignment(self) -> SX:
        """sin² (q_{k,1} - q_{k,2}), 3: squared distances from the serial singularities."""
        return ca.sin(self.q[3::3] - self.q[4::3]) ** 2

    @property
    def tilt(self) -> SX:
        """sin q_{k,3}, 3: how far the bars lean out of the plane of their arm."""
        return ca.sin(self.q[5::3])
