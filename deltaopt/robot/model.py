"""The model of a Delta robot with a payload: kinematics and dynamics of many points at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from deltaopt.codegen.vectorised import RowFunction, evaluate_rows
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.dynamics.virtual_work import VirtualWork
from deltaopt.errors import Singular, Singularity, Unreachable, in_words
from deltaopt.files.validated_record import Vector3
from deltaopt.mechanisms.delta.functions import DeltaFunctions, delta_functions
from deltaopt.mechanisms.delta.mechanism import MOTOR_ANGLES, DeltaParameters
from deltaopt.robot.drive import Friction
from deltaopt.robot.robot import Robot

Array = NDArray[np.float64]

NEAR = 1e-2
"""Distance ε from a serial singularity, cos q_{k,3} or sin (q_{k,1} - q_{k,2}), below which other
equations than eq. (55) are used, because its error grows as ε⁻⁵ in accelerations and as ε⁻¹ in
torques at rest (docs/stability.md): model L_I for the former, motor angles as independent
coordinates for the latter."""
SERIAL_LIMIT = 1e-6
"""Distance from a serial singularity below which a moving platform raises Singular. Torques have
three correct digits there at best, for the platform's position determines only the square of the
distance."""
PARALLEL_LIMIT = 1e-12
"""Distance from a parallel singularity, a volume without unit, below which torques raise Singular.
They have four correct digits there."""


def delta_parameters(robot: Robot, payload: float | None) -> DeltaParameters:
    """The parameters of the paper for a robot with a payload (kg; None for none).

    Lengths are halved; a link without an inertia in the robot file is a slender bar. What is
    rigidly joined is one body, so that it costs nothing: the elbow is part of the arm, whose mass,
    centre of mass and moment of inertia about that centre are those of both; rotor, brake and gear
    add the moment of inertia of their rotation to it; pins and tool are part of the platform, which
    only translates.
    """
    bars, gravity = robot.forearm, _gravity(robot)
    friction = robot.drive.friction or Friction(viscous=0.0)
    tool_mass = (robot.tool and robot.tool.mass) or 0.0
    slender = bars.mass * bars.length**2 / 12
    I41, I42, I43 = bars.inertia or (slender, None, slender)
    offset = _components(robot.tool_offset)
    arm = _arm_and_elbow(robot)
    return DeltaParameters(
        a1=robot.base_radius,
        a2=robot.upper_arm.length / 2,
        a3=bars.length / 2,
        a4=robot.platform_radius,
        m1=robot.platform.mass + 3 * (robot.platform.pins or 0.0) + tool_mass,
        m2=payload,
        m3=arm.mass,
        m4=bars.mass,
        I33=arm.inertia,
        I41=I41,
        I42=I42,
        I43=I43,
        g=gravity[0],
        g_y=gravity[1],
        g_z=gravity[2],
        b1=arm.along,
        b2=arm.across,
        viscous=friction.viscous or None,
        coulomb=friction.coulomb or None,
        coulomb_speed=friction.speed if friction.coulomb else None,
        tool_x=offset[0],
        tool_y=offset[1],
        tool_z=offset[2],
    )


@dataclass(frozen=True)
class _Arm:
    """All that turns with an arm: its mass, kg, and the moment of inertia about its centre of mass,
    kg·m². ``along``, ``across``: the centre of mass from the shaft, m; None for a₂ and 0."""

    mass: float
    inertia: float
    along: float | None
    across: float | None


def _arm_and_elbow(robot: Robot) -> _Arm:
    """Upper arm, elbow and drive as one body; the drive's inertia is that of its rotation alone."""
    arm, elbow = robot.upper_arm, robot.elbow
    inertia = arm.mass * arm.length**2 / 12 if arm.inertia is None else arm.inertia
    inertia += robot.drive.inertia or 0.0
    along, across = arm.centre or (arm.length / 2, 0.0)
    mass = arm.mass
    if elbow is not None and elbow.mass:
        mass += elbow.mass
        reduced = arm.mass * elbow.mass / mass  # Steiner: both about the common centre of mass
        inertia += reduced * ((arm.length - along) ** 2 + across**2)
        along, across = along + elbow.mass / mass * (arm.length - along), arm.mass / mass * across
    centred = along == arm.length / 2
    return _Arm(mass, inertia, None if centred else along, across or None)


def _gravity(robot: Robot) -> tuple[float | None, float | None, float | None]:
    """Components of gravity, m/s²; None for one that is zero."""
    gravity = robot.gravity
    return _components(gravity if isinstance(gravity, tuple) else (gravity, 0.0, 0.0))


def _components(vector: Vector3) -> tuple[float | None, float | None, float | None]:
    """The components of a vector; None for one that is zero, which needs no term."""
    x, y, z = vector
    return x or None, y or None, z or None


@dataclass(frozen=True)
class DeltaModel:
    """Kinematics and dynamics of a robot with a payload (kg; None for none).

    ``formulation``: of the dynamics, eq. (39) by default. Arguments and results are arrays of N
    points, of shape (N, 3) for the platform and for the motors; a single point of shape (3,) gives
    a single result. Units: m, m/s, m/s², rad, N·m.
    """

    robot: Robot
    payload: float | None = None
    formulation: Formulation = field(default_factory=Explicit)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the arguments alone: other processes derive the functions themselves."""
        return DeltaModel, (self.robot, self.payload, self.formulation)

    @cached_property
    def functions(self) -> DeltaFunctions:
        """Kinematics and dynamics as CasADi functions."""
        return delta_functions(self.numbers.terms(), self.formulation)

    @cached_property
    def parameters(self) -> Array:
        """Values of the mechanism's parameters p, in the order of ``Mechanism.parameters``."""
        return np.asarray(self.numbers.values())

    @cached_property
    def numbers(self) -> DeltaParameters:
        """The parameters of the paper for this robot and payload, by name."""
        return delta_parameters(self.robot, self.payload)

    def inverse_kinematics(self, x: ArrayLike) -> Array:
        """Coordinates q, (N, 12), m and rad, for the platform's centre at x, (N, 3), m.

        Every elbow is on the outer side of its chain: the industrial assembly mode. Raises
        Unreachable where there is no such q.
        """
        x = np.asarray(x, dtype=float)
        q = self._evaluate(self.functions.inverse_kinematics, x)[0]
        self._require_reach(x, q)
        return q

    def forward_kinematics(self, theta: ArrayLike) -> Array:
        """Position x of the platform's centre, (N, 3), m, for motor angles, (N, 3), rad.

        It is the lower of the two solutions. Raises Unreachable where the loops cannot close.
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
        """Squared distance of each chain from its serial singularity with the platform at x.

        It is sin² (q_{k,1} - q_{k,2}), (N, 3), without unit: 0 where arm and bars are in line, the
        chain folded or stretched. x: (N, 3), m.
        """
        x = np.asarray(x, dtype=float)
        (distances,) = _serial_distances(self.functions)(
            np.atleast_2d(x), parameters=self.parameters
        )
        return distances[0, 3:] if x.ndim == 1 else distances[:, 3:]

    def motion(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> tuple[Array, Array, Array]:
        """All coordinates q, q̇, q̈, (N, 12) each, of a motion x, v, a of the platform.

        Raises Unreachable, and Singular in a serial singularity.
        """
        margins = self._margins(self.inverse_kinematics(x))
        _require_serial(margins)
        q, dq, ddq = self._evaluate(self.functions.motion, x, v, a)
        return q, dq, ddq

    def inverse_dynamics(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Motor torques τ, (N, 3), N·m, of a motion x, v, a of the platform; eq. (39) by default.

        Raises Unreachable, and Singular in a parallel singularity or, unless at rest, in a serial
        one; for the motions that are possible there see ``joint_inverse_dynamics``.
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
        """Motor torques τ, (N, 3), N·m, of a motion of all coordinates q, q̇, q̈, (N, 12) each.

        The motion must obey the constraints. The torques are accurate in serial singularities too,
        where the motion of the platform does not determine that of the chains. They are found by
        virtual work with the motor angles as independent coordinates, whatever the model's
        formulation. Raises Singular in a parallel singularity.
        """
        tau = self._evaluate(self._joint_inverse_dynamics, q, dq, ddq)[0]
        _require_parallel(self._margins(np.asarray(q, dtype=float)))
        return tau

    def multipliers(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Multipliers λ of eq. (37), (N, 9), N: the force of each chain on the platform.

        Raises Unreachable, and Singular in serial and parallel singularities.
        """
        margins = self._margins(self.inverse_kinematics(x))
        _require_parallel(margins)
        _require_serial(margins)
        return self._evaluate(self.functions.inverse_dynamics, x, v, a)[1]

    def forward_dynamics(self, x: ArrayLike, v: ArrayLike, tau: ArrayLike) -> Array:
        """Acceleration of the platform, (N, 3), m/s², at x, v under motor torques, (N, 3), N·m.

        Raises Unreachable, and Singular in a serial singularity.
        """
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
        """The functions of model L_I, whose accelerations stay accurate near serial
        singularities."""
        return delta_functions(self.functions.terms, Multiplier())

    @cached_property
    def _joint_inverse_dynamics(self) -> ca.Function:
        """(q, q̇, q̈, p) -> τ, λ."""
        inverse = VirtualWork(MOTOR_ANGLES).inverse_dynamics(self.functions.mechanism)
        _, *x = inverse.mx_in()
        return ca.Function("joint_inverse_dynamics", x, list(inverse.call([ca.MX(0), *x])))

    def _margins(self, q: Array) -> Array:
        """Signed distances from singularities, (N, 7): cos q_{k,3} and sin (q_{k,1} - q_{k,2}) of
        the three chains, then the volume spanned by the bars' directions."""
        if q.size == 0:  # CasADi takes no points for one of zeros
            return np.zeros((0, 7))
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
        """A sentence that says which chain cannot reach a point, and why."""
        margins = self._evaluate(self.functions.serial_distances, point)[0].reshape(2, 3)
        for k in range(3):
            if margins[0, k] < 0:
                return f"the bars of chain {k + 1} are too short to reach it sideways"
            if not margins[1, k] > 0:
                return f"arm and bars of chain {k + 1} cannot close there"
        return "the arms and bars are in a singular position there"


@lru_cache(maxsize=64)
def delta_model(robot: Robot, payload: float | None) -> DeltaModel:
    """The model of a robot with a payload (kg) by eq. (39), made once in a process."""
    return DeltaModel(robot, payload)


@lru_cache(maxsize=16)
def _serial_distances(functions: DeltaFunctions) -> RowFunction:
    """(x, p) -> cos² q_{k,3}, sin² (q_{k,1} - q_{k,2}) of the chains, for many points at once."""
    return RowFunction(functions.serial_distances)


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
