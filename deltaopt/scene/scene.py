"""Scenes: which robot moves which payload from where to where, within which limits, how well.

A scene says what is wanted; how it is computed is a setting of the planner.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BeforeValidator,
    Field,
    SerializeAsAny,
    SerializerFunctionWrapHandler,
    create_model,
    model_serializer,
    model_validator,
)

from deltaopt.errors import SceneError, shown
from deltaopt.files.tables import html_table
from deltaopt.files.units import LENGTH, MASS, WIDTH
from deltaopt.files.validated_record import NonNegative, Number, Positive, Record, Vector3
from deltaopt.files.yaml_file import place_of, read_yaml
from deltaopt.limits.joint_ranges import ARM_RANGE, BallJoint
from deltaopt.limits.keep_out import (
    MOST_SOLIDS,
    KeepOut,
    hull_limits,
    place_among_rows,
)
from deltaopt.limits.limit import Column, KeptLink, Limit, MotorLimit
from deltaopt.limits.links import LinkClearance
from deltaopt.limits.platform_motion import PLATFORM_ACCELERATION, PLATFORM_SPEED
from deltaopt.limits.rates import PLATFORM_JERK, JointJerk, TorqueRate
from deltaopt.limits.scene_limits import SceneLimits
from deltaopt.limits.singularities import (
    PARALLEL_SINGULARITY,
    TILT_SINGULARITY,
    SerialSingularity,
)
from deltaopt.limits.specific_force import SPECIFIC_FORCE
from deltaopt.limits.speed import Speed
from deltaopt.limits.torque import Torque, WithLeastPayload
from deltaopt.limits.torque_curve import TorqueCurve
from deltaopt.limits.tube import MOST_PARTS, Tube, parts_of
from deltaopt.limits.workspace import WORKSPACE_DEPTH, WORKSPACE_RADIUS
from deltaopt.limits.workspace import Approach as ApproachLimit
from deltaopt.robot.machine import Machine
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.robot.solids import MOST_TRIANGLES, Convex, Polytope
from deltaopt.scene.approach import EXPECTED as EXPECTED_APPROACH
from deltaopt.scene.approach import Approach
from deltaopt.scene.bodies import EXPECTED as EXPECTED_BODIES
from deltaopt.scene.bodies import Body, solid_about, sums
from deltaopt.scene.convex_hull import NoHull, convex_hull
from deltaopt.scene.moving_ends import (
    EXPECTED_GOAL,
    EXPECTED_START,
    Anywhere,
    Belt,
    State,
    content_of_end,
    end_in,
    end_of,
    start_of,
)
from deltaopt.scene.objective import EXPECTED, Objective, Time, content_of, objective_in
from deltaopt.scene.path import EXPECTED as EXPECTED_PATH
from deltaopt.scene.path import (
    Corners,
    Curve,
    Line,
    PickAndPlace,
    content_of_path,
    path_in,
    points_in,
)
from deltaopt.scene.rotation import Rotation
from deltaopt.scene.stl import corners_in
from deltaopt.scene.task import (
    REST,
    EndState,
    Goal,
    MovingEnds,
    OnPath,
    RestToRest,
    Task,
    given_points,
)
from deltaopt.scene.via import EXPECTED as EXPECTED_VIA
from deltaopt.scene.via import MOST_VIA, Near, content_of_via, require_distinct, via_in, via_point

_STANDS_STILL = 1e-9
"""Share of the largest rate of a path's pieces below which it turns back where a piece begins."""
_NO_KEYS = {"least_payload": "payload: [least, largest]", "planned_links": "robot_keeps_clear"}
"""Fields of a scene that no file gives, and what it gives instead."""
_ROBOT_FILE = "the path of a robot file, relative to the scene file"


LIMITS: tuple[Limit, ...] = (
    Torque(),
    SerialSingularity(),
    Speed(),
    PLATFORM_ACCELERATION,
    TorqueCurve(),
    PLATFORM_SPEED,
    SPECIFIC_FORCE,
    ARM_RANGE,
    BallJoint(),
    WORKSPACE_DEPTH,
    WORKSPACE_RADIUS,
    PARALLEL_SINGULARITY,
    TILT_SINGULARITY,
    KeepOut(),
    *hull_limits(),
    Tube(),
    ApproachLimit(),
    LinkClearance(),
    TorqueRate(),
    PLATFORM_JERK,
    JointJerk(),
)
"""All kinds of limit, in the order of the constraint rows of a problem. Before bodies, the rows of
those that depend on torques stand once more, for the least payload of a range."""

_KEYS: dict[str, Any] = {
    limit.key.name: (limit.key.type | None, Field(default=None, description=limit.key.expected))
    for limit in LIMITS
    if limit.key
}
_Keys: Any = create_model("_Keys", __base__=Record, **_KEYS)


class Limits(_Keys):  # type: ignore[misc]  # its fields are the keys of LIMITS
    """The limits of a scene by key; they may be tighter than those of the robot's drive."""


def _robot_of(content: Any) -> Any:
    """A robot of any kind as it is; the content of a Delta's file as a Delta."""
    return content if isinstance(content, Machine) else Robot.model_validate(content)


AnyRobot = Annotated[SerializeAsAny[Machine], BeforeValidator(_robot_of)]


class Scene(Record):
    """A motion to plan: the tool's point from rest at ``start`` to rest at ``goal``.

    The tool's point is the platform's centre if the robot has no tool with an offset. ``start``,
    ``goal``: three coordinates each in m, x down from the base's centre. An end that moves is a
    `State`, or a `Belt` as the goal; `Anywhere` as the goal is the fastest stop. ``payload``: mass
    m₂ in kg at the platform, None for no payload; or the least and the largest, for all of which
    limits hold: then it is the largest, and ``least_payload`` the least. ``limits``: beside those
    of the robot's drive. ``rotation``: of a fourth axis, which the motion takes no less time than.
    ``objective``: what is minimised, time by default. A key ``tool`` replaces the robot's tool as a
    whole: it is then that of ``robot``. Raises SceneError for values that cannot be used.
    """

    robot: AnyRobot = Field(description=_ROBOT_FILE)
    payload: Annotated[Positive, MASS] | None = Field(
        default=None, description="a mass in kg, greater than 0, or [least, largest]"
    )
    least_payload: Annotated[NonNegative, MASS] | None = Field(
        default=None, description="a mass in kg, at least 0"
    )
    start: Annotated[tuple[Number, Number, Number], LENGTH] | State = Field(
        description=EXPECTED_START
    )
    goal: Annotated[tuple[Number, Number, Number], LENGTH] | State | Belt | Anywhere = Field(
        description=EXPECTED_GOAL
    )
    via: tuple[Annotated[tuple[Number, Number, Number], LENGTH] | Near, ...] | None = Field(
        default=None, max_length=MOST_VIA, description=EXPECTED_VIA
    )
    approach: Approach | None = Field(default=None, description=EXPECTED_APPROACH)
    limits: Limits | None = Field(
        default=None,
        description="a mapping with some of the keys " + ", ".join(Limits.model_fields),
    )
    rotation: Rotation | None = Field(
        default=None, description="a mapping with the keys angle, speed, acceleration"
    )
    path: Line | Corners | PickAndPlace | Curve | None = Field(
        default=None, description=EXPECTED_PATH
    )
    tube: Annotated[Positive, WIDTH] | None = Field(
        default=None, description="a length in m, greater than 0: how far from path the tool may be"
    )
    objective: Objective = Field(default=Time(), description=EXPECTED)
    keep_out: tuple[Body, ...] | None = Field(default=None, description=EXPECTED_BODIES)
    clearance: Annotated[NonNegative, WIDTH] | None = Field(
        default=None, description="a length in m, at least 0, beyond touching a body"
    )
    robot_keeps_clear: bool | None = Field(
        default=None, description="true if arms and forearms keep clear of bodies too, or false"
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
        found = sums(self.keep_out or (), self.robot.tool)
        return tuple(sorted(found, key=lambda each: place_among_rows(each[1])))

    @property
    def kept_out(self) -> tuple[Convex, ...]:
        """What the tool's point must stay out of: keep-out bodies grown by the tool."""
        return tuple(convex for _, convex in self.obstacles)

    @property
    def kept_links(self) -> tuple[KeptLink, ...]:
        """Which arms and forearms are planned to keep clear of which bodies: ``planned_links``, of
        a scene as a planner has it (``planning/links_clear.py``)."""
        if not self.planned_links:
            return ()
        bodies = [solid_about(body) for _, body in sums(self.keep_out or (), None)]
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
    def axis_of_tube(self) -> NDArray[np.float64]:
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
        start, goal = self.ends
        via = tuple(map(via_point, self.via or ()))
        if self.moves_at_ends or not isinstance(goal, EndState):
            return MovingEnds(start, goal, via)
        if self.path is None:
            levels = tuple(column.level for column in self.columns)
            return RestToRest(start.position, goal.position, via, levels=levels)
        if self.tube is not None:
            within = f"within {1e3 * self.tube:g} mm of a path: {self.path.description}"
            return RestToRest(start.position, goal.position, within=within)
        return OnPath.of(start.position, goal.position, self.path)

    @cached_property
    def given_points(self) -> tuple[Vector3, ...]:
        """The points in m that are known of the motion's ends: the start and, unless it moves or is
        anywhere, the goal."""
        start, goal = self.ends
        return (start.position, goal.position) if isinstance(goal, EndState) else (start.position,)

    @property
    def placed_points(self) -> tuple[Vector3, ...]:
        """The points in m that are known of the motion: those of its ends and the via points that
        are passed exactly."""
        return *self.given_points, *(each for each in self.via or () if not isinstance(each, Near))

    @cached_property
    def ends(self) -> tuple[EndState, Goal]:
        """What the motion begins and ends in."""
        return start_of(self.start), end_of(self.goal)

    @cached_property
    def moves_at_ends(self) -> bool:
        """Whether an end moves or is anywhere; the ends of a given path are points."""
        start, goal = self.ends
        at_rest = isinstance(goal, EndState) and goal.velocity == REST
        return not (at_rest and start.velocity == REST)

    def _repr_html_(self) -> str:
        """The scene as a table, for notebooks."""
        content = self.model_dump(mode="json", exclude_none=True)
        rows = [("robot", self.robot.name)]
        for key in (key for key in content if key != "robot"):
            inner = content[key]
            if isinstance(inner, dict):
                rows += [(f"{key}.{name}", str(value)) for name, value in inner.items()]
            else:
                rows.append((key, str(inner)))
        return html_table(("scene", "SI units"), rows)

    def given(self, key: str) -> Any:
        """The value of a key under ``limits``; None if the scene does not have it."""
        return getattr(self.limits, key, None)

    @model_validator(mode="before")
    @classmethod
    def _read(cls, content: Any) -> Any:
        """The keys of a scene file as the values of the fields."""
        if not isinstance(content, dict):
            return content
        read = dict(content)
        if read.get("path") is not None:
            try:
                read["path"] = path_in(read["path"])
            except SceneError as error:
                raise error.inside(key="path") from None
        read |= {key: end_in(key, read[key]) for key in ("start", "goal") if key in read}
        if "via" in read:
            read["via"] = via_in(read["via"])
        least, payload = read.get("least_payload"), read.get("payload")
        read |= cls._payloads(payload if least is None else (least, payload))
        if {"robot", "limits"} <= set(read):
            read["robot"] = cls._valid("robot", read["robot"])
            read["limits"] = _without_shares(read["limits"], read["robot"])
        if "tool" in read and isinstance(read.get("robot"), Machine):
            read["robot"] = read["robot"].model_copy(update={"tool": read.pop("tool")})
        return objective_in(read)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy with other fields; see ``Record.model_copy``."""
        given = dict(update or {})
        if "limits" in given:
            given["limits"] = _without_shares(given["limits"], given.get("robot", self.robot))
        if "path" in given:
            given["path"] = path_in(given["path"])
        if "payload" in given:
            given |= self._payloads(given["payload"])
        for key in {"start", "goal"} & set(given):
            given[key] = end_in(key, given[key])
        if "via" in given:
            given["via"] = via_in(given["via"])
        return super().model_copy(update=given, deep=deep)

    @property
    def has_rates(self) -> bool:
        """Whether limits of jerk or torque rate make acceleration continuous."""
        return any(limit.order == 3 and limit.items(self) for limit in LIMITS)

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
        path = {} if self.path is None else {"path": content_of_path(self.path)}
        moving = (key for key in ("start", "goal") if not isinstance(getattr(self, key), tuple))
        ends = {key: content_of_end(getattr(self, key)) for key in moving}
        via = {} if self.via is None else {"via": content_of_via(self.via)}
        content = {**rest(self), **ends, **via, **path, **content_of(self.objective)}
        content.pop("planned_links", None)
        least = content.pop("least_payload", None)
        return content if least is None else content | {"payload": [least, self.payload]}

    @classmethod
    def _keys(cls) -> list[str]:
        known = [key for key in super()._keys() if key not in _NO_KEYS]
        return [*known, "duration", "tool"]

    @model_validator(mode="after")
    def _moves(self) -> Self:
        task = self.task
        if isinstance(task, MovingEnds):
            return self._can_move_at_ends(task)
        if task.start == task.goal and not task.via:
            raise SceneError(None, "goal", self.goal, "a point in m other than start")
        return self

    @model_validator(mode="after")
    def _via_fits(self) -> Self:
        if self.via is None:
            return self
        if self.path is not None:
            raise SceneError(None, "via", content_of_via(self.via), "no path beside it")
        start, goal = self.ends
        if isinstance(self.goal, Anywhere):
            expected = "a goal that is a point, a state or on a belt beside it"
            raise SceneError(None, "via", content_of_via(self.via), expected)
        given = goal.position if isinstance(goal, EndState) else None
        require_distinct(self.task.via, start.position, given)
        return self

    @model_validator(mode="after")
    def _approach_fits(self) -> Self:
        if self.approach is None:
            return self
        given = self.approach.model_dump()
        if self.path is not None or self.via is not None or self.moves_at_ends:
            beside = "start and goal at rest" if self.moves_at_ends else "neither path nor via"
            raise SceneError(None, "approach", given, f"{beside} beside it")
        return self

    def _can_move_at_ends(self, task: MovingEnds) -> Self:
        """The scene itself; raises SceneError where it says what moving ends do not go with."""
        for key, end in (("start", self.start), ("goal", self.goal)):
            if not isinstance(end, State) or end.acceleration is None:
                continue
            if not self.has_rates:
                expected = "none without limits of jerk or torque rate, for then it may jump"
                raise SceneError(None, f"{key}.acceleration", list(end.acceleration), expected)
        if task.start == task.goal:
            raise SceneError(None, "goal", content_of_end(self.goal), "a state other than start")
        if isinstance(self.goal, Anywhere) and task.start.velocity == REST:
            raise SceneError(None, "goal", "anywhere", "a start that moves: {at: …, velocity: …}")
        given = {
            "path": None if self.path is None else content_of_path(self.path),
            "rotation": None if self.rotation is None else self.rotation.model_dump(),
        }
        for key, value in given.items():
            if value is not None:
                raise SceneError(None, key, value, "start and goal at rest beside it")
        return self

    @model_validator(mode="after")
    def _there_is_time_to_rotate(self) -> Self:
        given = self.objective.given_duration
        if given is not None and given < self.least_duration:
            least = f"at least {self.least_duration:.6g} s, which rotation takes"
            raise SceneError(None, "duration", given, least)
        return self

    @model_validator(mode="after")
    def _path_fits(self) -> Self:
        if self.path is None:
            return self
        self.path.between(*given_points(self.task))
        if not isinstance(self.objective, Time) and self.tube is None:
            expected = "time, where a path is given without a tube"
            raise SceneError(None, "objective", str(self.objective), expected)
        for limit in LIMITS if self.tube is None else ():
            if limit.order == 3 and limit.items(self):
                expected = f"a tube about it beside a limit of {limit.name}, or none of these"
                raise SceneError(None, "path", content_of_path(self.path), expected)
        return self

    @model_validator(mode="after")
    def _tube_fits(self) -> Self:
        if self.tube is None:
            return self
        beside = {
            "a path beside it": self.path is not None,
            "a path through points, not a Curve": not isinstance(self.path, Curve),
            "a path without speeds": self.path is None or self.path.speeds == (0.0, 0.0),
        }
        for expected, holds in beside.items():
            if not holds:
                raise SceneError(None, "tube", self.tube, expected)
        pieces = self.axis_of_tube
        parts = len(parts_of(pieces))
        if parts > MOST_PARTS:
            most = "a path of at most 7 rounded corners"
            raise SceneError(None, "tube", self.tube, f"{most} beside it")
        rates = np.linalg.norm(pieces[:, 1], axis=1)
        if rates.min() <= _STANDS_STILL * rates.max():
            raise SceneError(None, "tube", self.tube, "a path that nowhere turns back")
        return self

    @model_validator(mode="after")
    def _bodies_can_be_kept_out_of(self) -> Self:
        if self.keep_out is None:
            return self
        if not self.keep_out:
            raise SceneError(None, "keep_out", [], EXPECTED_BODIES, "is empty")
        if len(self.kept_out) > MOST_SOLIDS:
            expected = f"at most {MOST_SOLIDS} pairs of a body and a shape of the tool"
            raise SceneError(None, "keep_out", len(self.kept_out), expected)
        for index, each in self.obstacles:
            if isinstance(each, Polytope) and len(each.triangles) > MOST_TRIANGLES:
                expected = f"a hull, grown by the tool, of at most {MOST_TRIANGLES} triangles"
                raise SceneError(None, f"keep_out[{index}].hull", len(each.triangles), expected)
        return self

    @model_validator(mode="after")
    def _links_are_known(self) -> Self:
        if self.robot_keeps_clear and not self.robot.has_links:
            expected = "false, for the links of this robot are not known"
            raise SceneError(None, "robot_keeps_clear", True, expected)
        return self

    @model_validator(mode="after")
    def _limits_tighten_the_drive(self) -> Self:
        for limit in LIMITS:
            if limit.key:
                limit.items(self)
        return self


@lru_cache(maxsize=256)
def limits_of(scene: Scene) -> SceneLimits:
    """The limits that apply in a scene, with their numbers.

    Raises SceneError for a payload that varies where a limit is not known to hold between both ends
    of its range.
    """
    if scene.least_payload is None:
        return SceneLimits.of(LIMITS, scene)
    place, lighter = LIMITS.index(KeepOut()), list[Limit]()
    for limit in LIMITS:
        constraints = SceneLimits.of([limit], scene).constraints
        if not constraints.of_torque.any():
            continue
        if not constraints.holds_between_payloads:
            masses, name = [scene.least_payload, scene.payload], limit.name
            expected = f"one mass, since the limit {name} may be exceeded between two that keep it"
            raise SceneError(None, "payload", masses, expected)
        lighter.append(WithLeastPayload(limit))
    return SceneLimits.of([*LIMITS[:place], *lighter, *LIMITS[place:]], scene)


def _without_shares(limits: object, robot: Machine) -> object:
    """The content of the key ``limits``, with shares of the drive's such as "85 %" as numbers."""
    if not isinstance(limits, dict):
        return limits
    motors = {limit.key.name: limit for limit in LIMITS if isinstance(limit, MotorLimit)}
    return {
        key: motors[key].without_shares(value, robot) if key in motors else value
        for key, value in limits.items()
    }


def load_scene(path: str | Path) -> Scene:
    """Read a scene file and the robot file it names.

    Raises SceneError, naming file and key, if either cannot be used.
    """
    file = Path(path)
    content = read_yaml(file)
    for key, expected in _NO_KEYS.items():
        if key in content:
            raise SceneError(file, key, None, expected, "is not a known key", place_of(file, key))
    if "robot" in content:
        content["robot"] = load_robot(_robot_file(file, content["robot"]))
    given = content.get("path")
    if isinstance(given, dict) and isinstance(given.get("points"), str):
        content["path"] = {**given, "points": _points(file, given["points"])}
    bodies = content.get("keep_out")
    if isinstance(bodies, list):
        named = ((f"keep_out[{index}]", body) for index, body in enumerate(bodies))
        content["keep_out"] = [_with_points(file, *each) for each in named]
    return Scene.from_content(content, file)


def _with_points(scene_file: Path, key: str, body: object) -> object:
    """The content of a body, whose key this is, with the corners of a file's convex hull instead of
    its name."""
    hull = body.get("hull") if isinstance(body, dict) else None
    if not (isinstance(hull, dict) and isinstance(hull.get("file"), str)):
        return body
    named = f"{key}.hull.file"
    try:
        points = corners_in(scene_file.parent / hull["file"])
        points = points[np.unique(convex_hull(points, MOST_TRIANGLES))]
    except NoHull as error:
        place, expected = place_of(scene_file, named), f"an STL file with {error}"
        raise SceneError(scene_file, named, hull["file"], expected, place=place) from None
    except SceneError as error:
        place, problem = place_of(scene_file, named), f"{error.file} {error.problem}"
        raise SceneError(scene_file, named, hull["file"], error.expected, problem, place) from None
    others = {key: value for key, value in hull.items() if key != "file"}
    return {"hull": {**others, "points": points.tolist()}}


def _points(scene_file: Path, name: str) -> list[list[float]]:
    """The points of a CSV file, relative to the scene file."""
    try:
        return points_in(scene_file.parent / name)
    except SceneError as error:
        place = place_of(scene_file, "path.points")
        raise error.inside(file=scene_file, place=place) from None


def _robot_file(scene_file: Path, value: object) -> Path:
    if isinstance(value, str) and os.path.isfile(scene_file.parent / value):
        return scene_file.parent / value
    problem = f"is {shown(value)}, which is no file" if isinstance(value, str) else ""
    place = place_of(scene_file, "robot")
    raise SceneError(scene_file, "robot", value, _ROBOT_FILE, problem, place)
