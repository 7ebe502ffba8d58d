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
from collections.abc import Callable, Iterator, Mapping
from difflib import get_close_matches
from functools import partial
from itertools import chain
from typing import Any, Protocol

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError
from deltaopt.files.units import whatever_in_si

Content = dict[str, Any]
PLACE = "place"
_ENDS = ("start", "goal")
_POINTS = {"at", "from", "to", "centre", "point", "start", "goal"}
"""Keys of points in space, of scenes and of bodies, and of lists of them:"""
_LISTS_OF_POINTS = {"via", "points"}
_IN_CELL = ("start", "goal", "via", "path", "keep_out", "cycle")
"""Keys of a scene under which points stand. Those of a tool are in its own frame, and an approach
has the keys start and goal for other things."""


def changed(content: Mapping[str, Any], changes: Mapping[str, Any]) -> Content:
    """The content of files with changes, in SI units, by the headers of their columns.

    Raises SceneError where there is no such key to change.
    """
    found: Content = json.loads(json.dumps(content))
    for header, value in changes.items():
        keys, change = parsed(header)
        for key in keys:
            found = _with(found, key, partial(change, given=value))
    return found


class _How(Protocol):
    def __call__(self, old: Any, given: Any) -> Any: ...


def parsed(header: str) -> tuple[list[str], _How]:
    """The keys that a column is of, and what its values do to them."""
    *keys, last = header.split()
    if keys and last in _HOW:
        return keys, _HOW[last]
    return [*keys, last], lambda old, given: given


_HOW: dict[str, _How] = {
    "times": lambda old, given: np.multiply(old, given).tolist(),
    "plus": lambda old, given: np.add(old, given).tolist(),
}


def _with(content: Content, key: str, change: Callable[[Any], Any]) -> Content:
    """The content with the value of a key changed. Raises SceneError."""
    if key.split(".")[0] == PLACE:
        middle = middle_of(content)
        place = dict(zip("xyz", middle.tolist(), strict=True))
        _change({PLACE: place}, key, key, change)
        if len(place) > len("xyz"):
            raise SceneError(None, key, None, "place.x, place.y or place.z", "is not a known key")
        return _moved(content, np.array([*place.values()]) - middle)
    _change(content, key.replace("[", ".").replace("]", ""), key, change)
    return content


def _change(node: Any, rest: str, key: str, change: Callable[[Any], Any]) -> None:
    """Change the value at a dotted key, ``rest``, of a mapping or a list; ``key``: all of it."""
    name, _, rest = rest.partition(".")
    if isinstance(node, list):
        if not (name.isdigit() and int(name) < len(node)):
            expected = f"a place in a list of {len(node)}, counted from 0"
            raise SceneError(None, key, None, expected, f"has the part {name}")
        index: Any = int(name)
    elif isinstance(node, dict):
        index = name
    else:
        raise SceneError(None, key, None, "a key that is there", f"has no part {name}")
    if rest:
        if isinstance(node, dict):
            node.setdefault(index, {})
        return _change(node[index], rest, key, change)
    old = node[index] if isinstance(node, list) else node.get(index)
    try:
        node[index] = change(whatever_in_si(old))
    except TypeError:
        given = "is not given" if old is None else "is no number"
        near = get_close_matches(name, node, n=1) if isinstance(node, dict) else []
        expected = "a number to change" + (f", such as {near[0]}" if near else "")
        raise SceneError(None, key, old, expected, f"{given} in the file") from None
    return None


def middle_of(content: Mapping[str, Any]) -> Array:
    """The middle of all starts and goals of a scene or a cycle, (3,), m."""
    return np.asarray(ends_of(content).mean(axis=0))


def ends_of(content: Mapping[str, Any]) -> Array:
    """All starts and goals of a scene or a cycle, each once, (N, 3), m."""
    legs = chain([content], content.get("cycle") or ())
    ends = (leg[end] for leg in legs for end in _ENDS if end in leg)
    points = (end["at"] if isinstance(end, dict) else end for end in ends)
    known = [whatever_in_si(point) for point in points if not isinstance(point, str)]
    return np.unique(np.array(known, dtype=float), axis=0)


def _moved(content: Content, by: Array) -> Content:
    """A scene or a cycle with all its points, (3,) m, elsewhere."""

    def moved(key: str, value: Any) -> Any:
        if key in _LISTS_OF_POINTS and isinstance(value, list):
            return [moved("at", each) for each in value]
        if key in _POINTS and isinstance(value, list):
            return np.add(whatever_in_si(value), by).tolist()
        if isinstance(value, list):
            return [moved("", each) for each in value]
        return dict(inside(value)) if isinstance(value, dict) else value

    def inside(node: Content) -> Iterator[tuple[str, Any]]:
        return ((key, moved(key, value)) for key, value in node.items())

    def of_leg(leg: Content) -> Content:
        return leg | {key: moved(key, leg[key]) for key in _IN_CELL[:-1] if key in leg}

    legs = content.get("cycle")
    return of_leg(content) | ({} if legs is None else {"cycle": [of_leg(leg) for leg in legs]})
