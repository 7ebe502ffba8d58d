"""The Delta as a user meets it: platform motion in, torques out, many points at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from deltaopt.codegen.vectorised import evaluate_rows
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.errors import Singular, Singularity, Unreachable, in_words
from deltaopt.mechanisms.delta.functions import DeltaFunctions, delta_functions
from deltaopt.mechanisms.delta.mechanism import MOTOR_ANGLES, DeltaParameters
from deltaopt.robot.robot import Robot

Array = NDArray[np.float64]

NEAR = 1e-2
"""Serial margins below which accelerations are left to model L_I, torques at rest to the motor
angles: eq. (55) loses digits there as ε⁻⁵ and ε⁻¹ (docs/stability.md)."""
SERIAL_LIMIT = 1e-6
"""Serial margins below which a moving platform raises Singular: torques have at best three
digits left, for the platform's position determines the square of the margin only."""
PARALLEL_LIMIT = 1e-12
"""Parallel margin below which torques raise Singular: they have four digits left."""


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

    def __reduce__(self) -> tuple[Any, ...]:
        """For other processes: they derive functions themselves."""
        return DeltaModel, (self.robot, self.payload, self.formulation)

    @cached_property
    def functions(self) -> DeltaFunctions:
        """The same as CasADi functions."""
        return delta_functions(self.numbers.terms(), self.formulation)

    @cached_property
    def parameters(self) -> Array:
        """Values of the mechanism's parameters p."""
        return np.asarray(self.numbers.values())

    @cached_property
    def numbers(self) -> DeltaParameters:
        """The paper's letters for this robot and payload."""
        return delta_parameters(self.robot, self.payload)

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

    def alignments(self, x: ArrayLike) -> Array:
        """sin² (q_{k,1} - q_{k,2}) of the chains, (N, 3), with the platform at x, (N, 3), m.

        0 where a chain is folded or stretched: the distance to its serial singularity.
        """
        return self._evaluate(self.functions.serial_distances, x)[0][..., 3:]

    def motion(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> tuple[Array, Array, Array]:
        """q, q̇, q̈, (N, 12) each, of a motion of the platform."""
        margins = self._margins(self.inverse_kinematics(x))
        _require_serial(margins)
        q, dq, ddq = self._evaluate(self.functions.motion, x, v, a)
        return q, dq, ddq

    def inverse_dynamics(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Motor torques τ, (N, 3), of a motion of the platform, eq. (39) by default.

        Raises Singular in a parallel singularity, and in a serial one unless at rest; for
        motions that are possible there see ``joint_inverse_dynamics``.
        """
        q = self.inverse_kinematics(x)
        tau = self._evaluate(self.functions.inverse_dynamics, x, v, a)[0]
        margins, at_rest = self._margins(q), _still(v) & _still(a)
        _require_parallel(margins)
        _require_serial(margins, moving=~at_rest)
        chosen = _near(margins) & at_rest
        if not chosen.any():
            return tau
        holding = self.joint_inverse_dynamics(q, np.zeros(12), np.zeros(12))
        result: Array = np.where(chosen if tau.ndim == 1 else chosen[:, None], holding, tau)
        return result

    def joint_inverse_dynamics(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Motor torques τ, (N, 3), of a motion of all coordinates q, q̇, q̈, (N, 12) each.

        The motion must obey the constraints. Accurate in serial singularities too, where
        the platform's position, velocity and acceleration do not determine the others; by
        virtual work with the motor angles independent, whatever the model's formulation.
        Raises Singular in a parallel singularity.
        """
        tau = self._evaluate(self._joint_inverse_dynamics, q, dq, ddq)[0]
        _require_parallel(self._margins(np.asarray(q, dtype=float)))
        return tau

    def multipliers(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """λ, (N, 9), N: the force of each chain on the platform, eq. (37)."""
        margins = self._margins(self.inverse_kinematics(x))
        _require_parallel(margins)
        _require_serial(margins)
        return self._evaluate(self.functions.inverse_dynamics, x, v, a)[1]

    def forward_dynamics(self, x: ArrayLike, v: ArrayLike, tau: ArrayLike) -> Array:
        """Acceleration of the platform, (N, 3), under motor torques (N, 3)."""
        margins = self._margins(self.inverse_kinematics(x))
        _require_serial(margins)
        a = self._evaluate(self.functions.forward_dynamics, x, v, tau)[0]
        near = _near(margins)
        if not near.any():
            return a
        robust = self._evaluate(self._robust_functions.forward_dynamics, x, v, tau)[0]
        result: Array = np.where(near if a.ndim == 1 else near[:, None], robust, a)
        return result

    @cached_property
    def _robust_functions(self) -> DeltaFunctions:
        """In the formulation that keeps accelerations accurate near serial singularities."""
        return delta_functions(self.functions.terms, Multiplier())

    @cached_property
    def _joint_inverse_dynamics(self) -> ca.Function:
        """(q, q̇, q̈, p) -> τ, λ."""
        inverse = VirtualWork(MOTOR_ANGLES).inverse_dynamics(self.functions.mechanism)
        _, *x = inverse.mx_in()
        return ca.Function("joint_inverse_dynamics", x, list(inverse.call([ca.MX(0), *x])))

    def _margins(self, q: Array) -> Array:
        """N × 7: cos q_{k,3}, sin (q_{k,1} - q_{k,2}), volume of the bars' directions."""
        rows: Array = self.functions.margins(np.atleast_2d(q).T).full().T
        return rows

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
        margins = self._evaluate(self.functions.serial_distances, point)[0].reshape(2, 3)
        for k in range(3):
            if margins[0, k] < 0:
                return f"the bars of chain {k + 1} are too short to reach it sideways"
            if not margins[1, k] > 0:
                return f"arm and bars of chain {k + 1} cannot close there"
        return "the arms and bars are in a singular position there"


@lru_cache(maxsize=64)
def delta_model(robot: Robot, payload: float | None) -> DeltaModel:
    """The explicit model of a robot with a payload (kg): its numbers are made once."""
    return DeltaModel(robot, payload)


def _still(rate: ArrayLike) -> NDArray[np.bool]:
    """Whether a velocity or acceleration is zero, (N,) or one for all."""
    still: NDArray[np.bool] = np.all(np.atleast_2d(np.asarray(rate, dtype=float)) == 0, axis=1)
    return still


def _near(margins: Array) -> NDArray[np.bool]:
    """Whether a chain is near a serial singularity, (N,)."""
    near: NDArray[np.bool] = np.any(np.abs(margins[:, :6]) < NEAR, axis=1)
    return near


def _require_serial(margins: Array, moving: NDArray[np.bool] | bool = True) -> None:
    """Raise Singular at the first row that moves with a chain in a serial singularity."""
    singular = (np.abs(margins[:, :6]) < SERIAL_LIMIT) & np.atleast_1d(moving)[:, None]
    for row, column in np.argwhere(singular)[:1]:
        kind = Singularity.SIDEWAYS if column < 3 else Singularity.IN_LINE
        margin = float(np.broadcast_to(margins, (len(singular), 7))[row, column])
        raise Singular(kind, int(column) % 3 + 1, margin, f"point {row}")


def _require_parallel(margins: Array) -> None:
    """Raise Singular at the first row in a parallel singularity."""
    for row in np.flatnonzero(np.abs(margins[:, 6]) < PARALLEL_LIMIT)[:1]:
        raise Singular(Singularity.PARALLEL, None, float(margins[row, 6]), f"point {row}")


def _first(rows: Array, bad: NDArray[np.bool]) -> Array:
    point: Array = np.atleast_2d(rows)[int(np.argmax(bad))]
    return point
