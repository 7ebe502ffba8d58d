"""What planning and verification ask of a robot, and of its model with a payload.

A `Machine` is the record of a robot: its drives, ranges and sizes. A `Model` is the same with a
payload as functions of numbers. The Delta is a `Robot` with a `DeltaModel`; another robot is a
`Machine` of its own, whose model is given to ``new_model`` of ``robot.model``. It has three
actuators, rotary or linear: where it says "torque" and "angle" here, a linear one has forces and
positions, in N and m.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Annotated

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError
from deltaopt.files.units import LENGTH
from deltaopt.files.validated_record import (
    Number,
    Positive,
    Record,
    Vector3,
    optional,
    per_motor,
    vector3,
)
from deltaopt.mechanisms.functions import Functions
from deltaopt.robot.drive import Drive
from deltaopt.robot.joints import Joints
from deltaopt.robot.tool import Tool


class Workspace(Record):
    """Where the tool's point may be: ``depth`` [least, largest] below the base, ``radius``, in m.

    ``depth`` is along the base's axis, our x; ``radius`` is the largest distance from that axis.
    None where there is no such limit.
    """

    depth: Annotated[tuple[Number, Number], LENGTH] | None = optional(
        "two coordinates [least, largest] in m, the first the lesser"
    )
    radius: Annotated[Positive, LENGTH] | None = None

    def require_consistent(self) -> None:
        if self.depth is not None and self.depth[0] >= self.depth[1]:
            expected = str(type(self).model_fields["depth"].description)
            raise SceneError(None, "depth", self.depth, expected)
        if self.depth is not None and self.depth[1] <= 0:
            expected = "depths in m below the base, positive: x points down from its centre"
            raise SceneError(None, "depth", self.depth, expected)


class Machine(Record):
    """A robot as planning sees it: three drives move a platform that only translates.

    Its record has the fields that are declared below, in an order of its own.
    """

    if TYPE_CHECKING:  # the record of each robot has them, in the order of its file
        name: str
        tool: Tool | None
        drive: Drive
        joints: Joints | None
        workspace: Workspace | None

    @property
    def units(self) -> Mapping[str, str]:
        """How units of rotary drives read for these: empty, or such as {"N·m": "N"}."""
        return {}

    def unit(self, of_rotary: str) -> str:
        """A unit of rotary drives, such as "N·m", as the unit of these drives."""
        return self.units.get(of_rotary, of_rotary)

    @property
    def has_links(self) -> bool:
        """Whether its links can be kept clear of bodies, and are drawn and measured."""
        return False

    @property
    def gravity_vector(self) -> Vector3:
        """Acceleration of gravity in the base's frame, m/s²."""
        raise NotImplementedError

    @property
    def size(self) -> float:
        """A length that is its own, m: what is planned and verified is known to shares of it."""
        raise NotImplementedError

    @property
    def lever(self) -> float:
        """How far a drive moves what it drives for a unit of its own, m per rad or m."""
        raise NotImplementedError

    @property
    def reach(self) -> float:
        """How far the platform can be below the base, m, about."""
        raise NotImplementedError

    @property
    def farthest(self) -> float:
        """A distance from the base's centre that the tool's point never exceeds, m."""
        raise NotImplementedError

    @property
    def width(self) -> float:
        """How far the chains' reach is moved outwards, m."""
        raise NotImplementedError

    @property
    def platform_mass(self) -> float:
        """Of the platform without payload, kg, about."""
        raise NotImplementedError

    def on_axis(self, depth: float) -> Array:
        """The tool's point, (3,), m, with the platform on the robot's axis, at a depth from 0 to 1
        of where it can be."""
        raise NotImplementedError

    @property
    def tool_offset(self) -> Vector3:
        """From the platform's centre to the tool's point, m."""
        return (self.tool and self.tool.offset) or (0.0, 0.0, 0.0)

    @property
    def torque_limits(self) -> Vector3:
        """The largest torque of each motor at its arm, N·m."""
        return per_motor(self.drive.torque)

    @property
    def speed_limits(self) -> Vector3 | None:
        """The largest speed of each arm, rad/s; None if the drives have no speed limit."""
        speed, curve = self.drive.speed, self.drive.torque_curve
        if curve is None:
            return None if speed is None else per_motor(speed)
        last = curve[-1][0]
        return vector3(min(each, last) for each in per_motor(last if speed is None else speed))

    @property
    def torque_rate_limits(self) -> Vector3 | None:
        """The largest rate of each motor's torque at its arm, N·m/s; None if not limited."""
        return None if self.drive.torque_rate is None else per_motor(self.drive.torque_rate)

    @property
    def rms_torque(self) -> Vector3 | None:
        """The rated torque of each motor at its arm, N·m, for the RMS; None if not named."""
        return None if self.drive.rms_torque is None else per_motor(self.drive.rms_torque)


@dataclass(frozen=True)
class Energies:
    """What is known of a robot's kinetic energy and of what acts on it, for a lower bound.

    Each chain has an arm, which its actuator moves, and bars from the arm's end to the platform.
    ``arm_inertia``: of an arm, kg·m² or kg; ``arm``: by how much its end moves for a unit of the
    actuator, m; ``mass``: of platform, tool and payload, kg. ``same``, ``opposite``: of the bars of
    one chain, kg: their kinetic energy is at least (``same`` |u + w|² + ``opposite`` |u - w|²) / 2,
    with u and w the velocities of their ends. ``bars``: mass of all bars, kg. ``gravity``: largest
    force of gravity on each actuator, (3,), N·m or N. ``pushing``, ``braking``, ``viscous``: the
    most that else acts on an arm along its motion and against it, and what more with its speed.
    """

    arm_inertia: float
    arm: float
    mass: float
    same: float
    opposite: float
    bars: float
    gravity: Array
    pushing: float = 0.0
    braking: float = 0.0
    viscous: float = 0.0


class Model(ABC):
    """Kinematics and dynamics of a robot with a payload (kg; None for none).

    Arguments and results are arrays of N points, of shape (N, 3) for the platform and for the
    actuators; a single point of shape (3,) gives a single result. Units: m, m/s, m/s², those of
    the actuators.
    """

    robot: Machine
    payload: float | None

    @property
    @abstractmethod
    def functions(self) -> Functions:
        """Kinematics and dynamics as CasADi functions."""

    @property
    @abstractmethod
    def parameters(self) -> Array:
        """Values of the mechanism's parameters p."""

    @property
    @abstractmethod
    def dimensions(self) -> Array:
        """Powers of length, mass and time of each parameter, (parameters, 3)."""

    @property
    @abstractmethod
    def mass(self) -> float:
        """Of the bodies that move, kg, about: a unit of mass."""

    @property
    @abstractmethod
    def energies(self) -> Energies | None:
        """What a lower bound on durations follows from; None where something may act without
        bound, or is not known: then there is no bound."""

    @cached_property
    def layers(self) -> tuple[tuple[float, float], ...]:
        """Of each part of the actuators' forces that changes its sign within a moment, as Coulomb
        friction does, the numbers of ``Functions.layers``."""
        found = self.functions.layers(ca.SX(self.parameters))
        return tuple((float(speed), float(strength)) for speed, strength in found)

    @abstractmethod
    def with_multipliers(self) -> Model:
        """This model by eq. (37), which shares no elimination of constraints with eq. (39)."""

    @abstractmethod
    def inverse_kinematics(self, x: ArrayLike) -> Array:
        """All coordinates q, (N, n), with the tool's point at x, (N, 3). Raises Unreachable."""

    @abstractmethod
    def forward_kinematics(self, theta: ArrayLike) -> Array:
        """The tool's point, (N, 3), for the actuators' positions. Raises Unreachable."""

    @abstractmethod
    def alignments(self, x: ArrayLike) -> Array:
        """Squared distance of each chain from its serial singularity, (N, 3)."""

    @abstractmethod
    def motion(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> tuple[Array, Array, Array]:
        """All coordinates q, q̇, q̈, (N, n) each, of a motion x, v, a of the platform.

        Raises Unreachable, and Singular in a serial singularity.
        """

    def jacobian(self, x: ArrayLike) -> Array:
        """The matrix J of θ̇ = J v, (N, 3, 3) or (3, 3), rad/m, with the tool's point at x, m.

        Raises Unreachable, and Singular in a serial singularity.
        """
        at_rest, motors = np.zeros(3), self.functions.motors
        rates = [self.motion(x, v, at_rest)[1][..., motors] for v in np.eye(3)]
        return np.stack(rates, axis=-1)

    @abstractmethod
    def inverse_dynamics(self, x: ArrayLike, v: ArrayLike, a: ArrayLike) -> Array:
        """Forces of the actuators, (N, 3), of a motion x, v, a. Raises Unreachable, Singular."""
