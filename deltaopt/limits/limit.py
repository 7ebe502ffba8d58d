"""What a limit is: a quantity of the motion at an instant, and its bounds.

A limit is one file of this folder. It says how its quantity follows from the motion and where its
numbers stand in the robot's file, the scene's, or in both; derivatives, normalisation, safe
slowing, charts and verification follow from that and are written once, elsewhere.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any, Protocol, TypeVar

import casadi as ca
import numpy as np
from numpy.polynomial import Polynomial

from deltaopt.curves.piecewise import Array, Index
from deltaopt.files.validated_record import Vector3, described
from deltaopt.mechanisms.instant import Instant as Instant
from deltaopt.robot.machine import Machine
from deltaopt.robot.solids import Convex, Solid

SX = ca.SX
Along = TypeVar("Along", Polynomial, Array)
"""A quantity of a motion over time: as a polynomial, or by its values at instants."""
Numbers = tuple[float, ...]
"""The numbers of one item of a limit, in the order of its parameters."""
_TIED = 1e-9
"""By which values may differ by rounding, shares of a limit: as second differences of a table."""


class Described(Protocol):
    """What a limit may read of a scene: robot, payload (kg; the largest and the least, if it
    varies), the points that are known of start, goal and the way (m), bodies, and its own key."""

    payload: float | None
    least_payload: float | None
    tube: float | None
    """How far it may be from the path that is given, m; None if it stays on it, if any."""

    @property
    def robot(self) -> Machine: ...
    @property
    def placed_points(self) -> tuple[Vector3, ...]: ...

    @property
    def columns(self) -> tuple[()] | tuple[Column, Column]:
        """The cylinders about start and goal in which the tool approaches; none without."""

    @property
    def kept_out(self) -> Sequence[Convex]:
        """What the tool's point must stay out of: keep-out bodies grown by the tool."""

    @property
    def least_clearance(self) -> float:
        """How far it must stay out of these, m."""

    @property
    def kept_links(self) -> Sequence[KeptLink]:
        """Which arms and forearms are planned to keep clear of which bodies."""

    @property
    def axis_of_tube(self) -> Array:
        """That path: polynomials over shares from 0 to 1 of its pieces, (pieces, powers, 3), m."""

    def given(self, key: str) -> Any:
        """What the scene says under ``limits`` and this key; None if nothing."""


@dataclass(frozen=True)
class Column:
    """A vertical cylinder about an end of the motion: its axis at ``y``, ``z``, its ``radius``, and
    the depth ``level`` at which it ends upwards; all in m, depths down from the base's centre."""

    y: float
    z: float
    radius: float
    level: float


@dataclass(frozen=True)
class KeptLink:
    """A link that keeps clear of a body: 0 for arm 1, 1 for forearm 1, 2 for arm 2, and so on; and
    the least distance of its line, m."""

    link: int
    body: Solid
    least: float


@dataclass(frozen=True)
class Bounds:
    """Lower and upper bound of a quantity, None where there is none, and its natural ``scale``.

    Two bounds are ``scale`` away from their middle, and an upper bound alone is its own scale.

    ``out_of_reach``: whether a quantity with one bound cannot get as far as two scales from it on
    the permitted side. A norm with an upper bound cannot: it is never below 0, one scale away. A
    method that prefers rows with two sides may then put the missing bound there.
    """

    lower: SX | None
    upper: SX | None
    scale: SX
    out_of_reach: bool = False

    @classmethod
    def symmetric(cls, limit: SX) -> Bounds:
        """-limit ≤ quantity ≤ limit."""
        return cls(-limit, limit, limit)

    @classmethod
    def between(cls, lower: SX, upper: SX) -> Bounds:
        """lower ≤ quantity ≤ upper."""
        return cls(lower, upper, (upper - lower) / 2)

    @classmethod
    def at_most(cls, limit: SX, *, out_of_reach: bool = False) -> Bounds:
        """quantity ≤ limit, a limit greater than 0."""
        return cls(None, limit, limit, out_of_reach)

    @classmethod
    def at_least(cls, limit: SX, scale: float, *, out_of_reach: bool = False) -> Bounds:
        """quantity ≥ limit, which may be 0."""
        return cls(limit, None, SX(scale), out_of_reach)

    def beyond(self, quantity: SX) -> list[SX]:
        """By how much the quantity exceeds its upper and lower bound, as shares of ``scale``."""
        upper = [] if self.upper is None else [(quantity - self.upper) / self.scale]
        lower = [] if self.lower is None else [(self.lower - quantity) / self.scale]
        return upper + lower

    def normalised(self, quantity: SX) -> SX:
        """The quantity with its lower bound at -1 and its upper bound at 1."""
        if self.lower is not None and self.upper is not None:
            middle = (self.lower + self.upper) / 2
            return (quantity - middle) / self.scale
        if self.lower is not None:
            return -1 + (quantity - self.lower) / self.scale
        return 1 + (quantity - self.scale) / self.scale


@dataclass(frozen=True)
class Key:
    """A key under ``limits`` in a scene file: its name, and its type for pydantic, a number with
    its ``Quantity`` and range, which also say what is expected."""

    name: str
    type: Any

    @property
    def expected(self) -> str:
        """What the value is expected to be."""
        return str(described(self.type))


class OwnMeasure(Enum):
    """What verification finds by code of its own, sure between samples, of places of the motion."""

    CLEARANCE = auto()
    TUBE = auto()
    LINKS = auto()


class Limit:
    """A limit: stateless, so that scenes with the same limits share compiled code.

    ``name`` and ``unit``: of its quantity. ``quantity``: which attribute of motions it is; of no
    account where ``measure`` says otherwise. ``subject``: what has one each, such as a motor.
    ``order``: the highest derivative of position that the quantity depends on, 0 for positions, 2
    for accelerations and torques, 3 for jerk and rates of torques. ``powers``: of the speed, of
    which it is a polynomial: its rows are those at rest at the same place and a part that grows
    with each of these powers, torques as squares; 1 for a speed, 2 for a torque, (1, 2) for their
    sum. None if it is no polynomial, or where that is not known: such motions are slowed by trial.
    ``key``: where a scene gives it, None if it cannot. ``robot_key``: where the robot's file gives
    it; None if a scene may give it too. ``promised``: whether a verified motion keeps it; otherwise
    it is a margin that the planner keeps for its own sake.

    What holds of few limits is said by those: ``own_measure``: which measure of verification judges
    it instead of ``measure``. ``slid_along``: whether it is one of position along which the best
    motion may slide, not touch it at an instant alone, so that room that a mesh leaves there costs
    time. ``has_ridges``: whether the size of its rows may be largest at a kink, where the nearest
    of some places changes.
    """

    name: str
    unit: str
    quantity: str
    subject: str
    order: int
    powers: tuple[int, ...] | None = None
    key: Key | None = None
    robot_key: str | None = None
    promised: bool = True
    own_measure: OwnMeasure | None = None
    slid_along: bool = False
    has_ridges: bool = False

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self)

    def __hash__(self) -> int:
        return hash(type(self))

    def subjects(self, number: int) -> list[str]:
        """What each of so many quantities is of: "motor 1" and so on, "tool" of a single one."""
        if number == 1:
            return [self.subject]
        return [f"{self.subject} {k}" for k in range(1, number + 1)]

    def items(self, scene: Described) -> Sequence[Numbers]:
        """The numbers of each of its items in a scene, none where the limit does not exist.

        Here what is under its key in the scene or, without one, in the robot's file: a number or
        several. Raises SceneError where the scene contradicts the robot.
        """
        if self.key is not None:
            given = scene.given(self.key.name)
        else:
            given = scene.robot
            for part in (self.robot_key or "").split("."):
                given = getattr(given, part, None)
        if given is None:
            return []
        return [tuple(given) if isinstance(given, Sequence) else (given,)]

    def bounds(self, numbers: SX) -> Bounds:
        """Of ``measure``: here plus and minus the number, or a number for each."""
        return Bounds.symmetric(numbers)

    def measure(self, motion: Instant, numbers: SX) -> SX:
        """The quantity as people read it, in ``unit``."""
        measure: SX = getattr(motion, self.quantity)
        return measure

    def rows(self, motion: Instant, numbers: SX) -> SX:
        """The quantity as smooth rows, normalised: lower bounds at -1, upper bounds at 1."""
        return self.bounds(numbers).normalised(self.measure(motion, numbers))


class ConvexLimit(Limit):
    """A limit whose measure is a convex function of the position alone, with lower bounds.

    Tangent planes then bound it from below, so that it is known between samples. All rows are one
    function of the position and of numbers of their own, as many for each, one row's after the
    other's: it is derived and compiled once for all of them.
    """

    def edge_radius(self, own: Array) -> float:
        """Least radius of curvature of the places that are at the bound of a row, m, by its
        numbers."""
        raise NotImplementedError

    def faces(self, own: Array) -> Sequence[Array]:
        """The numbers of the faces of a row's body, from its own: of convex bodies without edges,
        each of which contains the whole body, so that what is clear of one of them is clear of the
        body. All that is outside of the body is outside of one of them."""
        raise NotImplementedError

    def opened(self, own: Array, faces: Collection[int]) -> Array | None:
        """The numbers of a row's body as if it went on for ever beyond some of its faces, by their
        indices: without their edges. None where no numbers describe that."""
        return None


class PhasedLimit(Limit):
    """A limit of the position whose numbers differ from phase to phase of a motion, and whose rows
    are convex functions of the place, and polynomials of the time where the position is one."""

    def numbers_in_phases(self, numbers: Array) -> Sequence[Array]:
        """The numbers in each phase, from those of the scene."""
        raise NotImplementedError

    def along(self, position: Iterable[Along], numbers: Array) -> tuple[Along, ...]:
        """The rows of a position, three polynomials in m over s or values of them, m, with numbers
        of a phase."""
        raise NotImplementedError


class DividedLimit(Limit):
    """A limit of the position that permits the union of several regions, which a motion passes in
    order, such as tubes about the stretches of a path. Each is permitted by this limit with other
    numbers, and has no edge where two of them meet."""

    def regions(self, numbers: Array) -> int:
        """How many there are, from the numbers of the scene."""
        raise NotImplementedError

    def of_regions(self, numbers: Array, first: int, end: int) -> Array:
        """The numbers for some of them after each other."""
        raise NotImplementedError

    def nearest(self, numbers: Array, x: Array) -> Index:
        """In which of them places, (N, 3), m, have most room, (N,)."""
        raise NotImplementedError


def first_highest(values: Array) -> int:
    """The first of the values, (n,), that are the highest but for rounding.

    By symmetry two motors may be asked for the same: which of them is named must not depend on the
    last digit, which differs between processors.
    """
    return int(np.argmax(values >= values.max() - _TIED))
