"""The points of a sweep: which there are, in an order that is always the same."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

FACTS = {
    "duration": "duration (s)",
    "parts_per_minute": "parts per minute",
    "rms_share": "RMS torque over rated",
    "torque_share": "largest torque over its limit",
    "singularity": "distance to singularities",
    "limited_by": "limited by",
    "verified": "verified",
    "gap": "estimated gap",
    "seconds": "time of a processor (s)",
    "error": "error",
}
"""Columns of every table, and what pictures call them. ``duration``: of a motion, or the period of
a cycle, s. ``parts_per_minute``: of a single motion as if it went there and back. ``rms_share``:
the RMS torque of the motor that is warmest if this goes on without a pause, over what it is rated
for. ``torque_share``: the largest torque over its limit. ``singularity``: the least distance from
any, 1 at best. ``limited_by``: the limit that the motion is at for most of the time. ``verified``:
yes or no. ``gap``: how much longer than the optimum it is, estimated. ``seconds``: of a processor.
``error``: what verification finds wrong, or why there is no plan."""

NUMBERS = [name for name in FACTS if name not in ("limited_by", "verified", "error")]
"""Those of them that are numbers."""

_FIRST = ("point", "inputs", "scene", "robot")
"""Columns before those of what is changed."""

Changes = Mapping[str, Any]
"""Of a point: the value of each header that it changes."""


def column_of(header: str) -> str:
    """The column of what is changed: its header, after the word scene where the table has a column
    of this name for something else, as for the key ``duration``."""
    return f"scene.{header}" if header in (*_FIRST, *FACTS) else header


@dataclass(frozen=True)
class Base:
    """What is changed: the ``content`` of a scene or a cycle and its robot. ``name``: by which
    columns tell it from other bases. ``file``: what errors name."""

    name: Mapping[str, str]
    file: Path
    content: Mapping[str, Any]


@dataclass(frozen=True)
class Task:
    """A point to plan: its ``index``, what is to be changed in its ``base``, and the ``tolerance``
    of its plan."""

    index: int
    base: Base
    changes: Changes
    tolerance: float

    @property
    def head(self) -> dict[str, Any]:
        """The first columns of its row: its number, a hash of all that its plan depends on, what
        its base is called, and its values."""
        given = json.dumps([self.base.content, self.changes, self.tolerance], sort_keys=True)
        inputs = sha256(given.encode()).hexdigest()[:12]
        changes = {column_of(header): value for header, value in self.changes.items()}
        return {"point": self.index, "inputs": inputs, **self.base.name, **changes}


@dataclass(frozen=True)
class SweepPoints:
    """All bases, each with one set of changes of each of the ``axes`` together.

    ``keys``: which columns the changes have, in order. ``tolerance``: of the plans.
    """

    bases: Sequence[Base]
    axes: Sequence[Sequence[Changes]]
    keys: Sequence[str]
    tolerance: float = 1e-3

    @property
    def columns(self) -> list[str]:
        """Of the table: those of the head of a task, and the facts of its plan."""
        return ["point", "inputs", *self.bases[0].name, *self.keys, *FACTS]

    def __len__(self) -> int:
        return len(self.bases) * prod(map(len, self.axes))

    def __iter__(self) -> Iterator[Task]:
        pairs = ((base, parts) for base in self.bases for parts in product(*self.axes))
        for index, (base, parts) in enumerate(pairs):
            changes = {key: value for part in parts for key, value in part.items()}
            yield Task(index, base, changes, self.tolerance)
