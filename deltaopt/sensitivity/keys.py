"""Changes of the content of scene and robot files, by dotted keys.

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
from collections.abc import Callable, Iterator, Mapping
from itertools import chain
from typing import Any, get_args

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError, shown
from deltaopt.files.units import LENGTH, RATIO, Misread, Quantity, percentage
from deltaopt.files.validated_record import Record
from deltaopt.robot.robot import Robot
from deltaopt.scene.cycle import Cycle
from deltaopt.scene.scene import Scene

Content = dict[str, Any]
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
        how = _HOW.get(header.split()[-1], lambda _, by: by)
        for key in _keys(header):
            change = _moved if key.startswith("place.") else _change
            found = change(found, key, how, value)
    return found


def parts_of(key: str) -> list[str]:
    """The names and places in lists that a key is made of."""
    return re.findall(r"[^.\[\]]+", key)


def _change(content: Content, key: str, how: Callable[[Any, Any], Any], by: Any) -> Content:
    """Change the value at a dotted key. Raises SceneError."""
    node: Any = content
    *outside, last = parts_of(key)
    for part in outside:
        place = _place_in(node, part, key)
        node = node.setdefault(place, {}) if isinstance(node, dict) else node[place]
    place = _place_in(node, last, key)
    old = node.get(place) if isinstance(node, dict) else node[place]
    if how in _HOW.values() and np.ndim(by):  # several numbers from one, such as a range of payload
        raise SceneError(None, key, by, "one number, by which all of it is changed")
    try:
        node[place] = how(in_si(key, old), by)
    except TypeError:
        problem = "is not given in the file" if old is None else "is no number in the file"
        raise SceneError(None, key, old, "a number to change", problem) from None
    return content


def _place_in(node: Any, part: str, key: str) -> Any:
    """The key of a mapping, or the place in a list, that a part of a key names."""
    if isinstance(node, dict):
        return part
    if isinstance(node, list) and part.isdigit() and int(part) < len(node):
        return int(part)
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
    it is not known what of. Raises SceneError where its unit is another, or it is too large."""
    return [_in_si(header, key, value) for key in _keys(header)][-1]


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
    """The keys that a header names."""
    words = header.split()
    return words[:-1] if words[-1] in _HOW else words


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
        fields = (record.model_fields.get(name) for record in records)
        field = next(filter(None, fields), None)
        if field is not None:  # else a place in a list, or the word that tells a path's kind
            inside = _inside(field.annotation)
            kinds = [Robot] if name == "robot" else [*inside, *field.metadata]
    found = [kind for kind in kinds if isinstance(kind, Quantity)]
    of_point = int(parts[-1]) if parts[-1].isdigit() and len(found) > 1 else 0
    return found[of_point] if of_point < len(found) else None


def _inside(kind: Any) -> Iterator[Any]:
    """A type and all that it is made of, marks among them."""
    yield kind
    for inner in get_args(kind):
        yield from _inside(inner)
