"""Scenes on which something failed, written so that ``deltaopt plan`` shows it again."""

from __future__ import annotations

from pathlib import Path

import deltaopt
from deltaopt.files.yaml_file import write_yaml


def write_scene(name: Path, scene: deltaopt.Scene, problem: str) -> Path:
    """Write a scene beside its robot, with what is wrong as a comment, and return its file.

    ``name``: of the file, without its ending.
    """
    name.parent.mkdir(parents=True, exist_ok=True)
    robot, file = (name.with_name(f"{name.name}{ending}") for ending in (".robot.yaml", ".yaml"))
    write_yaml(robot, scene.robot.model_dump(mode="json", exclude_none=True))
    content = scene.model_dump(mode="json", exclude_none=True)
    write_yaml(file, {**content, "robot": robot.name}, comment=problem)
    return file
