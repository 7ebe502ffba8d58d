"""Tools: what the platform carries, and the shapes of it that keep clear of bodies."""

from __future__ import annotations

from math import dist
from typing import Annotated, Any, ClassVar

from pydantic import Field, create_model

from deltaopt.errors import SceneError
from deltaopt.files.units import EXTENT, LENGTH, MASS, WIDTH
from deltaopt.files.validated_record import (
    NonNegative,
    Positive,
    Record,
    Triple,
    Vector3,
    optional,
    vector3,
)

Point = Annotated[Triple, LENGTH]
Corner = Annotated[Triple, EXTENT]
POINT = "three coordinates [x, y, z] in m"
_OTHER = "three coordinates [x, y, z] in m, other than from"
_SHAPES = "one of sphere: {centre, radius}, box: {from, to}, capsule: {from, to, radius}"

_ENDS: dict[str, Any] = {
    "from": (Corner, Field(description=POINT)),  # which cannot be declared: a word of Python
    "to": (Corner, Field(description=_OTHER)),
}
FromTo: Any = create_model("FromTo", __base__=Record, **_ENDS)


class Between(FromTo):  # type: ignore[misc]  # made by pydantic
    """A shape that two points give, m."""

    @property
    def ends(self) -> tuple[Vector3, Vector3]:
        """Both points, m."""
        return getattr(self, "from"), self.to

    @property
    def centre(self) -> Vector3:
        """The middle between them, m."""
        return vector3((p + q) / 2 for p, q in zip(*self.ends, strict=True))


class Sphere(Record):
    """A sphere: its ``centre`` and ``radius``, m.

    Examples:
        >>> deltaopt.Sphere(centre=(0.45, 0.02, 0.0), radius="30 mm").radius
        0.03
    """

    centre: Point = Field(description=POINT)
    radius: Annotated[Positive, LENGTH]


class Box(Between):
    """A box along the axes of the base's frame between the opposite corners ``from`` and ``to``,
    m. The first is a word of Python, and stands in a mapping: ``Box(**{"from": …, "to": …})``.

    Examples:
        >>> corners = {"from": (0.95, -0.1, -1.0), "to": (2.0, 0.1, 1.0)}
        >>> deltaopt.Body(box=deltaopt.Box(**corners)).box.to
        (2.0, 0.1, 1.0)
    """

    def require_consistent(self) -> None:
        if any(a == b for a, b in zip(*self.ends, strict=True)):
            expected = "a corner in m that differs from the corner from in every coordinate"
            raise SceneError(None, "to", self.to, expected)

    @property
    def half(self) -> Vector3:
        """Half of the lengths of its sides, m."""
        return vector3(abs(p - q) / 2 for p, q in zip(*self.ends, strict=True))


class Along(Between):
    """A shape about the line between the points ``from`` and ``to``, m, with a ``radius``, m."""

    radius: Annotated[Positive, LENGTH]

    def require_consistent(self) -> None:
        if getattr(self, "from") == self.to:
            raise SceneError(None, "to", self.to, _OTHER)

    @property
    def length(self) -> float:
        """Of the line, m."""
        return dist(*self.ends)


class Capsule(Along):
    """A capsule: all that is within ``radius`` of the line."""


class OneOf(Record):
    """A record of which exactly one field is given, of some ``kinds`` in words."""

    kinds: ClassVar[str]

    @property
    def given(self) -> str:
        """The name of that field."""
        return next(name for name, value in self if value is not None)

    @property
    def shape(self) -> Any:
        """Its value."""
        return getattr(self, self.given)

    def require_consistent(self) -> None:
        given = [name for name, value in self if value is not None]
        if len(given) != 1:
            problem = f"has {' and '.join(given)}" if given else "is empty"
            raise SceneError(None, "", given, self.kinds, problem)


class Shape(OneOf):
    """One shape of a tool about the tool's point, in the base's frame: the platform does not
    turn."""

    sphere: Sphere | None = optional("a mapping with centre, radius")
    box: Box | None = optional("a mapping with from, to")
    capsule: Capsule | None = optional("a mapping with from, to, radius")
    kinds: ClassVar[str] = _SHAPES


class Tool(Record):
    """The tool that the platform carries.

    ``offset``: from the platform's centre to the tool's point, m; start and goal are then places
    of the tool's point. ``mass``: in kg. ``radius``: of a sphere about the tool's point that keeps
    clear of bodies, m; or ``shapes`` about that point. With neither the point alone keeps clear.

    Examples:
        >>> deltaopt.Tool(offset=("120 mm", 0, 0), mass="250 g", radius="30 mm").mass
        0.25
    """

    offset: Point | None = optional(POINT)
    mass: Annotated[NonNegative, MASS] | None = None
    radius: Annotated[Positive, WIDTH] | None = None
    shapes: tuple[Shape, ...] | None = optional(
        f"a list of shapes about the tool's point, each {_SHAPES}"
    )

    def require_consistent(self) -> None:
        if self.radius is not None and self.shapes is not None:
            expected = "either radius or shapes"
            raise SceneError(None, "shapes", self.shapes, expected, "is given beside radius")
