"""Moving ends as scenes give them: a state that is passed, a point on a belt, rest anywhere."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, PlainSerializer

from deltaopt.errors import SceneError
from deltaopt.files.units import ACCELERATION, SPEED
from deltaopt.files.validated_record import Record, Triple, optional, vector3
from deltaopt.problem.boundary import REST, Boundary
from deltaopt.robot.tool import POINT, Point

EXPECTED_START = f"{POINT}, or a state {{at, velocity}}"
EXPECTED_GOAL = f"{POINT}, {{at, velocity}}, {{at, belt}} or anywhere"
_ANYWHERE = "anywhere"


class State(Record):
    """A state of the platform at an end of a motion: ``at`` in m, ``velocity`` in m/s, and with
    limits of jerk or torque rate ``acceleration`` in m/s², which is continuous then.

    Raises SceneError for values that cannot be used.

    Examples:
        >>> state = deltaopt.State(at=(0.85, -0.15, 0.0), velocity=(0.0, 0.0, 0.5))
        >>> state.velocity
        (0.0, 0.0, 0.5)
    """

    at: Point = Field(description=POINT)
    velocity: Annotated[Triple, SPEED] = Field(
        default=REST, description="a velocity [x, y, z] in m/s"
    )
    acceleration: Annotated[Triple, ACCELERATION] | None = optional(
        "an acceleration [x, y, z] in m/s²"
    )

    @classmethod
    def _keys(cls) -> list[str]:
        """That of a goal on a belt too, whose record is another one."""
        return [*super()._keys(), "belt"]

    @property
    def end(self) -> Boundary:
        """The state as a task has it."""
        return Boundary(self.at, self.velocity, self.acceleration or REST)


class Belt(Record):
    """A goal that moves: the point ``at`` + ``belt`` t, t from the start of the motion, m and m/s.

    It is met at the belt's velocity. Raises SceneError for values that cannot be used.

    Examples:
        >>> part = deltaopt.Belt(at=(0.85, 0.05, 0.10), belt=(0.0, 0.0, -0.5))
        >>> part.belt
        (0.0, 0.0, -0.5)
    """

    at: Point = Field(description=f"{POINT}: where the goal is when the motion starts")
    belt: Annotated[Triple, SPEED] = Field(description="the belt's velocity [x, y, z] in m/s")

    @property
    def end(self) -> Boundary:
        """The goal as a task has it: a point that moves, met at its own velocity."""
        return Boundary(self.at, self.belt, belt=self.belt)

    def after(self, duration: float) -> Belt:
        """The belt as it is when it has moved on for so long, s."""
        at = vector3(np.add(self.at, np.multiply(duration, self.belt)))
        return Belt(at=at, belt=self.belt)


class Anywhere(Record):
    """The goal of the fastest stop: at rest, wherever that is.

    Examples:
        >>> planner = deltaopt.Planner(deltaopt.load_robot("problems/robots/industrial.yaml"))
        >>> moving = deltaopt.State(at=(0.85, 0.0, 0.0), velocity=(0.0, 3.0, 0.0))
        >>> stop = planner.plan(moving, deltaopt.Anywhere())
        >>> stop.duration < 0.1
        True
    """

    @property
    def end(self) -> Boundary:
        """The goal as a task has it."""
        return Boundary(REST, free=(True, True, True))


def goal_in(content: Any) -> Any:
    """The record that stands under ``goal`` of a scene, as a mapping or a word.

    What is neither is returned as it is, for the field's type to judge. Raises SceneError.
    """
    if isinstance(content, str) and content == _ANYWHERE:
        return Anywhere()
    if not isinstance(content, Mapping):
        return content
    if not {"at", "velocity", "belt"} & set(content):
        raise ValueError
    kind = Belt if "belt" in content else State
    return kind.model_validate(dict(content))


def _end_in(content: Any) -> Any:
    """What a scene has for an end: a state at rest, or a point on a belt at rest, is a point."""
    found = goal_in(content)
    return found.at if isinstance(found, State | Belt) and found.end.is_at_rest else found


def _start_in(content: Any) -> Any:
    found = _end_in(content)
    if isinstance(found, Belt):
        raise SceneError(None, "belt", list(found.belt), "a belt at the goal alone")
    return found


def content_of_end(given: Any) -> object:
    """What stands in a scene file for an end: the inverse of ``goal_in``."""
    if isinstance(given, Anywhere):
        return _ANYWHERE
    is_point = isinstance(given, tuple)
    return given if is_point else given.model_dump(mode="json", exclude_none=True)


_AS_IN_FILES = PlainSerializer(content_of_end)
Start = Annotated[Point | State, BeforeValidator(_start_in), _AS_IN_FILES]
End = Annotated[Point | State | Belt | Anywhere, BeforeValidator(_end_in), _AS_IN_FILES]


def end_of(given: End) -> Boundary:
    """What a task has for the ``start`` or ``goal`` of a scene."""
    return Boundary(given) if isinstance(given, tuple) else given.end


def require_no_acceleration(ends: Mapping[str, End]) -> None:
    """Raise SceneError for a state that gives an acceleration; ``ends``: by their keys."""
    for key, end in ends.items():
        if isinstance(end, State) and end.acceleration is not None:
            expected = "none without limits of jerk or torque rate, for then it may jump"
            raise SceneError(None, f"{key}.acceleration", list(end.acceleration), expected)
