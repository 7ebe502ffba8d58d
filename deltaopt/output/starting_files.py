"""A robot file and a scene file to start from, with every key there is and what it means.

The files stand in ``starting``. Their comments are what the records that read the files say of
their keys, which a test holds against each other. A key that is not needed is commented out.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from deltaopt.errors import DeltaOptError
from deltaopt.files.output_folder import write_texts

ROBOT_FILE, SCENE_FILE, CELL_FILE = "robot.yaml", "scene.yaml", "cell.yaml"
"""Names of the texts: of a robot, of a single motion, and of a packaging cell with a cycle."""


class FilesExist(DeltaOptError):
    """A file that would be made is there already."""


def write_starting_files(directory: Path, scene: str = SCENE_FILE) -> list[Path]:
    """Write robot.yaml and scene.yaml into a directory, made if need be; returns their paths.

    ``scene``: which text scene.yaml has, that of a single motion with every key or of a cell.

    Raises FilesExist where one of them exists, for somebody may have written in it, and OSError
    where they cannot be written.
    """
    for name in (ROBOT_FILE, SCENE_FILE):
        if (directory / name).exists():
            raise FilesExist(
                f"{directory / name} exists and is not overwritten; name another folder"
            )
    return write_texts(directory, {ROBOT_FILE: text_of(ROBOT_FILE), SCENE_FILE: text_of(scene)})


def text_of(name: str) -> str:
    """The text of a file to start from."""
    return (files("deltaopt.output") / "starting" / name).read_text(encoding="utf-8")
