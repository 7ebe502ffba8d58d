"""Tasks: where and how fast a motion begins and ends."""

from __future__ import annotations

from dataclasses import dataclass
from math import dist
from typing import ClassVar

from deltaopt.errors import EndMoves, in_words
from deltaopt.files.validated_record import Vector3, vector3
from deltaopt.problem.boundary import Boundary
from deltaopt.scene.path import Path


@dataclass(frozen=True)
class BetweenEnds:
    """The task to move from ``start`` to ``goal`` on any path.

    ``via``: points that are passed on the way, in this order, at any speed. ``within``: a
    tube in words, that the motion stays in.
    ``levels``: depths in m that are passed first upwards from the start and last downwards to the
    goal; none without an approach.
    """

    start: Boundary
    goal: Boundary
    via: tuple[Boundary, ...] = ()
    within: str = ""
    levels: tuple[float, ...] = ()

    @property
    def gates(self) -> tuple[Boundary, ...]:
        return self.via or tuple(Boundary.passed((level, None, None)) for level in self.levels)

    @property
    def moves_at_ends(self) -> bool:
        return not (self.goal.is_given and self.start.is_at_rest and self.goal.is_at_rest)

    @property
    def is_at_rest(self) -> bool:
        return not self.moves_at_ends

    @property
    def description(self) -> str:
        through = _through(self.via)
        if self.goal.is_anywhere:
            return "the fastest stop"
        if self.goal.moves:
            return f"to a point on a belt{through}, path free"
        if not self.goal.is_at_rest:
            return f"to a point that stands still, passed in motion{through}, path free"
        if not self.start.is_at_rest:
            return f"from a state to rest{through}, path free"
        if self.within:
            return f"from rest to rest, {self.within}"
        if self.levels:
            return "from rest to rest, up and down in cylinders, path free between"
        return f"from rest to rest{through}, path free{' between' if through else ''}"


@dataclass(frozen=True)
class OnPath:
    """The task to move on a given path, at given speeds at its ends.

    ``begin``, ``end``: where it begins and ends, m. ``path``: the curve between them.
    ``speeds``: along it at both ends, m/s. ``shape``: the path in words.
    """

    begin: Vector3
    end: Vector3
    path: Path
    speeds: tuple[float, float]
    shape: str
    via: ClassVar[tuple[Boundary, ...]] = ()
    gates: ClassVar[tuple[Boundary, ...]] = ()
    moves_at_ends: ClassVar[bool] = False

    @property
    def start(self) -> Boundary:
        return self._at(0, self.begin)

    @property
    def goal(self) -> Boundary:
        return self._at(1, self.end)

    @property
    def is_at_rest(self) -> bool:
        return self.speeds == (0.0, 0.0)

    @property
    def description(self) -> str:
        moves = "from rest to rest" if self.is_at_rest else "from speed to speed"
        return f"{moves}, {self.shape}"

    @property
    def rates(self) -> tuple[float, float]:
        """ds/dt of the path's parameter at both ends, 1/s times its unit."""
        if self.is_at_rest:
            return self.speeds
        first, last = (
            speed / float(rate) if speed else 0.0
            for speed, rate in zip(self.speeds, self.path.end_speeds, strict=True)
        )
        return first, last

    def _at(self, end: int, position: Vector3) -> Boundary:
        speed = self.speeds[end]
        if not speed:
            return Boundary(position)
        s = self.path.knots[[0, -1]][end]
        return Boundary(position, vector3(self.path(s, 1)[0] * self.rates[end]))


Task = BetweenEnds | OnPath
"""The boundary values of a motion: ``start`` and ``goal``; ``via`` points and ``gates`` where its
phases meet; whether it ``is_at_rest`` at both ends, or an end moves or is not given, so that it
cannot be slowed: ``moves_at_ends``; and its ``description`` in words."""


def _through(via: tuple[Boundary, ...]) -> str:
    """Via points in words: "", " through a via point", " through 2 via points"."""
    if not via:
        return ""
    return " through a via point" if len(via) == 1 else f" through {len(via)} via points"


def given_points(task: Task) -> tuple[Vector3, Vector3]:
    """Start and goal, m, of a motion that is at rest at both, or on a given path.

    Raises EndMoves for others: methods that slow a motion, or compare it with a straight line
    from rest to rest, have nothing to say of them.
    """
    if task.moves_at_ends:
        goal = "rest anywhere" if task.goal.is_anywhere else "moving"
        end = f"goal is {goal}" if task.start.is_at_rest else "start is moving"
        raise EndMoves(f"{end}; this is for motions from rest at one point to rest at another")
    return task.start.position, task.goal.position


def given_goal(task: Task) -> Boundary:
    """The goal of a task, a point or one that moves. Raises EndMoves for rest anywhere."""
    if task.goal.is_anywhere:
        raise EndMoves("the goal is rest anywhere; this is for motions to a place")
    return task.goal


def ends_in_words(task: Task) -> str:
    """From where to where a motion leads: points in m, and velocities in m/s where they move."""
    if task.moves_at_ends:
        return f"{task.start.description} to {task.goal.description}"
    start, goal = (in_words(point) for point in given_points(task))
    return f"{start} to {goal} m"


def distance(task: Task) -> float:
    """The straight distance from start to goal, m. Raises EndMoves as ``given_points`` does."""
    start, goal = given_points(task)
    return dist(goal, start)
