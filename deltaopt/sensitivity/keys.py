"""The content of scene and robot files by dotted keys: changes of it, and the numbers in it.

A change is written as the header of a column and a value: ``payload`` is replaced by it,
``robot.drive.torque times`` multiplied by it, ``robot.upper_arm.length plus`` made larger by it.
Several keys before the last word get the same change. Places in lists are numbers:
``cycle[0].payload``, ``goal[2]``, or ``goal.2``. ``place.x``, ``place.y`` and ``place.z`` are no
keys of a file, but where the middle of all starts and goals is: all points and bodies are moved
along with it, or the robot the other way.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, combinations
from pathlib import Path
from typing import Any, get_args

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError, shown
from deltaopt.files.units import LENGTH, RATIO, Misread, Quantity, percentage
from deltaopt.files.validated_record import Record
from deltaopt.robot.robot import Robot
from deltaopt.scene.cycle import Cycle
from deltaopt.scene.scene import Scene
from deltaopt.scene.scene_file import made_of

Content = dict[str, Any]
Job = Scene | Cycle
PLACE = ("place.x", "place.y", "place.z")
_HOW: dict[str, Callable[[Any, Any], Any]] = {
    "times": lambda old, by: np.multiply(old, by).tolist(),
    "plus": lambda old, by: np.add(old, by).tolist(),
}
_POINTS = {"at", "from", "to", "centre", "point", "start", "goal"}
"""Keys of points in space, of scenes and of bodies, and of lists of them:"""
_LISTS_OF_POINTS = {"via", "points"}
_IN_CELL = ("start", "goal", "via", "path", "keep_out")
"""Keys of a scene under which points stand. Those of a tool are in its own frame, and an approach
has the keys start and goal for other things."""


def changed(content: Mapping[str, Any], changes: Mapping[str, Any]) -> Content:
    """The content of files with changes, in SI units, by the headers of their columns.

    Raises SceneError where there is no such key to change.
    """
    found: Content = json.loads(json.dumps(content))
    for header, value in changes.items():
        keys, how = _keys(header), _HOW.get(header.split()[-1], lambda _, by: by)
        by = in_si(header, value) if _is_by_a_number(header) else value
        for key in keys:
            change = _moved if key.startswith("place.") else _change
            found = change(found, key, how, by)
    return found


def require_once(headers: Iterable[str]) -> None:
    """Raise SceneError where several headers change the same key, or a key and a part of what is
    under it: one change would undo another."""
    keys = chain.from_iterable(map(_keys, headers))
    for (key, parts), (other, others) in combinations([(key, parts_of(key)) for key in keys], 2):
        if all(one == another for one, another in zip(parts, others, strict=False)):
            problem = "is changed twice" if key == other else f"is changed by {other} too"
            raise SceneError(None, key, None, "one change of each key", problem)


def parts_of(key: str) -> list[str | int]:
    """The names and places in lists that a key is made of."""
    parts = re.findall(r"[^.\[\]]+", key)
    return [int(part) if part.isdecimal() else part for part in parts]


def _change(content: Content, key: str, how: Callable[[Any, Any], Any], by: Any) -> Content:
    """Change the value at a dotted key. Raises SceneError."""
    node: Any = content
    *outside, last = parts_of(key)
    for part in outside:
        place = _place_in(node, part, key)
        node = node.setdefault(place, {}) if isinstance(node, dict) else node[place]
    place = _place_in(node, last, key)
    old = node.get(place) if isinstance(node, dict) else node[place]
    try:
        node[place] = how(in_si(key, old), by)
    except TypeError:
        problem = "is not given in the file" if old is None else "is no number in the file"
        raise SceneError(None, key, old, "a number to change", problem) from None
    return content


def _place_in(node: Any, part: str | int, key: str) -> Any:
    """The key of a mapping, or the place in a list, that a part of a key names."""
    if isinstance(node, dict):
        return str(part)
    if isinstance(node, list) and isinstance(part, int) and part < len(node):
        return part
    of_list = f"a place in a list of {len(node)}, counted from 0" if isinstance(node, list) else ""
    raise SceneError(None, key, None, of_list or "a key that is there", f"has no part {part}")


def ends_of(content: Mapping[str, Any]) -> Array:
    """All starts and goals of a scene or a cycle, each once, (N, 3), m."""
    legs = chain([content], content.get("cycle") or ())
    ends = (leg[end] for leg in legs for end in ("start", "goal") if end in leg)
    points = (end["at"] if isinstance(end, dict) else end for end in ends)
    known = [LENGTH.in_si(point) for point in points if not isinstance(point, str)]
    return np.unique(np.array(known, dtype=float), axis=0)


def _moved(content: Content, key: str, how: Callable[[Any, Any], Any], to: Any) -> Content:
    """A scene or a cycle with all its points elsewhere: the middle of its ends along one axis."""
    if key not in PLACE:
        raise SceneError(None, key, None, "place.x, place.y or place.z", "is not a known key")
    by, old = np.zeros(3), float(ends_of(content).mean(axis=0)[PLACE.index(key)])
    by[PLACE.index(key)] = how(old, to) - old

    def moved(key: str, value: Any) -> Any:
        if key in _POINTS and isinstance(value, list):
            return np.add(LENGTH.in_si(value), by).tolist()
        if isinstance(value, list):
            return [moved("at" if key in _LISTS_OF_POINTS else "", each) for each in value]
        return {k: moved(k, v) for k, v in value.items()} if isinstance(value, dict) else value

    for leg in [content, *content.get("cycle", ())]:
        leg |= {key: moved(key, leg[key]) for key in _IN_CELL if key in leg}
    return content


def in_si(header: str, value: Any) -> Any:
    """The value of a change, or a list of such, in the SI unit of what its header names: text in
    another unit of it becomes a number, and what is no number stays, shares such as "85 %" too, for
    it is not known what of. Raises SceneError where its unit is another, or it is too large, or
    where it is no number by which another one can be changed."""
    found = [_in_si(header, key, value) for key in _keys(header)][-1]
    if _is_by_a_number(header) and not isinstance(found, int | float):
        expected = f"one number in {unit_of(header)}".removesuffix(" in ")
        raise SceneError(None, header, value, f"{expected}, by which all of it is changed")
    return found


def _is_by_a_number(header: str) -> bool:
    """Whether a header's values change numbers by a number, or places to one."""
    return header.split()[-1] in _HOW or any(key in PLACE for key in _keys(header))


def unit_of(header: str) -> str:
    """The SI unit of the values of a change by its header; empty without one."""
    quantity = _changed(header, _keys(header)[0])
    return quantity.unit if quantity else ""


def _in_si(header: str, key: str, value: Any) -> Any:
    if isinstance(value, list | tuple):
        return [_in_si(header, f"{key}.{place}", each) for place, each in enumerate(value)]
    quantity = _changed(header, key)
    if quantity is None or (quantity.unit and percentage(value) is not None):
        return value
    try:
        return quantity.in_si(value)
    except Misread as error:
        unit = f"in {quantity.unit}" if quantity.unit else "without unit"
        problem = f"is {shown(value)}, which {error}"
        raise SceneError(None, header, value, f"a number {unit}{error.hint}", problem) from None


def _keys(header: str) -> list[str]:
    """The keys that a header names. Raises SceneError where it names none."""
    words = header.split()
    keys = words[:-1] if words and words[-1] in _HOW else words
    if not (keys and all(map(parts_of, keys))):
        expected = "a key, such as payload, alone or before times or plus"
        raise SceneError(None, header, None, expected, "names no key to change")
    return keys


def _changed(header: str, key: str) -> Quantity | None:
    """What a number is by which a key of a header is changed."""
    if header.endswith(" times"):
        return RATIO
    return LENGTH if key in PLACE else _quantity(key)


def _quantity(key: str) -> Quantity | None:
    """What a number of a scene, of its robot or of a cycle is; None where its key does not tell."""
    kinds, parts = list[Any]([Scene]), parts_of(key.replace(".dwell", ".dwells"))  # as records do
    for name in parts:
        each = (kind for kind in (*kinds, Cycle) if isinstance(kind, type))
        records = (kind for kind in each if issubclass(kind, Record))
        fields = (record.model_fields.get(str(name)) for record in records)
        field = next(filter(None, fields), None)
        if field is not None:  # else a place in a list, or the word that tells a path's kind
            inside = _inside(field.annotation)
            kinds = [Robot] if name == "robot" else [*inside, *field.metadata]
    found = [kind for kind in kinds if isinstance(kind, Quantity)]
    of_point = parts[-1] if isinstance(parts[-1], int) and len(found) > 1 else 0
    return found[of_point] if of_point < len(found) else None


def _inside(kind: Any) -> Iterator[Any]:
    """A type and all that it is made of, marks among them."""
    yield kind
    for inner in get_args(kind):
        yield from _inside(inner)


@dataclass(frozen=True)
class Number:
    """A number of a file: its ``key``, such as keep_out[0].box.from[1], and its ``value`` in the SI
    ``unit``."""

    key: str
    value: float
    unit: str

    @property
    def step(self) -> float:
        """A change that is worth telling: one tooth more or less of a gear, 1 mm of a coordinate, 1
        % of anything else."""
        if self.key.endswith(".ratio"):
            return 1.0
        is_place = self.unit == "m" and self.key.endswith("]")
        return 1e-3 if is_place or not self.value else 0.01 * abs(self.value)


def content_of(job: Job) -> dict[str, Any]:
    """The content of the file of a scene or a cycle, with that of the robot's file as ``robot``.

    Of a cycle's legs what they share stands beside them; its ``start`` is the last leg's goal.
    """
    if isinstance(job, Scene):
        return job.model_dump(exclude_none=True)
    legs = [leg.model_dump(exclude_none=True) for leg in job.legs]
    if any(leg["robot"] != legs[0]["robot"] for leg in legs):  # by their tools
        for leg in legs:
            leg |= {key: leg["robot"].pop(key) for key in ("tool",) if key in leg["robot"]}
    limits = [leg.pop("limits", {}) for leg in legs]
    of_all = {key: x for key, x in limits[0].items() if all(one.get(key) == x for one in limits)}
    for leg, each in zip(legs, limits, strict=True):
        if alone := {key: x for key, x in each.items() if key not in of_all}:
            leg["limits"] = alone
    shared = {
        key: value
        for key, value in legs[0].items()
        if key not in ("start", "goal", "limits") and all(leg.get(key) == value for leg in legs)
    }
    own = [{key: leg[key] for key in leg if key not in (*shared, "start")} for leg in legs]
    cycle = [{**leg, "dwell": dwell} for leg, dwell in zip(own, job.dwells, strict=True)]
    if job.rms_torque is not None:
        of_all["rms_torque"] = job.rms_torque
    if of_all:
        shared["limits"] = of_all
    return {**shared, "cycle": cycle, **({} if job.period is None else {"period": job.period})}


def job_of(content: Content) -> Any:
    """The scene or the cycle of such a content. Raises SceneError for one that cannot be used."""
    legs = content.get("cycle")
    return made_of(content if legs is None else {**content, "start": legs[-1]["goal"]}, Path())


def numbers_in(content: Any, key: str = "") -> Iterator[Number]:
    """All numbers of a content, or of what it has under a key."""
    if isinstance(content, Mapping):
        for name, value in content.items():
            yield from numbers_in(value, f"{key}.{name}".removeprefix("."))
    elif isinstance(content, Sequence) and not isinstance(content, str):
        for index, value in enumerate(content):
            yield from numbers_in(value, f"{key}[{index}]")
    elif isinstance(content, int | float) and not isinstance(content, bool):
        yield Number(key, float(content), unit_of(key))
