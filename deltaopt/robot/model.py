"""The model of a Delta robot with a payload: kinematics and dynamics of many points at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache, singledispatch
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from deltaopt.codegen.vectorised import Checked, RowFunction
from deltaopt.curves.piecewise import Array, Truths
from deltaopt.dynamics.formulation import Formulation
from deltaopt.dynamics.lagrange import Explicit, Multiplier
from deltaopt.errors import Unreachable, in_words
from deltaopt.files.validated_record import Vector3
from deltaopt.mechanisms.delta.arm_loads import ArmLoad, CoulombFriction, ViscousFriction
from deltaopt.mechanisms.delta.functions import DeltaFunctions, delta_functions
from deltaopt.mechanisms.delta.mechanism import DeltaParameters
from deltaopt.robot.drive import Friction
from deltaopt.robot.energies import DIMENSIONS, delta_energies
from deltaopt.robot.guarded_functions import GuardedFunctions, guarded_functions
from deltaopt.robot.machine import Energies, Machine, Model
from deltaopt.robot.robot import Robot, as_delta
from deltaopt.robot.singular_points import DoubtfulPoints, rows_at, still
from deltaopt.settings import require_positive, require_type


def delta_parameters(robot: Robot, payload: float | None) -> DeltaParameters:
    """The parameters of the paper for a robot with a payload (kg; None for none).

    Lengths are halved; a link without an inertia in the robot file is a slender bar. What is
    rigidly joined is one body, so that it costs nothing: the elbow is part of the arm, whose mass,
    centre of mass and moment of inertia about that centre are those of both; rotor, brake and gear
    add the moment of inertia of their rotation to it; pins and tool are part of the platform, which
    only translates.
    """
    bars = robot.forearm
    tool_mass = (robot.tool and robot.tool.mass) or 0.0
    slender = bars.mass * bars.length**2 / 12
    I41, I42, I43 = bars.inertia or (slender, None, slender)
    return DeltaParameters(
        a1=robot.base_radius,
        a2=robot.upper_arm.length / 2,
        a3=bars.length / 2,
        a4=robot.platform_radius,
        m1=robot.platform.mass + 3 * (robot.platform.pins or 0.0) + tool_mass,
        m2=payload or 0.0,
        m4=bars.mass,
        I41=I41,
        I42=I42,
        I43=I43,
        loads=_loads(robot.drive.friction),
        **_arm_and_elbow(robot),
        **_components(("g", "g_y", "g_z"), robot.gravity_vector),
        **_components(("tool_x", "tool_y", "tool_z"), robot.tool_offset),
    )


def _loads(friction: Friction | None) -> tuple[ArmLoad, ...]:
    """The terms of friction that a drive names."""
    loads = list[ArmLoad]()
    if friction and friction.viscous:
        loads.append(ViscousFriction(friction.viscous))
    if friction and friction.coulomb and friction.speed:
        loads.append(CoulombFriction(friction.coulomb, friction.speed))
    return tuple(loads)


def _arm_and_elbow(robot: Robot) -> dict[str, Any]:
    """Upper arm, elbow and drive as one body; the drive's inertia is that of its rotation alone.

    Its mass, the moment of inertia about its centre of mass, and how far this is from the shaft,
    along the arm and across it: None for a₂ and 0.
    """
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
    return {"m3": mass, "I33": inertia, "b1": None if centred else along, "b2": across or None}


def _components(names: tuple[str, str, str], vector: Vector3) -> dict[str, Any]:
    """The components of a vector by their names; None for one that is zero, which needs no
    term."""
    return {name: value or None for name, value in zip(names, vector, strict=True)}


@dataclass(frozen=True)
class DeltaModel(Model):
    """Kinematics and dynamics of a robot with a payload (kg; None for none).

    ``formulation``: of the dynamics, eq. (39) by default. Arguments and results are arrays of N
    points, of shape (N, 3) for the platform and for the motors; a single point of shape (3,) gives
    a single result. Units: m, m/s, m/s², rad, N·m.

    Examples:
        >>> robot = deltaopt.load_robot("problems/robots/orsino.yaml")
        >>> model = deltaopt.DeltaModel(robot, payload=1.0)
        >>> q = model.inverse_kinematics((0.45, 0.0, 0.0))  # all twelve coordinates
        >>> model.forward_kinematics(q[3::3]).round(6).tolist()
        [0.45, 0.0, 0.0]
        >>> model.inverse_dynamics((0.45, 0.0, 0.0), (0, 0, 0), (0, 0, 0)).round(2).tolist()
        [1.87, 1.87, 1.87]
    """

    robot: Robot
    payload: float | None = None
    formulation: Formulation = field(default_factory=Explicit)

    def __post_init__(self) -> None:
        """Raise TypeError or ValueError for a robot that is none, and no mass."""
        require_type("robot", self.robot, Robot, "a Robot, such as load_robot returns")
        if self.payload:
            require_positive("payload", self.payload)

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
    def dimensions(self) -> Array:
        """Powers of length, mass and time of each parameter, (parameters, 3)."""
        terms = self.functions.terms
        of_loads = {name: of for load in terms.loads for name, of in load.dimensions.items()}
        return np.array([(DIMENSIONS | of_loads)[name] for name in terms.names])

    @property
    def mass(self) -> float:
        """The mass of all bodies of a kind, kg."""
        p = self.numbers
        return float(p.m1 + p.m2 + p.m3 + p.m4)

    @cached_property
    def energies(self) -> Energies | None:
        """None where a term of the model may act without bound, or moves what is not known."""
        return delta_energies(self.functions.mechanism, self.numbers)

    def with_multipliers(self) -> DeltaModel:
        """This robot and payload by eq. (37), model L_I."""
        return DeltaModel(self.robot, self.payload, Multiplier())

    @cached_property
    def numbers(self) -> DeltaParameters:
        """The parameters of the paper for this robot and payload, by name."""
        return delta_parameters(self.robot, self.payload)

    def inverse_kinematics(self, x: ArrayLike) -> Array:
        """Coordinates q, (N, 12), m and rad, with the tool's point at x, (N, 3), m.

        Every elbow is on the outer side of its chain: the industrial assembly mode. Raises
        Unreachable where there is no such q.
        """
        (q,), failed = self._checked(self._rows.inverse_kinematics, x)
        if failed is not None:
            self._require_reach(x, failed)
        return q

    def forward_kinematics(self, theta: ArrayLike) -> Array:
        """Position x of the tool's point, (N, 3), m, for motor angles, (N, 3), rad.

        It is the lower of the two solutions. Raises Unreachable where the loops cannot close.
        """
        (x,), failed = self._checked(self._rows.forward_kinematics, theta)
        if failed is not None:
            angles = np.atleast_2d(np.asarray(theta, dtype=float))[np.argmax(failed)]
            raise Unreachable(
                f"motor angles {in_words(angles)} rad: the bars do not meet there",
                np.flatnonzero(failed),
            )
        return x

    def alignments(self, x: ArrayLike) -> Array:
        """Squared distance of each chain from its serial singularity with the platform at x.

        It is sin² (q_{k,1} - q_{k,2}), (N, 3), without unit: 0 where arm and bars are in line, the
        chain folded or stretched. x: (N, 3), m.
        """
        (distances,) = self._rows.serial_distances(x, parameters=self.parameters)
        return distances[..., 3:]

    def closes(self, x: ArrayLike) -> Truths:
        """Whether all chains close, away from serial singularities, with the platform at x, (N,).

        x: (N, 3), m.
        """
        (distances,) = self._rows.serial_distances(x, parameters=self.parameters)
        return np.asarray((distances > 0).all(axis=-1))  # False where not a number

    def motion(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> tuple[Array, Array, Array]:
        """All coordinates q, q̇, q̈, (N, 12) each, of a motion x, v, a of the platform.

        Raises Unreachable, and Singular in a serial singularity.
        """
        (q, dq, ddq), failed = self._checked(self._rows.motion, x, v, a)
        if failed is not None:
            self._doubtful(x, failed).require_serial()
        return q, dq, ddq

    def inverse_dynamics(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Motor torques τ, (N, 3), N·m, of a motion x, v, a of the platform; eq. (39) by default.

        Raises Unreachable, and Singular in a parallel singularity or, unless at rest, in a serial
        one; for the motions that are possible there see ``joint_inverse_dynamics``.
        """
        (tau,), failed = self._checked(self._rows.torques, x, v, a)
        if failed is None:
            return tau
        points = self._doubtful(x, failed)
        at_rest = still(points.of(v)) & still(points.of(a))
        points.require_parallel()
        points.require_serial(moving=~at_rest)
        chosen = points.near & at_rest
        if chosen.any():
            zero = np.zeros(12)
            holding = self.joint_inverse_dynamics(points.q[chosen], zero, zero)
            np.atleast_2d(tau)[points.places[chosen]] = holding
        chosen = points.near & ~at_rest
        if chosen.any():
            places = points.places[chosen]
            motion = self.motion(*(rows_at(argument, places) for argument in (x, v, a)))
            np.atleast_2d(tau)[places] = self.joint_inverse_dynamics(*motion)
        return tau

    def mass_matrix(self, x: ArrayLike) -> Array:
        """The matrix M of Jᵀ τ = M a at rest without gravity, (N, 3, 3) or (3, 3), kg: ½ vᵀ M v is
        the kinetic energy, drives included, with the tool's point at x, m.

        Raises Unreachable, and Singular in a singularity.
        """
        at_rest = np.zeros(3)
        holding = self.inverse_dynamics(x, at_rest, at_rest)
        torques = [self.inverse_dynamics(x, at_rest, a) - holding for a in np.eye(3)]
        transposed: Array = np.swapaxes(self.jacobian(x), -1, -2)
        return np.asarray(transposed @ np.stack(torques, axis=-1))

    def joint_inverse_dynamics(self, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
        """Motor torques τ, (N, 3), N·m, of a motion of all coordinates q, q̇, q̈, (N, 12) each.

        The motion must obey the constraints. The torques are accurate in serial singularities too,
        where the motion of the platform does not determine that of the chains. They are found by
        virtual work with the motor angles as independent coordinates, whatever the model's
        formulation. Raises Singular in a parallel singularity.
        """
        (tau,), failed = self._checked(self._rows.joint_torques, q, dq, ddq)
        if failed is not None:
            places = np.flatnonzero(failed)
            DoubtfulPoints(places, rows_at(q, places)).require_parallel()
        return tau

    def multipliers(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Multipliers λ of eq. (37), (N, 9), N: the force of each chain on the platform.

        Raises Unreachable, and Singular in serial and parallel singularities.
        """
        (lam,), failed = self._checked(self._rows.multipliers, x, v, a)
        if failed is not None:
            points = self._doubtful(x, failed)
            points.require_parallel()
            points.require_serial()
        return lam

    def forward_dynamics(self, x: ArrayLike, v: ArrayLike, tau: ArrayLike) -> Array:
        """Acceleration of the platform, (N, 3), m/s², at x, v under motor torques, (N, 3), N·m.

        Raises Unreachable, and Singular in a serial singularity.
        """
        (a,), failed = self._checked(self._rows.accelerations, x, v, tau)
        if failed is None:
            return a
        points = self._doubtful(x, failed)
        points.require_serial()
        if points.near.any():
            places = points.places[points.near]
            near = (rows_at(argument, places) for argument in (x, v, tau))
            # Those of model L_I stay accurate near serial singularities.
            robust = guarded_functions(delta_functions(self.functions.terms, Multiplier()))
            (np.atleast_2d(a)[places],) = self._checked(robust.accelerations, *near)[0]
        return a

    @cached_property
    def _rows(self) -> GuardedFunctions:
        return guarded_functions(self.functions)

    def _checked(self, function: RowFunction, *arguments: ArrayLike) -> Checked:
        return function.with_failures(*arguments, parameters=self.parameters)

    def _doubtful(self, x: ArrayLike, failed: Truths) -> DoubtfulPoints:
        """The points whose guards failed. Raises Unreachable."""
        places = np.flatnonzero(failed)
        (q,), unreached = self._checked(self._rows.inverse_kinematics, rows_at(x, places))
        if unreached is not None:
            everywhere = np.zeros_like(failed)
            everywhere[places] = unreached
            self._require_reach(x, everywhere)
        return DoubtfulPoints(places, q)

    def _require_reach(self, x: ArrayLike, failed: Truths) -> None:
        point = np.broadcast_to(np.asarray(x, dtype=float), (len(failed), 3))[np.argmax(failed)]
        what = "the tool's point" if any(self.robot.tool_offset) else "the platform"
        raise Unreachable(
            f"{what} cannot be at {in_words(point)} m: {self._obstacle(point)}",
            np.flatnonzero(failed),
        )

    def _obstacle(self, point: Array) -> str:
        """A sentence that says which chain cannot reach a point, and why."""
        (distances,) = self._rows.serial_distances(point, parameters=self.parameters)
        margins = distances.reshape(2, 3)
        for k in range(3):
            if margins[0, k] < 0:
                return f"the bars of chain {k + 1} are too short to reach it sideways"
            if not margins[1, k] > 0:
                return f"arm and bars of chain {k + 1} cannot close there"
        return "the arms and bars are in a singular position there"


@singledispatch
def new_model(robot: Machine, payload: float | None) -> Model:
    """The model of a robot with a payload (kg; None for none) by eq. (39).

    A robot that is no Delta registers its own: ``new_model.register``. Raises TypeError for one
    that has none.
    """
    raise TypeError(f"{robot.name} is a {type(robot).__name__}, of which there is no model")


new_model.register(Robot, DeltaModel)


@lru_cache(maxsize=64)
def model_of(robot: Machine, payload: float | None) -> Model:
    """The model of a robot with a payload (kg) by eq. (39), made once in a process."""
    return new_model(robot, payload)


def delta_model(robot: Machine, payload: float | None) -> DeltaModel:
    """The model of a Delta, for what knows no other robot, such as another program's format.

    Raises SceneError for another robot.
    """
    model = model_of(as_delta(robot), payload)
    assert isinstance(model, DeltaModel)
    return model
