"""Scenes: which robot moves which payload from where to where, within which limits, how well.

A scene says what is wanted; how it is computed is a setting of the planner.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError
from deltaopt.files.tables import html_table
from deltaopt.files.units import MASS, WIDTH
from deltaopt.files.validated_record import NonNegative, Positive, Record, Vector3, optional
from deltaopt.limits.limit import Column, KeptLink
from deltaopt.problem.boundary import REST, Boundary
from deltaopt.robot.machine import Machine
from deltaopt.robot.robot import AnyRobot
from deltaopt.robot.solids import Convex
from deltaopt.scene.bodies import EXPECTED_BODIES, Body, solids_about, sums
from deltaopt.scene.known_limits import (
    LIMITS,
    Limits,
    in_order_of_rows,
    require_keys_of_limits,
    require_limit_for_tube,
    require_limits_for_bodies,
    without_shares,
)
from deltaopt.scene.moving_ends import (
    EXPECTED_GOAL,
    EXPECTED_START,
    Anywhere,
    End,
    Start,
    content_of_end,
    end_of,
    require_no_acceleration,
)
from deltaopt.scene.objective import EXPECTED, Objective, Time, content_of, objective_in
from deltaopt.scene.path import EXPECTED_PATH, AnyPath, Curve
from deltaopt.scene.task import BetweenEnds, OnPath, Task
from deltaopt.scene.way import (
    EXPECTED_APPROACH,
    EXPECTED_VIA,
    MOST_VIA,
    Approach,
    Near,
    Rotation,
    Via,
    require_distinct,
    via_point,
)

NO_KEYS = {"least_payload": "payload: [least, largest]", "planned_links": "robot_keeps_clear"}
"""Fields of a scene that no file gives, and what it gives instead."""
ROBOT_FILE = "the path of a robot file, relative to the scene file (in Python to where it runs)"


class Scene(Record):
    """A motion to plan: the tool's point from rest at ``start`` to rest at ``goal``, in m, x down.

    An end that moves is a `State` or, of goals, a `Belt`; `Anywhere` is the fastest stop.
    ``payload``: m₂ in kg; of a range, in all of which limits hold, the largest, ``least_payload``
    the least. ``limits``: beside the drive's. ``rotation``: of a fourth axis, a least duration. A
    key ``tool`` replaces that of ``robot``. Raises SceneError for values that cannot be used.

    Examples:
        >>> deltaopt.load_scene("problems/pick_and_place.yaml").payload
        1.0
    """

    robot: AnyRobot = Field(description=ROBOT_FILE)
    payload: Annotated[Positive, MASS] | None = optional(
        "a mass in kg, greater than 0, or [least, largest]; leave the key out for none"
    )
    least_payload: Annotated[NonNegative, MASS] | None = None
    start: Start = Field(description=EXPECTED_START)
    goal: End = Field(description=EXPECTED_GOAL)
    via: tuple[Via, ...] | None = optional(EXPECTED_VIA, max_length=MOST_VIA)
    approach: Approach | None = optional(EXPECTED_APPROACH)
    limits: Limits | None = optional(
        "a mapping with some of the keys " + ", ".join(Limits.model_fields)
    )
    rotation: Rotation | None = optional("a mapping with the keys angle, speed, acceleration")
    path: AnyPath | None = optional(EXPECTED_PATH)
    tube: Annotated[Positive, WIDTH] | None = optional(
        "a length in m, greater than 0: how far from path the tool may be"
    )
    objective: Objective = Field(default=Time(), description=EXPECTED)
    keep_out: tuple[Body, ...] | None = optional(EXPECTED_BODIES)
    clearance: Annotated[NonNegative, WIDTH] | None = optional(
        "a length in m, at least 0, beyond touching a body"
    )
    robot_keeps_clear: bool | None = optional(
        "true if arms and forearms keep clear of bodies too, or false"
    )
    planned_links: tuple[tuple[int, int, float], ...] = Field(
        default=(), description="triples of a link, a body and the least distance of both, m"
    )

    @cached_property
    def obstacles(self) -> tuple[tuple[int, Convex], ...]:
        """What the tool's point must stay out of: for each body and shape of the tool the body's
        index and their sum, in the order of the rows of the limits.

        Raises SceneError for a sum that is not known.
        """
        return in_order_of_rows(sums(self.keep_out or (), self.robot.tool))

    @property
    def kept_out(self) -> tuple[Convex, ...]:
        """What the tool's point must stay out of: keep-out bodies grown by the tool."""
        return tuple(convex for _, convex in self.obstacles)

    @property
    def keeps_links_clear(self) -> bool:
        """Whether arms and forearms are to keep clear of bodies, and there are some."""
        return bool(self.robot_keeps_clear and self.keep_out)

    @cached_property
    def kept_links(self) -> tuple[KeptLink, ...]:
        """Which arms and forearms are planned to keep clear of which bodies: ``planned_links``, of
        a scene as a planner has it (``planning/links_clear.py``)."""
        if not self.planned_links:
            return ()
        bodies = solids_about(self.keep_out or ())
        return tuple(KeptLink(link, bodies[body], m) for link, body, m in self.planned_links)

    @property
    def columns(self) -> tuple[()] | tuple[Column, Column]:
        """The vertical cylinders about start and goal of its ``approach``; none without."""
        if self.approach is None or self.moves_at_ends:
            return ()
        start, goal = self.given_points
        return self.approach.start.column(start), self.approach.goal.column(goal)

    @property
    def least_clearance(self) -> float:
        """How far it must stay out of these, m."""
        return self.clearance or 0.0

    @property
    def follows_path(self) -> bool:
        """Whether the motion is to stay exactly on a given path."""
        return self.path is not None and self.tube is None

    @property
    def on_its_path(self) -> Scene:
        """The scene without its tube: exactly on the path, if it gives one."""
        return self if self.tube is None else self.model_copy(update={"tube": None})

    @property
    def axis_of_tube(self) -> Array:
        """The path about which the tube is: polynomials over shares from 0 to 1 of its pieces,
        (pieces, powers, 3), m; no pieces without a tube."""
        if self.tube is None or self.path is None:
            return np.zeros((0, 1, 3))
        return self.path.between(*self.given_points).over_shares

    @property
    def least_duration(self) -> float:
        """The least time that the motion may take beside what its limits ask for, s: that of the
        rotation; 0 without one."""
        return 0.0 if self.rotation is None else self.rotation.duration

    @cached_property
    def task(self) -> Task:
        """The task of the motion: what is known at its start and goal, and of its path."""
        via = tuple(map(via_point, self.via or ()))
        if self.moves_at_ends:
            return BetweenEnds(*self.ends, via)
        start, goal = map(Boundary, self.given_points)
        if self.path is None:
            levels = tuple(column.level for column in self.columns)
            return BetweenEnds(start, goal, via, levels=levels)
        if self.tube is not None:
            within = f"within {1e3 * self.tube:g} mm of a path: {self.path.description}"
            return BetweenEnds(start, goal, within=within)
        points, path = (start.position, goal.position), self.path
        return OnPath(*points, path.between(*points), path.speeds, path.description)

    @cached_property
    def given_points(self) -> tuple[Vector3, ...]:
        """The points in m that are known of the motion's ends: the start and, unless it moves or is
        anywhere, the goal."""
        start, goal = self.ends
        return (start.position, goal.position) if goal.is_given else (start.position,)

    @property
    def placed_points(self) -> tuple[Vector3, ...]:
        """The points in m that are known of the motion: those of its ends and the via points that
        are passed exactly."""
        return *self.given_points, *(each for each in self.via or () if not isinstance(each, Near))

    @cached_property
    def ends(self) -> tuple[Boundary, Boundary]:
        """What the motion begins and ends in."""
        return end_of(self.start), end_of(self.goal)

    @cached_property
    def moves_at_ends(self) -> bool:
        """Whether an end moves or is anywhere; the ends of a given path are points."""
        return BetweenEnds(*self.ends).moves_at_ends

    def __repr__(self) -> str:
        ends = f"from {self.start} to {self.goal} m"
        return f"<Scene: {self.robot.name}, {self.payload_in_words}, {ends}>"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        """The scene as a table, for notebooks."""
        content = self.model_dump(mode="json", exclude_none=True, exclude={"robot"})
        rows = [("robot", self.robot.name)]
        for key, inner in content.items():
            if isinstance(inner, dict):
                rows += [(f"{key}.{name}", str(value)) for name, value in inner.items()]
            else:
                rows.append((key, str(inner)))
        return html_table(("scene", "SI units"), rows)

    def given(self, key: str) -> Any:
        """The value of a key under ``limits``; None if the scene does not have it."""
        return getattr(self.limits, key, None)

    @classmethod
    def _read(cls, content: dict[str, Any]) -> dict[str, Any]:
        """The keys of a scene file as the values of the fields."""
        read, least = dict(content), content.get("least_payload")
        if least is not None:
            read["payload"] = least, read.get("payload")
        if "robot" in read and {"limits", "tool"} & set(read):
            read["robot"] = cls._valid("robot", read["robot"])
        read = cls._as_fields(read, read.get("robot"))
        if "tool" in read and isinstance(read.get("robot"), Machine):
            read["robot"] = read["robot"].model_copy(update={"tool": read.pop("tool")})
        return objective_in(read)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with other fields; see ``Record.model_copy``."""
        given = update or {}
        given = self._as_fields(given, given.get("robot", self.robot))
        given = objective_in(given) if "objective" in given else given
        return super().model_copy(update=given, deep=deep)

    @classmethod
    def _as_fields(cls, given: Mapping[str, Any], robot: Any) -> dict[str, Any]:
        """Keys of a scene file as the values of the fields. Raises SceneError.

        ``robot``: of whose drives the limits' shares, such as "85 %", are.
        """
        read = dict(given)
        if "payload" in read:
            read |= cls._payloads(read["payload"])
        if "limits" in read and isinstance(robot, Machine):
            read["limits"] = without_shares(read["limits"], robot)
        return read

    @cached_property
    def has_rates(self) -> bool:
        """Whether limits of jerk or torque rate, or their cost, make acceleration continuous."""
        is_limited = any(limit.order == 3 and limit.items(self) for limit in LIMITS)
        return is_limited or self.objective.rate.order == 3

    @property
    def with_least_payload(self) -> Scene:
        """The scene with the least payload of its range; itself where the payload does not vary."""
        if self.least_payload is None:
            return self
        return self.model_copy(update={"payload": self.least_payload or None})

    @property
    def payload_in_words(self) -> str:
        """What is carried: "without payload", "with 1 kg", "with 0 to 1 kg"."""
        if self.payload is None:
            return "without payload"
        least = "" if self.least_payload is None else f"{self.least_payload:g} to "
        return f"with {least}{self.payload:g} kg"

    @classmethod
    def _payloads(cls, given: Any) -> dict[str, Any]:
        """The fields of what stands under ``payload``: a mass, or the least and the largest.

        Raises SceneError.
        """
        given = given.tolist() if isinstance(given, np.ndarray) else given
        if not isinstance(given, list | tuple) or len(given) != 2:
            return {"payload": given, "least_payload": None}
        problem = ""
        try:
            least, largest = cls._valid("least_payload", given[0]), cls._valid("payload", given[1])
        except SceneError as error:
            least, largest, problem = None, None, error.problem
        if least is None or largest is None or least > largest:
            expected = "[least, largest] in kg, the least at least 0 and the largest greater than 0"
            raise SceneError(None, "payload", given, expected, problem)
        return {"payload": largest, "least_payload": least if least < largest else None}

    @model_serializer(mode="wrap")
    def _write_objective(self, rest: SerializerFunctionWrapHandler) -> dict[str, object]:
        content = {**rest(self), **content_of(self.objective)}
        content.pop("planned_links", None)
        least = content.pop("least_payload", None)
        return content if least is None else content | {"payload": [least, self.payload]}

    @classmethod
    def _keys(cls) -> list[str]:
        known = [key for key in super()._keys() if key not in NO_KEYS]
        return [*known, "duration", "tool"]

    def require_consistent(self) -> None:
        at_rest, starts_moving = not self.moves_at_ends, self.ends[0].velocity != REST
        stops, is_time = isinstance(self.goal, Anywhere), isinstance(self.objective, Time)
        no_path, follows = self.path is None, self.follows_path
        is_rated = follows and self.has_rates
        known = self.robot.has_links or not self.robot_keeps_clear
        rules = (
            ("goal", "a start that moves, for at rest it has stopped", starts_moving or not stops),
            ("path", "start and goal at rest beside it", at_rest),
            ("rotation", "start and goal at rest beside it", at_rest),
            ("via", "no path beside it", no_path),
            ("via", "a goal that is a point, a state or on a belt beside it", not stops),
            ("approach", "start and goal at rest beside it", at_rest),
            ("approach", "neither path nor via beside it", no_path and self.via is None),
            ("objective", "time, where a path is given without a tube", is_time or not follows),
            ("tube", "a path beside it", not no_path),
            ("tube", "a path through points, not a Curve", not isinstance(self.path, Curve)),
            ("tube", "a path without speeds", self.path is None or not any(self.path.speeds)),
            ("path", "a tube about it beside limits of jerk or torque rate", not is_rated),
            ("robot_keeps_clear", "false, for the links of this robot are not known", known),
        )
        for key, expected, holds in rules:
            if getattr(self, key) is not None and not holds:
                raise SceneError(None, key, self.model_dump()[key], expected)
        self._require_plannable()

    def _require_plannable(self) -> None:
        """What takes more than a look at which keys there are."""
        task = self.task
        if not self.has_rates:
            require_no_acceleration({"start": self.start, "goal": self.goal})
        start, goal = (replace(end, acceleration=REST) for end in (task.start, task.goal))
        if start == goal and (self.moves_at_ends or not task.via):
            point = "a state" if self.moves_at_ends else "a point in m"
            raise SceneError(None, "goal", content_of_end(self.goal), f"{point} other than start")
        if self.via is not None:
            given = goal.position if goal.is_given else None
            require_distinct(task.via, start.position, given)
        duration = self.objective.given_duration
        if duration is not None and duration < self.least_duration:
            least = f"at least {self.least_duration:.6g} s, which rotation takes"
            raise SceneError(None, "duration", duration, least)
        if self.tube is not None:
            require_limit_for_tube(self.tube, self.axis_of_tube)
        if self.keep_out == ():
            raise SceneError(None, "keep_out", [], EXPECTED_BODIES, "is empty")
        require_limits_for_bodies(self.obstacles)
        require_keys_of_limits(self)
