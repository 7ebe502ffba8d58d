"""Tasks: where and how fast a motion begins and ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from deltaopt.files.validated_record import Vector3

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


def distance(task: Task) -> float:
    """The straight distance from start to goal, m."""
    return float(np.linalg.norm(np.subtract(task.goal.position, task.start.position)))
