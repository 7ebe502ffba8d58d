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

from deltaopt.sweeps.row import FACTS, Task

Changes = Mapping[str, Any]
"""Of a point: the value of each of its columns."""


@dataclass(frozen=True)
class Base:
    """What is changed: the ``content`` of a scene or a cycle and its robot. ``name``: by which
    columns tell it from other bases. ``file``: what errors name."""

    name: Mapping[str, str]
    file: Path
    content: Mapping[str, Any]


@dataclass(frozen=True)
class Points:
    """All bases, each with one set of changes of each of the ``axes`` together.

    ``keys``: which columns the changes have, in order. ``tolerance``: of the plans.
    """

    bases: Sequence[Base]
    axes: Sequence[Sequence[Changes]]
    keys: Sequence[str]
    tolerance: float = 1e-3

    @property
    def columns(self) -> list[str]:
        """Of the table: the number of the point, a hash of all that its plan depends on, what its
        base is called, its values, and the facts of its plan."""
        return ["point", "inputs", *self.bases[0].name, *self.keys, *FACTS]

    def __len__(self) -> int:
        return len(self.bases) * prod(map(len, self.axes))

    def __iter__(self) -> Iterator[tuple[Task, dict[str, Any]]]:
        """Each point with the first columns of its row."""
        pairs = ((base, parts) for base in self.bases for parts in product(*self.axes))
        for index, (base, parts) in enumerate(pairs):
            changes = {key: value for part in parts for key, value in part.items()}
            task = Task(index, base.file, base.content, changes, self.tolerance)
            given = json.dumps([base.content, changes, self.tolerance], sort_keys=True)
            inputs = sha256(given.encode()).hexdigest()[:12]
            yield task, {"point": index, "inputs": inputs, **base.name, **changes}
