"""Tasks: where and how fast a motion begins and ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from deltaopt.files.validated_record import Vector3
from deltaopt.scene.path import GivenPath, Path

REST = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class EndState:
    """The state of the platform at an end of a motion: ``position`` in m, ``velocity`` in m/s."""

    position: Vector3
    velocity: Vector3 = REST


class Task(Protocol):
    """The boundary values of a motion, at its start and its goal."""

    @property
    def start(self) -> EndState: ...
    @property
    def goal(self) -> EndState: ...

    @property
    def description(self) -> str:
        """The task in words, for a table."""
        ...


@dataclass(frozen=True)
class RestToRest:
    """The task to move from rest at ``begin`` to rest at ``end``, in m, on any path."""

    begin: Vector3
    end: Vector3

    @property
    def start(self) -> EndState:
        return EndState(self.begin)

    @property
    def goal(self) -> EndState:
        return EndState(self.end)

    @property
    def description(self) -> str:
        return "from rest to rest, path free"


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

    @classmethod
    def of(cls, begin: Vector3, end: Vector3, given: GivenPath) -> OnPath:
        """On a path that a scene gives."""
        return cls(begin, end, given.between(begin, end), given.speeds, given.description)

    @property
    def start(self) -> EndState:
        return self._at(0, self.begin)

    @property
    def goal(self) -> EndState:
        return self._at(1, self.end)

    @property
    def description(self) -> str:
        moves = "from rest to rest" if self.speeds == (0.0, 0.0) else "from speed to speed"
        return f"{moves}, {self.shape}"

    @property
    def rates(self) -> tuple[float, float]:
        """ds/dt of the path's parameter at both ends, 1/s times its unit."""
        if self.speeds == (0.0, 0.0):
            return self.speeds
        first, last = (
            speed / float(rate) if speed else 0.0
            for speed, rate in zip(self.speeds, self.path.end_speeds, strict=True)
        )
        return first, last

    def _at(self, end: int, position: Vector3) -> EndState:
        speed = self.speeds[end]
        if not speed:
            return EndState(position)
        s = self.path.knots[[0, -1]][end]
        x, y, z = (self.path(s, 1)[0] * self.rates[end]).tolist()
        return EndState(position, (x, y, z))


def distance(task: Task) -> float:
    """The straight distance from start to goal, m."""
    return float(np.linalg.norm(np.subtract(task.goal.position, task.start.position)))
