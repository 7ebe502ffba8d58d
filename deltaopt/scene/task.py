"""What a motion is to do: where and how fast it begins and ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from deltaopt.files.validated_record import Vector3

REST = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class EndState:
    """The platform at an end of a motion: ``position`` (m) and ``velocity`` (m/s)."""

    position: Vector3
    velocity: Vector3 = REST


class Task(Protocol):
    """What is known about both ends of a motion; a scene describes one."""

    @property
    def start(self) -> EndState: ...
    @property
    def goal(self) -> EndState: ...

    @property
    def description(self) -> str:
        """In words, for people."""
        ...


@dataclass(frozen=True)
class RestToRest:
    """From rest at one point to rest at another, on any path; positions in m."""

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


def distance(task: Task) -> float:
    """From start to goal in a straight line, m."""
    return float(np.linalg.norm(np.subtract(task.goal.position, task.start.position)))
