"""Scene files, and the files that they name: of robots, of points of a path, of bodies."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from deltaopt.errors import SceneError, shown
from deltaopt.files.yaml_file import place_of, read_yaml
from deltaopt.robot.robot import load_robot
from deltaopt.robot.solids import MOST_TRIANGLES
from deltaopt.scene.convex_hull import NoHull, convex_hull
from deltaopt.scene.path import points_in
from deltaopt.scene.scene import NO_KEYS, ROBOT_FILE, Scene
from deltaopt.scene.stl import corners_in


def load_scene(path: str | Path) -> Scene:
    """Read a scene file and the robot file it names.

    Raises SceneError, naming file and key, if either cannot be used.
    """
    file = Path(path)
    content = read_yaml(file)
    for key, expected in NO_KEYS.items():
        if key in content:
            raise SceneError(file, key, None, expected, "is not a known key", place_of(file, key))
    if "robot" in content:
        content["robot"] = load_robot(_robot_file(file, content["robot"]))
    given = content.get("path")
    if isinstance(given, dict) and isinstance(given.get("points"), str):
        content["path"] = {**given, "points": _points(file, given["points"])}
    bodies = content.get("keep_out")
    if isinstance(bodies, list):
        named = ((f"keep_out[{index}]", body) for index, body in enumerate(bodies))
        content["keep_out"] = [_with_points(file, *each) for each in named]
    return Scene.from_content(content, file)


def _with_points(scene_file: Path, key: str, body: object) -> object:
    """The content of a body, whose key this is, with the corners of a file's convex hull instead of
    its name."""
    hull = body.get("hull") if isinstance(body, dict) else None
    if not (isinstance(hull, dict) and isinstance(hull.get("file"), str)):
        return body
    named = f"{key}.hull.file"
    try:
        points = corners_in(scene_file.parent / hull["file"])
        points = points[np.unique(convex_hull(points, MOST_TRIANGLES))]
    except NoHull as error:
        place, expected = place_of(scene_file, named), f"an STL file with {error}"
        raise SceneError(scene_file, named, hull["file"], expected, place=place) from None
    except SceneError as error:
        place, problem = place_of(scene_file, named), f"{error.file} {error.problem}"
        raise SceneError(scene_file, named, hull["file"], error.expected, problem, place) from None
    others = {key: value for key, value in hull.items() if key != "file"}
    return {"hull": {**others, "points": points.tolist()}}


def _points(scene_file: Path, name: str) -> list[list[float]]:
    """The points of a CSV file, relative to the scene file."""
    try:
        return points_in(scene_file.parent / name)
    except SceneError as error:
        place = place_of(scene_file, "path.points")
        raise error.inside(file=scene_file, place=place) from None


def _robot_file(scene_file: Path, value: object) -> Path:
    if isinstance(value, str) and os.path.isfile(scene_file.parent / value):
        return scene_file.parent / value
    problem = f"is {shown(value)}, which is no file" if isinstance(value, str) else ""
    place = place_of(scene_file, "robot")
    raise SceneError(scene_file, "robot", value, ROBOT_FILE, problem, place)
