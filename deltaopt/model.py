"""The Delta as a user meets it: platform motion in, torques out, many points at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from deltaopt.dynamics.constraint_matrix import ClosedForm
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.dynamics.mechanism import SX, Mechanism
from deltaopt.errors import Unreachable
from deltaopt.mechanisms.delta import DeltaParameters, delta
from deltaopt.mechanisms.delta_kinematics import forward_kinematics, inverse_kinematics, reach
from deltaopt.robot import Robot

Array = NDArray[np.float64]


def delta_parameters(robot: Robot, payload: float | None) -> DeltaParameters:
    """The paper's letters from a robot file: lengths halved, slender bars where no inertia."""
    arm, bars = robot.upper_arm, robot.forearm
    slender = bars.mass * bars.length**2 / 12
    I41, I42, I43 = bars.inertia or (slender, None, slender)
    return DeltaParameters(
        a1=robot.base_radius,
        a2=arm.length / 2,
        a3=bars.length / 2,
        a4=robot.platform_radius,
        m1=robot.platform.mass,
        m2=payload,
        m3=arm.mass,
        m4=bars.mass,
        I33=arm.mass * arm.length**2 / 12 if arm.inertia is None else arm.inertia,
        I41=I41,
        I42=I42,
        I43=I43,
        g=robot.gravity or None,
    )


@dataclass(frozen=True)
class DeltaModel:
    """Kinematics and dynamics of a robot with a payload (kg), in a formulation.

    Arguments and results are arrays of N points, (N, 3) for what belongs to the platform
    or the motors; a single point (3,) gives a single result. Units: m, m/s, m/s², rad, N·m.
    """

    robot: Robot
    payload: float | None = None
    formulation: Formulation = field(default_factory=Explicit)

    @cached_property
    def parameters(self) -> DeltaParameters:
        return delta_parameters(self.robot, self.payload)

    @cached_property
    def mechanism(self) -> Mechanism:
        """The twelve coordinates and nine constraints of section 4."""
        return delta(self.parameters)

    def inverse_kinematics(self, x: ArrayLike) -> Array:
        """q, (N, 12), of the platform's centre x, (N, 3), every elbow outside.

        Raises Unreachable where there is no such q.
        """
        x = np.asarray(x, dtype=float)
        q = evaluate(self._inverse_kinematics, x)
        self._require_reach(x, q)
        return q

    def forward_kinematics(self, theta: ArrayLike) -> Array:
        """x, (N, 3), of the motor angles, (N, 3): the lower of the two solutions.

        Raises Unreachable where the bars do not meet.
        """
        theta = np.asarray(theta, dtype=float)
        x = evaluate(self._forward_kinematics, theta)
        bad = ~np.isfinite(np.atleast_2d(x)).all(axis=1)
        if bad.any():
            raise Unreachable(f"motor angles {_first(theta, bad)} rad: the bars do not meet there")
        return x

    def motion(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> tuple[Array, Array, Array]:
        """q, q̇, q̈, (N, 12) each, of a motion of the platform."""
        x = np.asarray(x, dtype=float)
        q, dq, ddq = evaluate_all(self._motion, x, v, a)
        self._require_reach(x, q)
        return q, dq, ddq

    def inverse_dynamics(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Motor torques τ, (N, 3), of a motion of the platform, eq. (39) by default."""
        x = np.asarray(x, dtype=float)
        tau = evaluate_all(self._inverse_dynamics, x, v, a)[0]
        self._require_reach(x, tau)
        return tau

    def multipliers(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """λ, (N, 9), N: the force of each chain on the platform, eq. (37)."""
        x = np.asarray(x, dtype=float)
        lam = evaluate_all(self._inverse_dynamics, x, v, a)[1]
        self._require_reach(x, lam)
        return lam

    def forward_dynamics(self, x: ArrayLike, v: ArrayLike, tau: ArrayLike) -> Array:
        """Acceleration of the platform, (N, 3), under motor torques (N, 3)."""
        x = np.asarray(x, dtype=float)
        a = evaluate(self._forward_dynamics, x, v, tau)
        self._require_reach(x, a)
        return a

    @cached_property
    def _p(self) -> SX:
        return self.parameters.vector()

    @cached_property
    def _inverse_kinematics(self) -> ca.Function:
        x = SX.sym("x", 3)
        return ca.Function("inverse_kinematics", [x], [inverse_kinematics(self.parameters, x)])

    @cached_property
    def _forward_kinematics(self) -> ca.Function:
        theta = SX.sym("theta", 3)
        x = forward_kinematics(self.parameters, theta)
        return ca.Function("forward_kinematics", [theta], [x])

    @cached_property
    def _reach(self) -> ca.Function:
        x = SX.sym("x", 3)
        return ca.Function("reach", [x], [ca.vec(reach(self.parameters, x))])

    @cached_property
    def _velocity(self) -> ca.Function:
        """(x, v) -> q, q̇, with q̇ = C v since eq. (55)'s ξ is the platform's position."""
        x, v = ca.MX.sym("x", 3), ca.MX.sym("v", 3)
        q = self._inverse_kinematics(x)
        C, _ = ClosedForm().function(self.mechanism)(0, q, self._p)
        return ca.Function("velocity", [x, v], [q, C @ v]).expand()

    @cached_property
    def _motion(self) -> ca.Function:
        """(x, v, a) -> q, q̇, q̈, with q̈ = C a - P J̇ q̇."""
        m = self.mechanism
        x, v, a = (ca.MX.sym(s, 3) for s in "xva")
        q, dq = self._velocity(x, v)
        C, P = ClosedForm().function(m)(0, q, self._p)
        bias = ca.Function("bias", [m.q, m.dq, m.parameters], [m.J_bias])(q, dq, self._p)
        return ca.Function("motion", [x, v, a], [q, dq, C @ a - P @ bias]).expand()

    @cached_property
    def _inverse_dynamics(self) -> ca.Function:
        x, v, a = (ca.MX.sym(s, 3) for s in "xva")
        tau_lam = self.formulation.inverse_dynamics(self.mechanism)
        return ca.Function("f", [x, v, a], tau_lam(0, *self._motion(x, v, a), self._p))

    @cached_property
    def _forward_dynamics(self) -> ca.Function:
        x, v, tau = ca.MX.sym("x", 3), ca.MX.sym("v", 3), ca.MX.sym("tau", 3)
        ddq, _ = self.formulation.forward_dynamics(self.mechanism)(
            0, *self._velocity(x, v), tau, self._p
        )
        return ca.Function("f", [x, v, tau], [ddq[:3]])

    def _require_reach(self, x: Array, result: Array) -> None:
        bad = ~np.isfinite(np.atleast_2d(result)).all(axis=1)
        if not bad.any():
            return
        point = _first(x, bad)
        raise Unreachable(f"the platform cannot be at {point} m: {self._obstacle(point)}")

    def _obstacle(self, point: Array) -> str:
        """Which chain keeps the platform from a point, and how."""
        margins = evaluate(self._reach, point).reshape(2, 3)
        for k in range(3):
            if margins[0, k] < 0:
                return f"the bars of chain {k + 1} are too short to reach it sideways"
            if not margins[1, k] > 0:
                return f"arm and bars of chain {k + 1} cannot close there"
        return "the arms and bars are in a singular position there"


def evaluate(function: ca.Function, *arguments: ArrayLike) -> Array:
    """The only result of a function of columns, for rows: (N, i) each -> (N, o)."""
    return evaluate_all(function, *arguments)[0]


def evaluate_all(function: ca.Function, *arguments: ArrayLike) -> tuple[Array, ...]:
    """All results of a function of columns, for rows: (N, i) each -> (N, o) each."""
    rows = [np.asarray(a, dtype=float) for a in arguments]
    if any(r.shape[-1:] != (function.size1_in(i),) or r.ndim > 2 for i, r in enumerate(rows)):
        wanted = ", ".join(f"(N, {function.size1_in(i)})" for i in range(len(rows)))
        found = ", ".join(str(r.shape) for r in rows)
        raise ValueError(f"arrays of shape {wanted} are needed, not {found}")
    single = all(r.ndim == 1 for r in rows)
    n = max(r.shape[0] if r.ndim == 2 else 1 for r in rows)
    if n == 0:
        return tuple(np.zeros((0, function.size1_out(i))) for i in range(function.n_out()))
    columns = [np.broadcast_to(np.atleast_2d(r), (n, r.shape[-1])).T for r in rows]
    results = function.call(columns)
    found_rows = [np.asarray(ca.DM(r).full()).T for r in results]
    return tuple(r[0] if single else r for r in found_rows)


def _first(rows: Array, bad: NDArray[np.bool_]) -> Array:
    point: Array = np.atleast_2d(rows)[np.argmax(bad) if np.ndim(rows) == 2 else 0]
    return point
