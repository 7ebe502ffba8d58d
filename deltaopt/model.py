"""The Delta as a user meets it: platform motion in, torques out, many points at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit
from deltaopt.errors import Unreachable, in_words
from deltaopt.mechanisms.delta import DeltaParameters
from deltaopt.mechanisms.delta_functions import DeltaFunctions
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
    def functions(self) -> DeltaFunctions:
        """The same as CasADi functions."""
        return DeltaFunctions(delta_parameters(self.robot, self.payload), self.formulation)

    @cached_property
    def parameters(self) -> Array:
        """Values of the mechanism's parameters p."""
        return np.asarray(self.functions.parameters.values())

    def inverse_kinematics(self, x: ArrayLike) -> Array:
        """q, (N, 12), of the platform's centre x, (N, 3), every elbow outside.

        Raises Unreachable where there is no such q.
        """
        x = np.asarray(x, dtype=float)
        q = self._evaluate(self.functions.inverse_kinematics, x)[0]
        self._require_reach(x, q)
        return q

    def forward_kinematics(self, theta: ArrayLike) -> Array:
        """x, (N, 3), of the motor angles, (N, 3): the lower of the two solutions.

        Raises Unreachable where the bars do not meet.
        """
        theta = np.asarray(theta, dtype=float)
        x = self._evaluate(self.functions.forward_kinematics, theta)[0]
        bad = np.logical_not(np.isfinite(np.atleast_2d(x)).all(axis=1))
        if bad.any():
            raise Unreachable(
                f"motor angles {in_words(_first(theta, bad))} rad: the bars do not meet there"
            )
        return x

    def openings(self, x: ArrayLike) -> Array:
        """sin² (q_{k,1} - q_{k,2}) of the chains, (N, 3): 0 where one is folded or stretched."""
        return self._evaluate(self.functions.reach, x)[0][..., 3:]

    def motion(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> tuple[Array, Array, Array]:
        """q, q̇, q̈, (N, 12) each, of a motion of the platform."""
        x = np.asarray(x, dtype=float)
        q, dq, ddq = self._evaluate(self.functions.motion, x, v, a)
        self._require_reach(x, q)
        return q, dq, ddq

    def inverse_dynamics(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Motor torques τ, (N, 3), of a motion of the platform, eq. (39) by default."""
        x = np.asarray(x, dtype=float)
        tau = self._evaluate(self.functions.inverse_dynamics, x, v, a)[0]
        self._require_reach(x, tau)
        return tau

    def multipliers(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """λ, (N, 9), N: the force of each chain on the platform, eq. (37)."""
        x = np.asarray(x, dtype=float)
        lam = self._evaluate(self.functions.inverse_dynamics, x, v, a)[1]
        self._require_reach(x, lam)
        return lam

    def forward_dynamics(self, x: ArrayLike, v: ArrayLike, tau: ArrayLike) -> Array:
        """Acceleration of the platform, (N, 3), under motor torques (N, 3)."""
        x = np.asarray(x, dtype=float)
        a = self._evaluate(self.functions.forward_dynamics, x, v, tau)[0]
        self._require_reach(x, a)
        return a

    def _evaluate(self, function: ca.Function, *arguments: ArrayLike) -> tuple[Array, ...]:
        return evaluate_rows(function, *arguments, parameters=self.parameters)

    def _require_reach(self, x: Array, result: Array) -> None:
        bad = np.logical_not(np.isfinite(np.atleast_2d(result)).all(axis=1))
        if not bad.any():
            return
        point = _first(x, bad)
        raise Unreachable(f"the platform cannot be at {in_words(point)} m: {self._obstacle(point)}")

    def _obstacle(self, point: Array) -> str:
        """Which chain keeps the platform from a point, and how."""
        margins = self._evaluate(self.functions.reach, point)[0].reshape(2, 3)
        for k in range(3):
            if margins[0, k] < 0:
                return f"the bars of chain {k + 1} are too short to reach it sideways"
            if not margins[1, k] > 0:
                return f"arm and bars of chain {k + 1} cannot close there"
        return "the arms and bars are in a singular position there"


def evaluate_rows(
    function: ca.Function, *arguments: ArrayLike, parameters: Array
) -> tuple[Array, ...]:
    """A function of columns and p, for rows: (N, i) each -> (N, o) each; (i,) each -> (o,)."""
    rows = [np.asarray(a, dtype=float) for a in arguments]
    if any(r.ndim not in (1, 2) or r.shape[-1] != function.size1_in(i) for i, r in enumerate(rows)):
        wanted = ", ".join(f"(N, {function.size1_in(i)})" for i in range(len(rows)))
        found = ", ".join(str(r.shape) for r in rows)
        raise ValueError(f"arrays of shape {wanted} are needed, not {found}")
    lengths = {r.shape[0] for r in rows if r.ndim == 2}
    if len(lengths) > 1:
        raise ValueError(f"arrays of one length are needed, not of {sorted(lengths)}")
    n = lengths.pop() if lengths else 1
    if n == 0:
        return tuple(np.zeros((0, function.size1_out(i))) for i in range(function.n_out()))
    columns = [np.broadcast_to(np.atleast_2d(r), (n, r.shape[-1])).T for r in rows]
    results = [
        np.asarray(r.full()).T
        for r in function.call([ca.DM(c) for c in columns] + [ca.DM(parameters)])
    ]
    single = all(r.ndim == 1 for r in rows)
    return tuple(r[0] if single else r for r in results)


def _first(rows: Array, bad: NDArray[np.bool]) -> Array:
    point: Array = np.atleast_2d(rows)[int(np.argmax(bad))]
    return point
