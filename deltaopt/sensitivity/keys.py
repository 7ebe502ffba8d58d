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
from collections.abc import Callable, Mapping
from itertools import chain
from typing import Any

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError
from deltaopt.files.units import whatever_in_si

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
        *keys, last = header.split()
        how = _HOW.get(last) if keys else None
        for key in keys if how else [*keys, last]:
            change = _moved if key.startswith("place.") else _change
            found = change(found, key, how or (lambda _, by: by), value)
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
    try:
        node[place] = how(whatever_in_si(old), by)
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
    known = [whatever_in_si(point) for point in points if not isinstance(point, str)]
    return np.unique(np.array(known, dtype=float), axis=0)


def _moved(content: Content, key: str, how: Callable[[Any, Any], Any], to: Any) -> Content:
    """A scene or a cycle with all its points elsewhere: the middle of its ends along one axis."""
    if key not in PLACE:
        raise SceneError(None, key, None, "place.x, place.y or place.z", "is not a known key")
    by, old = np.zeros(3), float(ends_of(content).mean(axis=0)[PLACE.index(key)])
    by[PLACE.index(key)] = how(old, to) - old

    def moved(key: str, value: Any) -> Any:
        if key in _POINTS and isinstance(value, list):
            return np.add(whatever_in_si(value), by).tolist()
        if isinstance(value, list):
            return [moved("at" if key in _LISTS_OF_POINTS else "", each) for each in value]
        return {k: moved(k, v) for k, v in value.items()} if isinstance(value, dict) else value

    for leg in [content, *content.get("cycle", ())]:
        leg |= {key: moved(key, leg[key]) for key in _IN_CELL if key in leg}
    return content
