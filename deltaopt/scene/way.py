"""What scenes give of the way between start and goal: cylinders in which a motion leaves the one
and reaches the other, straight up and down, how far a fourth axis turns the gripper meanwhile, and
via points, or places within a distance of one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import dist, sqrt
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PlainSerializer

from deltaopt.errors import SceneError
from deltaopt.files.units import ANGLE, ANGULAR_ACCELERATION, ANGULAR_SPEED, WIDTH
from deltaopt.files.validated_record import Positive, Record, Vector3
from deltaopt.limits.limit import Column
from deltaopt.problem.boundary import Boundary
from deltaopt.robot.tool import POINT, Point

EXPECTED_APPROACH = "a mapping with the keys start and goal, each {height, radius} in m"
MOST_VIA = 100
"""Most via points: each adds a phase to the program, and so many take some ten seconds."""
EXPECTED_VIA = (
    f"at most {MOST_VIA} points in m, passed in this order at any speed: [x, y, z], or "
    "{at, within} for any place within a distance of one"
)


class ApproachAtEnd(Record):
    """Within a vertical cylinder of ``radius`` (m) about an end until ``height`` (m) above it."""

    height: Annotated[Positive, WIDTH]
    radius: Annotated[Positive, WIDTH]

    def column(self, end: Vector3) -> Column:
        """The cylinder about an end, m."""
        x, y, z = end
        return Column(y, z, self.radius, x - self.height)


class Approach(Record):
    """The cylinders at ``start`` and ``goal``; between them the motion stays above the lower of
    their two tops."""

    start: ApproachAtEnd = Field(description="a mapping with the keys height and radius, in m")
    goal: ApproachAtEnd = Field(description="a mapping with the keys height and radius, in m")


class Rotation(Record):
    """A turn by ``angle`` (rad) from rest to rest, at most at ``speed`` (rad/s), with at most
    ``acceleration`` (rad/s²).

    The axis is light and moves by itself: the Delta's motion only has to take no less time.
    """

    angle: Annotated[Positive, ANGLE]
    speed: Annotated[Positive, ANGULAR_SPEED]
    acceleration: Annotated[Positive, ANGULAR_ACCELERATION]

    @property
    def duration(self) -> float:
        """The least time it takes, s: full acceleration, full speed if that is reached, full
        braking."""
        if self.angle * self.acceleration <= self.speed**2:
            return 2 * sqrt(self.angle / self.acceleration)
        return self.angle / self.speed + self.speed / self.acceleration


class Near(Record):
    """A via point that any place at most ``within`` (m) from the point ``at`` (m) stands for.

    Raises SceneError for values that cannot be used.
    """

    at: Point = Field(description=POINT)
    within: Annotated[Positive, WIDTH]


def _via_in(content: Any) -> Any:
    """What stands for a via point of a scene, a mapping as a record and the rest as it is, for the
    field's type to judge. A mapping without ``within`` is a point. Raises SceneError."""
    if not isinstance(content, Mapping):
        return content
    return content["at"] if set(content) == {"at"} else Near.model_validate(dict(content))


def _content_of(via: Any) -> object:
    """The inverse of ``_via_in``."""
    return via.model_dump() if isinstance(via, Near) else via


Via = Annotated[Point | Near, BeforeValidator(_via_in), PlainSerializer(_content_of)]


def via_point(given: Via) -> Boundary:
    """What a task has for a via point of a scene."""
    if isinstance(given, Near):
        return Boundary.passed(given.at, given.within)
    return Boundary.passed(given)


def require_distinct(via: Sequence[Boundary], start: Vector3, goal: Vector3 | None) -> None:
    """Raise SceneError where a via point is the point before or after it, or where the sphere about
    one holds that point, with its own sphere, and so asks for nothing.

    ``start``, ``goal``: ends of the motion, m; None for a goal that moves or is anywhere.
    """
    last = [] if goal is None else [Boundary(goal)]
    points = [Boundary(start), *via, *last]
    if not via or any(a.position == b.position for a, b in pairwise(points)):
        expected = "points in m, each other than the one before it, start and goal included"
        given = [{"at": p.position, "within": p.within} if p.within else p.position for p in via]
        raise SceneError(None, "via", given, expected)
    for number, point in enumerate(via):
        beside = (points[number], *points[number + 2 : number + 3])
        most = min(dist(point.position, other.position) + other.within for other in beside)
        if point.within >= most:
            expected = f"less than {most:.6g} m: it holds all of the point before or after it"
            raise SceneError(None, f"via[{number}].within", point.within, expected)
