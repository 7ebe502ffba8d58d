"""All keys of robot and scene files, as the pages docs/robot-keys.md, drive-keys.md, scene-keys.md.

Names, what they may be, units, defaults and explanations are those of the records that read the
files; the examples are those of `deltaopt new`. So the pages say what the program does.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Mapping, Sequence
from inspect import getdoc
from pathlib import Path

from deltaopt.files.atomic_write import atomic_write
from deltaopt.files.validated_record import Record
from deltaopt.output.starting_files import (
    ROBOT,
    ROBOT_EXTRAS,
    SCENE,
    SCENE_EXTRAS,
    Key,
    keys_of,
)
from deltaopt.robot.robot import Robot
from deltaopt.scene.scene import Scene

HELP = "write the pages that list all keys of robot and scene files"
SMALL: dict[str, object] = {}
DRIVE = "drive"
"""A key of robots that has a page of its own."""

_ABOUT = """\
Numbers are in SI units, or texts with a unit such as `350 mm` ([units](units.md)). A key that is
not required may be left out: what it names is then neither modelled nor limited, unless a default
is given. Points are `[x, y, z]` from the base's centre, **x down** ([your robot](your-robot.md)).

`python -m studies reference -o docs` writes this page, from the code that reads the files."""


def pages() -> dict[str, str]:
    """The text of each page by the name of its file."""
    robot = list(_sections(Robot, {**ROBOT, **ROBOT_EXTRAS}, ""))
    scene = list(_sections(Scene, {**SCENE, **SCENE_EXTRAS}, ""))
    drive = [each for each in robot if each.startswith(f"## `{DRIVE}")]
    rest = [each for each in robot if each not in drive]
    return {
        "robot-keys.md": _page("Keys of a robot file", rest),
        "drive-keys.md": _page("Keys of a robot's drive", drive),
        "scene-keys.md": _page("Keys of a scene file", scene),
    }


def _page(title: str, sections: Sequence[str]) -> str:
    return "\n\n".join([f"# {title}", _ABOUT, *sections]) + "\n"


def _sections(record: type[Record], examples: Mapping[str, str], inside: str) -> Iterator[str]:
    """A section of a record's keys, and then of each record in it."""
    keys = list(keys_of(record))
    title = f"`{inside[:-1]}`" if inside else "The file itself"
    rows = "\n".join(_row(key, examples.get(inside + key.name, "")) for key in keys)
    table = f"| key | what it is | default | example |\n|---|---|---|---|\n{rows}"
    yield f"## {title}\n\n{_explained(record)}\n\n{table}"
    for key in keys:
        if key.inner is not None:
            yield from _sections(key.inner, examples, f"{inside}{key.name}.")


def _row(key: Key, example: str) -> str:
    default = "required" if key.required else "" if key.default is None else str(key.default)
    cells = (f"`{key.name}`", key.expected, default, f"`{example}`" if example else "")
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _explained(record: type[Record]) -> str:
    """What the record's docstring says, for readers of files: a key that is None is absent."""
    text = re.sub(r"\s*\bRaises [^.]*\.", "", str(getdoc(record))).replace("``", "`")
    text = re.sub(r"(?<=\.)(\s)None\b", r"\1Absent", text)
    return re.sub(r"\bNone\b", "absent", text).strip()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "-o",
        dest="directory",
        type=Path,
        metavar="DIR",
        help="write the pages there, docs/ for example, instead of printing them",
    )


def run(arguments: argparse.Namespace) -> int:
    for name, text in pages().items():
        if arguments.directory is None:
            print(text)
            continue
        file = arguments.directory / name
        with atomic_write(file) as temporary:
            temporary.write_text(text, encoding="utf-8")
        print("written:", file)
    return 0
