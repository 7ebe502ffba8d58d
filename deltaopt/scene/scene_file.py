"""Scene files, and the files that they name: of robots, of points of a path, of bodies."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

import numpy as np

from deltaopt.curves.piecewise import Array
from deltaopt.errors import SceneError, inside, shown
from deltaopt.files.regular_file import content_of
from deltaopt.files.units import LENGTH, Misread
from deltaopt.files.yaml_file import placed_in, read_yaml
from deltaopt.robot.robot import Robot, load_robot
from deltaopt.robot.solids import MOST_TRIANGLES
from deltaopt.scene.convex_hull import NoHull, convex_hull
from deltaopt.scene.cycle import EXPECTED_LEGS, MOST_LEGS, Cycle, start_after
from deltaopt.scene.path import points_in
from deltaopt.scene.scene import NO_KEYS, ROBOT_FILE, Scene

_HEADER, _COUNT = 80, 4
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_LARGEST_STL = 20
"""Largest size of a file, MB: of 400,000 triangles, where bodies here have a hundred at most."""
_STL = "an STL file, lengths in m"


_OTHER_FILES = {
    "base_radius": ("robot", "it names this one as robot"),
    "scenes": ("design", "deltaopt design takes this one"),
    "scene": ("sweep", "deltaopt sweep takes this one"),
}
"""By a key that files of other kinds have: which kind, and what it is for."""
_OF_CYCLES = "none in a leg, which has the robot of all legs, and starts where the one before ends"


def load_scene(path: str | Path) -> Scene:
    """Read a scene file and the robot file it names.

    Raises SceneError, naming file and key, if either cannot be used.

    Examples:
        >>> scene = deltaopt.load_scene("problems/pick_and_place.yaml")
        >>> scene.start
        (0.45, -0.05, 0.0)
    """
    file = Path(path)
    return _single(file, read_yaml(file))


def load_cycle(path: str | Path) -> Cycle:
    """Read the file of a cycle and the robot file it names.

    Its key ``cycle`` lists the legs: what stands there of a scene is for that leg, and what stands
    beside it for all of them; bodies and limits of both are there. Raises SceneError, naming file
    and key, if either cannot be used.

    Examples:
        >>> cycle = deltaopt.load_cycle("problems/cycles/there_and_back.yaml")
        >>> len(cycle.legs), cycle.dwells
        (2, (0.05, 0.05))
    """
    file = Path(path)
    return _cycle(file, read_yaml(file))


def content_with_files(path: str | Path) -> dict[str, object]:
    """The content of the file of a scene or a cycle, with that of the files that it names in their
    place: the robot's as a mapping, and points of paths and bodies.

    Raises SceneError, naming file and key, if any of them cannot be read.
    """
    file = Path(path)
    content = read_yaml(file)
    content["robot"] = read_yaml(_robot_file(file, content.get("robot")))
    legs = content.get("cycle")
    with placed_in(file):
        for each in [content, *(legs if isinstance(legs, list) else [])]:
            if isinstance(each, dict):
                each |= _with_all_points(file.parent, each)
    return content


def made_of(content: Mapping[str, object], file: Path) -> Scene | Cycle:
    """The scene, or the cycle, of the content of a ``file``, as ``content_with_files`` returns it.

    Raises SceneError, naming file and key, if it cannot be used.
    """
    given = content.get("robot")
    if not isinstance(given, Mapping):
        expected = "keys of a robot; a sweep names files of robots under robot, beside grid"
        raise SceneError(file, "robot", given, expected)
    with inside(file=file, key="robot"):
        robot = Robot.model_validate(given)
    return (_cycle if "cycle" in content else _single)(file, {**content, "robot": robot})


def _single(file: Path, content: dict[str, object]) -> Scene:
    for key, (kind, use) in _OTHER_FILES.items():
        if key in content and "start" not in content:
            raise SceneError(file, "", None, f"a scene file; {use}", f"is a {kind} file")
    if "cycle" in content:
        expected = "start and goal; cycles are for deltaopt plan, check and map, and load_cycle"
        with placed_in(file):
            raise SceneError(None, "cycle", None, expected, "is no key of a single motion")
    return _scene(file, _with_robot(file, content), lambda key: key)


def _cycle(file: Path, content: dict[str, object]) -> Cycle:
    content = _with_robot(file, content)
    given, period = content.pop("cycle", None), content.pop("period", None)
    start, limits = content.pop("start", None), content.get("limits")
    with placed_in(file):
        if not isinstance(given, list) or not all(isinstance(leg, dict) for leg in given):
            problem = "is missing" if given is None else ""
            raise SceneError(None, "cycle", given, EXPECTED_LEGS, problem)
        if not 2 <= len(given) <= MOST_LEGS:
            problem = f"has {len(given)} leg{'s' * (len(given) != 1)}"
            raise SceneError(None, "cycle", given, EXPECTED_LEGS, problem)
        if "goal" in content:
            raise SceneError(None, "goal", content["goal"], "none: each leg of a cycle has its own")
        for index, leg in enumerate(given):
            for key in sorted({"robot", "start"} & set(leg)):
                raise SceneError(None, f"cycle[{index}].{key}", leg[key], _OF_CYCLES)
    if isinstance(start, dict) and "belt" in start:  # that of the last leg's next part
        start = {{"belt": "velocity"}.get(key, key): each for key, each in start.items()}
    fields: dict[str, object] = {"period": period}
    if isinstance(limits, dict):
        content["limits"] = {key: each for key, each in limits.items() if key != "rms_torque"}
        fields["rms_torque"] = limits.get("rms_torque")
    legs, dwells = list[Scene](), list[object]()
    for index, leg in enumerate(given):
        own = dict(leg)
        dwells.append(own.pop("dwell", 0.0))
        for key in ("keep_out", "limits"):
            everywhere, here = content.get(key), own.get(key)
            if isinstance(everywhere, list) and isinstance(here, list):
                own[key] = [*everywhere, *here]
            elif isinstance(everywhere, dict) and isinstance(here, dict):
                own[key] = everywhere | here
        inside = partial(_in_leg, index, own)
        begun = {} if start is None else {"start": start}
        legs.append(_scene(file, {**content, **own, **begun}, inside))
        start = start_after(legs[-1].goal)
    in_file = {"rms_torque": "limits.rms_torque", "legs": "cycle"}
    with placed_in(file, lambda key: in_file.get(key, key)):
        return Cycle.model_validate({"legs": tuple(legs), "dwells": dwells, **fields})


def load_job(path: str | Path) -> Scene | Cycle:
    """Read the file of a scene, or of a cycle, and the robot file it names. Raises SceneError."""
    return load_cycle(path) if "cycle" in read_yaml(Path(path)) else load_scene(path)


def _in_leg(index: int, own: Mapping[str, object], key: str) -> str:
    """The key in the file of what is wrong in a leg, which has some keys of its ``own``."""
    return f"cycle[{index}].{key}" if key.split(".")[0].split("[")[0] in {*own, "goal"} else key


def _with_robot(file: Path, content: dict[str, object]) -> dict[str, object]:
    if "robot" in content and not isinstance(content["robot"], Robot):
        content["robot"] = load_robot(_robot_file(file, content["robot"]))
    return content


def _scene(file: Path, content: dict[str, object], named: Callable[[str], str]) -> Scene:
    """The scene of a file's content; ``named``: how the file calls a key of it."""
    with placed_in(file, named):
        for key, expected in NO_KEYS.items():
            if key in content:
                raise SceneError(None, key, None, expected, "is not a known key")
        limits = content.get("limits")
        if isinstance(limits, dict) and "rms_torque" in limits:
            expected = "none of a single motion or a leg, but in the limits of a cycle"
            raise SceneError(None, "limits.rms_torque", limits["rms_torque"], expected)
        return Scene.model_validate(_with_all_points(file.parent, content))


def _with_all_points(folder: Path, content: Mapping[str, object]) -> dict[str, object]:
    """The content of a scene with points instead of the names of files in a folder that have
    them."""
    found, given, bodies = dict(content), content.get("path"), content.get("keep_out")
    if isinstance(given, dict) and isinstance(given.get("points"), str):
        found["path"] = {**given, "points": points_in(folder / given["points"])}
    if isinstance(bodies, list):
        numbered = ((f"keep_out[{index}]", body) for index, body in enumerate(bodies))
        found["keep_out"] = [_with_points(folder, *each) for each in numbered]
    return found


def _with_points(folder: Path, key: str, body: object) -> object:
    """The content of a body, whose key this is, with the corners of a file's convex hull instead of
    its name."""
    hull = body.get("hull") if isinstance(body, dict) else None
    if not (isinstance(hull, dict) and isinstance(hull.get("file"), str)):
        return body
    named = f"{key}.hull.file"
    try:
        points = corners_in(folder / hull["file"])
        points = points[np.unique(convex_hull(points, MOST_TRIANGLES))]
    except NoHull as error:
        raise SceneError(None, named, hull["file"], f"an STL file with {error}") from None
    except SceneError as error:
        problem = f"{error.file} {error.problem}"
        raise SceneError(None, named, hull["file"], error.expected, problem) from None
    others = {key: value for key, value in hull.items() if key != "file"}
    return {"hull": {**others, "points": points.tolist()}}


def corners_in(file: Path) -> Array:
    """The distinct corners in an STL file, (N, 3), in its unit of length.

    Raises SceneError where it cannot be read.
    """
    try:
        content = content_of(file, _LARGEST_STL)
    except OSError as error:
        raise SceneError(file, "", None, _STL, str(error.strerror)) from None
    body = content[_HEADER + _COUNT :]
    number = int.from_bytes(content[_HEADER : _HEADER + _COUNT], "little")
    if number and len(body) == number * _TRIANGLE.itemsize:
        found = np.frombuffer(body, _TRIANGLE)["corners"].reshape(-1, 3).astype(float)
    else:
        found = _corners_of_text(content.decode("ascii", errors="replace"), file)
    if not len(found) or not np.isfinite(found).all():
        raise SceneError(file, "", None, _STL, "has no triangles")
    try:
        LENGTH.in_si(float(np.abs(found).max()))
    except Misread as error:
        raise SceneError(file, "", None, f"{_STL}, not mm", f"has a corner that {error}") from None
    return np.asarray(np.unique(found, axis=0))


def _corners_of_text(text: str, file: Path) -> Array:
    """The numbers of all lines that begin with ``vertex``."""
    try:
        rows = [
            [float(word) for word in words[1:]]
            for words in map(str.split, text.splitlines())
            if words and words[0].lower() == "vertex"
        ]
        return np.array(rows, dtype=float).reshape(-1, 3)
    except ValueError:
        raise SceneError(file, "", None, _STL, "is not an STL file") from None


def _robot_file(scene_file: Path, value: object) -> Path:
    if isinstance(value, str) and os.path.isfile(scene_file.parent / value):
        return scene_file.parent / value
    problem = f"is {shown(value)}, which is no file" if isinstance(value, str) else ""
    with placed_in(scene_file):
        raise SceneError(None, "robot", value, ROBOT_FILE, problem)
