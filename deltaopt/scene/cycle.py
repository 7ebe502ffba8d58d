"""Cycles: legs one after the other, over and over, and what motors may heat up in them."""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, hypot
from typing import Annotated, Any, Literal

from pydantic import Field

from deltaopt.errors import SceneError, in_words, inside, shown
from deltaopt.files.units import DURATION, TORQUE
from deltaopt.files.validated_record import (
    NonNegative,
    PerMotor,
    Positive,
    Record,
    Vector3,
    optional,
    per_motor,
)
from deltaopt.problem.boundary import REST
from deltaopt.scene.moving_ends import Anywhere, Belt, End, Start, State, content_of_end
from deltaopt.scene.objective import Time
from deltaopt.scene.scene import Scene
from deltaopt.scene.way import Approach

MOST_LEGS = 100
_SAME_SPEED = 1e-6
"""Of a speed: by how much the velocity of a leg may be off that of the one before: points of a path
are rounded to a micrometre."""
EXPECTED_LEGS = f"two to {MOST_LEGS} legs, each a mapping with a goal, the last of them the start"
FREE = "free"
EXPECTED_DWELL = f"a duration in s, at least 0, or the word {FREE}"
EXPECTED_RMS = "a torque in N·m, greater than 0, one for all motors or three, or the word none"
THERE = "the point or state that the next leg starts in"
CLOSED = "the point or state that the first leg starts in, for a cycle ends where it begins"

_Wait = Annotated[NonNegative, DURATION] | Literal["free"]


class _Dwell(Record):
    """How long the robot waits after one leg, s."""

    dwell: _Wait = Field(description=EXPECTED_DWELL)


class Cycle(Record):
    """Legs that a robot drives one after the other, over and over.

    ``legs``: scenes, each of which starts where the one before ends, and the first where the last
    one ends. What moves on a belt is where its leg says at the start of the cycle; where the cycle
    starts on a belt, the last leg meets the next part, a period later. ``dwells``: how long the
    robot waits after each leg, still with its payload, s; on a belt it moves along. "free" is where
    it may wait for what is left of a given period, or until its motors are cool. ``period``: of the
    cycle, if it is given, s: then the motors' heat is the least in it; otherwise the period is.
    ``rms_torque``: what the root of the mean square of each motor's torque in a period may be, N·m;
    by default what the motors are rated for, if the robot says so; "none" for no limit. Raises
    SceneError for values that cannot be used.

    Examples:
        >>> scene = deltaopt.load_scene("problems/pick_and_place.yaml")
        >>> back = scene.model_copy(update={"start": scene.goal, "goal": scene.start})
        >>> deltaopt.Cycle(legs=(scene, back), dwells=(0.05, 0.05)).parts
        1
    """

    legs: tuple[Scene, ...] = Field(min_length=2, max_length=MOST_LEGS, description=EXPECTED_LEGS)
    dwells: tuple[_Wait, ...] = Field(default=(), description=f"for each leg {EXPECTED_DWELL}")
    period: Annotated[Positive, DURATION] | None = None
    rms_torque: Annotated[PerMotor, TORQUE] | Literal["none"] | None = optional(EXPECTED_RMS)

    def __repr__(self) -> str:
        return f"<Cycle of {len(self.legs)} legs: {self.legs[0].robot.name}>"

    __str__ = __repr__

    @classmethod
    def _read(cls, content: dict[str, Any]) -> dict[str, Any]:
        legs, dwells = content.get("legs"), content.get("dwells")
        if dwells is None and isinstance(legs, Sequence):
            dwells = (0.0,) * len(legs)
        for index, dwell in enumerate(dwells if isinstance(dwells, Sequence) else ()):
            with inside(key=f"cycle[{index}]"):
                _Dwell(dwell=dwell)
        return {**content, "dwells": dwells}

    def require_consistent(self) -> None:
        if len(self.dwells) != len(self.legs):
            raise SceneError(None, "dwells", list(self.dwells), f"{len(self.legs)} of them")
        for index, scene in enumerate(self.legs):
            key = f"cycle[{index}]"
            if isinstance(scene.goal, Anywhere):
                raise SceneError(None, f"{key}.goal", "anywhere", "a place, for the next leg")
            if not isinstance(scene.objective, Time):
                expected = "time: a cycle takes the least period, or the least heat in a given one"
                raise SceneError(None, "objective", str(scene.objective), expected)
            if scene.least_duration:
                raise SceneError(None, "rotation", None, "none in a cycle", "is given")
            is_passed = isinstance(scene.goal, State)
            if is_passed and self.dwells[index]:
                expected = "0 where the goal is passed in motion"
                raise SceneError(None, f"{key}.dwell", self.dwells[index], expected)
            if self.dwells[index] == FREE and self.on_belts:
                expected = "a duration in a cycle with a belt, which does not wait"
                raise SceneError(None, f"{key}.dwell", FREE, expected)
            robot, first = scene.robot, self.legs[0].robot
            if robot.model_copy(update={"tool": first.tool}) != first:
                expected = f"that of the first leg, {shown(first.name)}, with the same values"
                raise SceneError(None, f"{key}.robot", robot.name, expected)
            offset, same = list(robot.tool_offset), list(first.tool_offset)
            if offset != same:
                expected = f"{same}, that of the first leg: it does not jump between legs"
                raise SceneError(None, f"{key}.tool.offset", offset, expected)
            before = self.legs[index - 1].goal
            if isinstance(before, Belt) and index == 0:
                before = start_after(before) or before
            if not isinstance(before, Belt) and before != scene.start:
                last = f"cycle[{(index - 1) % len(self.legs)}].goal"
                raise SceneError(
                    None, last, content_of_end(before), CLOSED if index == 0 else THERE
                )
            self._require_speeds_of_paths(index)
        if isinstance(self.legs[-1].goal, Belt) and self.period is not None:
            expected = "none in a cycle that starts on a belt: parts follow when it is over"
            raise SceneError(None, "period", self.period, expected)
        if is_passed and self.period is not None and FREE not in self.dwells:
            expected = f"none, or a dwell that is {FREE} elsewhere: {key}.goal is passed in motion"
            raise SceneError(None, "period", self.period, expected)

    def _require_speeds_of_paths(self, index: int) -> None:
        """Raise SceneError where a path ends or begins at a speed between a leg and the one before,
        and the other one or the dwell between does not go on with it."""
        paths = ((k, self.legs[k].path) for k in (index, index - 1))
        fast = next(((k, path) for k, path in paths if path is not None and any(path.speeds)), None)
        if fast is None:
            return
        ends, begins = self.legs[index - 1].task.goal.velocity, self.legs[index].task.start.velocity
        waits = self.dwells[index - 1] and any(ends)
        if waits or dist(ends, begins) > _SAME_SPEED * hypot(*ends):
            key = f"cycle[{fast[0] % len(self.legs)}].path.speeds"
            expected = (
                "what the legs beside it begin and end at, and 0 where the robot dwells: between "
                f"them velocities are {in_words(ends)} and {in_words(begins)} m/s"
            )
            raise SceneError(None, key, list(fast[1].speeds), expected)

    @property
    def on_belts(self) -> bool:
        """Whether a leg ends on a belt."""
        return any(isinstance(scene.goal, Belt) for scene in self.legs)

    @property
    def least_dwells(self) -> tuple[float, ...]:
        """How long the robot waits at least after each leg, s."""
        return tuple(0.0 if isinstance(dwell, str) else dwell for dwell in self.dwells)

    @property
    def free_dwells(self) -> tuple[int, ...]:
        """After which legs the robot may wait longer than that: after the last one, unless others
        are named."""
        named = tuple(index for index, dwell in enumerate(self.dwells) if dwell == FREE)
        return named or (len(self.legs) - 1,)

    @property
    def rms_limits(self) -> Vector3 | None:
        """What the RMS of each motor's torque may be, N·m; None without a limit."""
        if self.rms_torque == "none":
            return None
        given = self.rms_torque
        return self.legs[0].robot.rms_torque if given is None else per_motor(given)

    @property
    def parts(self) -> int:
        """How many parts a cycle moves: after so many legs the payload grows; one at least."""
        masses = [scene.payload or 0.0 for scene in self.legs]
        return max(1, sum(a < b for a, b in zip(masses, masses[1:] + masses[:1], strict=True)))

    def leg(self, index: int, begins: float, start: Start) -> Scene:
        """The scene of a leg that begins so long after the cycle does, s, in a state."""
        scene = self.legs[index]
        goal = scene.goal
        if isinstance(goal, Belt) and index == len(self.legs) - 1:
            goal = State(at=goal.after(-self.least_dwells[index]).at, velocity=goal.belt)
        elif isinstance(goal, Belt):
            goal = goal.after(begins)
        return scene.model_copy(update={"start": start, "goal": goal})

    def after(self, index: int, reached: Vector3) -> Start:
        """Where the leg after one begins that ``reached`` a point (m), when its dwell is over."""
        goal = self.legs[index].goal
        if isinstance(goal, Belt):
            goal = Belt(at=reached, belt=goal.belt).after(self.least_dwells[index])
        start = start_after(goal)
        assert start is not None
        return start

    def velocity_after(self, index: int) -> Vector3:
        """At which the robot moves along during the dwell after a leg, m/s."""
        goal = self.legs[index].goal
        return goal.belt if isinstance(goal, Belt) else REST


def there_and_back(scene: Scene) -> Cycle:
    """A scene's motion and the way back with the same payload, over and over without a pause.

    Raises SceneError for a motion that does not begin and end at rest, or on a given path.
    """
    if scene.moves_at_ends:
        raise SceneError(None, "goal", None, "points at rest, for there and back", "moves")
    if scene.path is not None:
        raise SceneError(None, "path", None, "none beside it, for there and back", "is given")
    via, approach = scene.via, scene.approach
    changed = {
        "start": scene.goal,
        "goal": scene.start,
        "via": via and via[::-1],
        "approach": approach and Approach(start=approach.goal, goal=approach.start),
    }
    return Cycle(legs=(scene, scene.model_copy(update=changed)))


def start_after(goal: End) -> Start | None:
    """Where the leg after a goal starts, if the robot does not wait; None after a stop anywhere."""
    if isinstance(goal, Belt):
        return State(at=goal.at, velocity=goal.belt)
    return None if isinstance(goal, Anywhere) else goal
