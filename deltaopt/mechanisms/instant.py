"""A motion of a robot at one instant: every quantity that a limit may depend on, as expressions.

There are three ways to the same quantities, each derived only when needed: from the platform's
motion by eq. (39), in its shortest form; from the platform's motion by the general derivation in
all coordinates; and from these coordinates themselves. They may be those of a lighter payload, or
symbols.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import casadi as ca

from deltaopt.dynamics.mechanism import SX
from deltaopt.mechanisms.functions import Functions


@dataclass(frozen=True, eq=False)
class PlatformInstant:
    """The quantities as functions of the platform's motion.

    ``x``, ``v``, ``a``: position, velocity, acceleration, 3 each, m, m/s, m/s². ``p``: parameters.

    ``jerk``: m/s³; None where nothing depends on it.

    ``given_torque``: the motor torques (3, N·m), where these are variables of their own; otherwise
    they follow from the motion by eq. (39). ``given_torque_rate``: likewise their rates, N·m/s.
    """

    functions: Functions
    x: SX
    v: SX
    a: SX
    p: SX
    given_torque: SX | None = None
    jerk: SX | None = None
    given_torque_rate: SX | None = None

    @cached_property
    def tau(self) -> SX:
        """Forces or torques of the actuators, 3."""
        if self.given_torque is not None:
            return self.given_torque
        return self.functions.explicit_torques(self.x, self.v, self.a, self.p)

    @cached_property
    def tau_per_payload(self) -> SX:
        """By how much the actuators' forces grow with the payload's mass, 3: along a given
        motion they are affine in it."""
        return _payload_slope(self.functions)(self.x, self.v, self.a, self.p)

    @property
    def j(self) -> SX:
        """Jerk of the platform, 3, m/s³."""
        return _known(self.jerk)

    @cached_property
    def dtau(self) -> SX:
        """Rates of the actuators' forces or torques, 3, N/s or N·m/s."""
        if self.given_torque_rate is not None:
            return self.given_torque_rate
        return _rates(self.functions.explicit_torques, *self._motion, self.p)[0]

    @property
    def dtau_per_payload(self) -> SX:
        """By how much these rates grow with the payload's mass, 3."""
        return _rates(_payload_slope(self.functions), *self._motion, self.p)[0]

    @property
    def dddtheta(self) -> SX:
        """Jerks of the actuators, 3."""
        return self.equation_rates[3]

    @property
    def force(self) -> SX:
        """Cᵀ (Q* + Q) of eq. (39), 3, N: zero where the torques produce the motion."""
        return self._equations[0]

    @property
    def alignment(self) -> SX:
        """Squared distances from the serial singularities, 3."""
        return self._equations[1]

    @property
    def dtheta(self) -> SX:
        """Speeds of the actuators, 3."""
        return self._equations[2]

    @property
    def ddtheta(self) -> SX:
        """Accelerations of the actuators, 3."""
        return self._equations[3]

    @property
    def theta(self) -> SX:
        """Positions of the actuators, 3."""
        return self.functions.inverse_kinematics(self.x, self.p)[self.functions.motors]

    @property
    def tilt(self) -> SX:
        """Sines of the angles by which the bars lean out of the plane of their chain, 3."""
        return self.functions.tilt(self.x, self.p)

    @property
    def parallel_margin(self) -> SX:
        """Volume that is 0 in a parallel singularity."""
        return self.functions.parallel_margin(self.q)

    @property
    def tilt_margin(self) -> SX:
        """Volume that is 0 where the platform can tilt."""
        return self.functions.tilt_margin(self.q)

    @cached_property
    def q(self) -> SX:
        """All coordinates, m and rad."""
        return self.functions.motion(self.x, self.v, self.a, self.p)[0]

    @cached_property
    def _equations(self) -> tuple[SX, ...]:
        torque = SX.zeros(3) if self.given_torque is None else self.given_torque
        return tuple(self.functions.explicit_equations(self.x, self.v, self.a, torque, self.p))

    @property
    def _motion(self) -> tuple[list[SX], list[SX]]:
        """Position and its two derivatives, and the rates of these."""
        return [self.x, self.v, self.a], [self.v, self.a, self.j]

    @cached_property
    def equation_rates(self) -> list[SX]:
        """The rates of the force of eq. (39), N/s, of squared distances from the serial
        singularities, and of the actuators' speeds and accelerations, 3 each."""
        motion, rates = self._motion
        torque = SX.zeros(3) if self.given_torque is None else self.given_torque
        change = SX.zeros(3) if self.given_torque is None else self.dtau
        equations = self.functions.explicit_equations
        return _rates(equations, [*motion, torque], [*rates, change], self.p)


class CoordinateInstant:
    """The quantities of ``AnyInstant`` as functions of all coordinates ``q``, m and rad, their
    derivatives ``dq`` and ``ddq`` by time, and the actuators' forces or torques ``tau``, 3, N or
    N·m.

    ``p``: parameters. ``torques``: (x, v, a, p) -> the same forces or torques, from which follow
    their rates and what they are with another payload. ``jerk``: of the platform, m/s³; None where
    nothing depends on it.
    """

    def __init__(
        self,
        functions: Functions,
        q: SX,
        dq: SX,
        ddq: SX,
        tau: SX,
        p: SX,
        torques: ca.Function,
        jerk: SX | None = None,
    ) -> None:
        self.q, own = q, functions.motors
        self.x, self.v, self.a = q[:3], dq[:3], ddq[:3]
        self.theta, self.dtheta, self.ddtheta, self.tau = q[own], dq[own], ddq[own], tau
        self.alignment, self.tilt = functions.alignments(q), functions.tilts(q)
        self.parallel_margin = functions.parallel_margin(q)
        self.tilt_margin = functions.tilt_margin(q)
        self._functions, self._p, self._torques, self._jerk = functions, p, torques, jerk

    @classmethod
    def general(
        cls, functions: Functions, x: SX, v: SX, a: SX, p: SX, jerk: SX | None = None
    ) -> CoordinateInstant:
        """From the platform's motion, by the general derivation in twelve coordinates."""
        q, dq, ddq = functions.motion(x, v, a, p)
        torques = functions.inverse_dynamics.expand()
        return cls(functions, q, dq, ddq, torques(x, v, a, p)[0], p, torques, jerk)

    @property
    def j(self) -> SX:
        """Jerk of the platform, 3, m/s³."""
        return _known(self._jerk)

    @property
    def dtau(self) -> SX:
        """Rates of the actuators' forces or torques, 3, N/s or N·m/s."""
        return _rates(self._torques, *self._motion, self._p)[0]

    @property
    def dtau_per_payload(self) -> SX:
        """By how much these rates grow with the payload's mass, 3."""
        return _rates(self._torques, *self._motion, self._heavier)[0] - self.dtau

    @property
    def dddtheta(self) -> SX:
        """Jerks of the actuators, 3."""
        functions = self._functions
        return _rates(functions.motion, *self._motion, self._p)[2][functions.motors]

    @property
    def tau_per_payload(self) -> SX:
        """By how much the actuators' forces grow with the payload's mass, 3."""
        heavier, same = (
            self._torques.call([self.x, self.v, self.a, p])[0] for p in (self._heavier, self._p)
        )
        return heavier - same

    @property
    def _heavier(self) -> SX:
        """The parameters with 1 kg more payload."""
        p = SX(self._p)
        p[self._functions.payload] += 1.0
        return p

    @property
    def _motion(self) -> tuple[list[SX], list[SX]]:
        """The platform's position and its two derivatives, and the rates of these."""
        return [self.x, self.v, self.a], [self.v, self.a, self.j]


class AnyInstant:
    """A motion at one instant, as CasADi expressions; here each is a symbol of its own, by which is
    found what an expression depends on.

    The platform's position ``x``, velocity ``v`` and acceleration ``a`` (3; m, m/s, m/s²); motor
    angles ``theta`` (rad) and their rates ``dtheta`` and ``ddtheta``; motor torques ``tau`` (N·m),
    one for each motor; of linear drives positions (m) and forces (N). ``alignment``, sin² (q_{k,1}
    - q_{k,2}) of each chain, 0 in its serial singularity; ``tilt``, sin q_{k,3} of each chain, how
    far its bars lean out of the plane of its arm; ``parallel_margin`` and ``tilt_margin``, volumes
    that are 0 in the parallel singularity and where the platform can tilt; ``tau_per_payload``, by
    how much the torques grow with the payload's mass (N·m/kg). Of limits of order 3 alone: the
    platform's jerk ``j`` (m/s³), the rates ``dddtheta`` (rad/s³) and ``dtau`` (N·m/s), and
    ``dtau_per_payload``.
    """

    def __init__(self, motors: int) -> None:
        def own(name: str) -> SX:
            return SX.sym(name, motors)

        self.x, self.v, self.a, self.j = (SX.sym(name, 3) for name in "xvaj")
        self.theta, self.alignment, self.tilt = own("theta"), own("alignment"), own("tilt")
        self.parallel_margin, self.tilt_margin = SX.sym("parallel"), SX.sym("tilted")
        self.dtheta, self.ddtheta, self.dddtheta = own("dtheta"), own("ddtheta"), own("dddtheta")
        self.tau, self.tau_per_payload = own("tau"), own("tau_per_payload")
        self.dtau, self.dtau_per_payload = own("dtau"), own("dtau_per_payload")
        chains, margins = (self.alignment, self.tilt), (self.parallel_margin, self.tilt_margin)
        self.by_order = (
            ca.vertcat(self.x, self.theta, *chains, *margins),
            ca.vertcat(self.v, self.dtheta),
            ca.vertcat(self.a, self.ddtheta, self.tau_per_payload, self.tau),
            ca.vertcat(self.j, self.dddtheta, self.dtau_per_payload, self.dtau),
        )
        self.everything = ca.vertcat(*self.by_order)

    def order_of(self, rows: SX) -> int:
        """The highest derivative of position that rows depend on; torques are accelerations."""
        return max(n for n, own in enumerate(self.by_order) if n == 0 or ca.depends_on(rows, own))


class LighterInstant:
    """A motion at an instant with ``less`` payload, kg: all is as it is but the torques."""

    def __init__(self, motion: Instant, less: SX) -> None:
        self._motion, self._less = motion, less

    def __getattr__(self, name: str) -> SX:
        value: SX = getattr(self._motion, name)
        return value

    @property
    def tau(self) -> SX:
        return self._motion.tau - self._less * self._motion.tau_per_payload

    @property
    def dtau(self) -> SX:
        return self._motion.dtau - self._less * self._motion.dtau_per_payload


Instant = PlatformInstant | CoordinateInstant | LighterInstant | AnyInstant
"""What a limit may depend on; ``AnyInstant`` lists it."""


def _known(jerk: SX | None) -> SX:
    """The jerk. Raises ValueError where it is not given."""
    if jerk is None:
        raise ValueError("the jerk of the motion is not known")
    return jerk


def _rates(function: ca.Function, of: Sequence[SX], by: Sequence[SX], p: SX) -> list[SX]:
    """Derivatives by time of all results of a function of some arguments ``of``, whose rates are
    ``by``, and of parameters ``p``."""
    return list(_rate_function(function, tuple(each.numel() for each in of)).call([*of, *by, p]))


@lru_cache(maxsize=32)
def _rate_function(function: ca.Function, sizes: tuple[int, ...]) -> ca.Function:
    of, by = ([SX.sym(name, size) for size in sizes] for name in ("of", "by"))
    p = SX.sym("p", function.size1_in(len(sizes)))
    results = function.expand().call([*of, p])
    slopes = [ca.jtimes(each, ca.vertcat(*of), ca.vertcat(*by)) for each in results]
    return ca.Function("rates", [*of, *by, p], slopes)


@lru_cache(maxsize=32)
def _payload_slope(functions: Functions) -> ca.Function:
    """(x, v, a, p) -> by how much torques grow with the payload's mass, 3."""
    x, v, a, tau, p, force = functions.affine_equations()
    mass = p[functions.payload]
    slope = -ca.inv_minor(ca.jacobian(force, tau)) @ ca.jacobian(force, mass)
    return ca.Function("payload_slope", [x, v, a, p], [slope])
